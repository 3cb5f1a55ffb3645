"""What a study measures of each run, by name: errors of parameters, of the output, and what a run cost.

The article sums the relative errors of all parameters. A sum counts directions that the data do not
determine: there an estimate is where chance left it. `identifiable error` sums the same relative errors after
projecting them on the directions that the data determine (docs/studies.md).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hydroid.errors import SettingsError
from hydroid.parameters import Array, relative_error
from hydroid.posterior.flags import WEAK_ABOVE
from hydroid.posterior.jacobian import jacobian
from hydroid.problem.problem import Problem
from hydroid.settings.study import StudySettings
from hydroid.study.runs import Result, Task

CONVERGED = 0.05
"""part of the objective's whole descent that is left when a search counts as converged"""

OF_RUNS = {
    "objective": "",
    "largest error": "deg",
    "mean absolute error": "deg",
    "rms error": "deg",
    "mean squared error": "deg²",
    "generations": "",
    "simulations": "",
    "diverged": "",
    "seconds": "",
    "total mass": "kg",
}
"""measures of any run, with their units"""
OF_TRUTH = {"parameter error": "", "identifiable error": "", "mass error": "kg"}
"""measures that need the true parameters"""


@dataclass(frozen=True, eq=False)
class Directions:
    """What the data determine at the true parameters.

    Attributes:
        names: of the p free parameters.
        truth: their values, shape (p,).
        relative_sd: of each direction, smallest first, shape (p,).
        axes: these directions, relative changes of unit length, shape (p, p), one a row.
    """

    names: tuple[str, ...]
    truth: Array
    relative_sd: Array
    axes: Array

    @property
    def rank(self) -> int:
        """Directions known to WEAK_ABOVE of the values or better."""
        return int(np.sum(self.relative_sd <= WEAK_ABOVE))

    def determined(self, relative: Array) -> Array:
        """Project relative errors, shape (p,), on the directions that the data determine."""
        known = self.axes[: self.rank]
        return known.T @ (known @ relative)


def true_directions(problem: Problem, truth: Mapping[str, float], noise_deg: float) -> Directions:
    """Return what the data determine at the truth, with white noise of that standard deviation."""
    theta = problem.parameters.vector(truth, "data.truth")
    free = problem.parameters.free
    slopes = np.nan_to_num(jacobian(problem, theta).slopes[free])
    axes, singular, _ = np.linalg.svd(slopes, full_matrices=False)
    with np.errstate(divide="ignore"):
        relative = np.radians(noise_deg) / singular
    names = tuple(n for n, f in zip(problem.parameters.names, free, strict=True) if f)
    return Directions(names, theta[free], relative, axes.T)


@dataclass(frozen=True, eq=False)
class Row:
    """One run: its cell and seed, its measures by name (empty where it failed), and why it failed."""

    cell: str
    seed: int
    values: Mapping[str, float]
    failed: str = ""


def measures(study: StudySettings, masses: Sequence[str], parameters: Sequence[str]) -> dict[str, str]:
    """Return the measures that a study has, with their units."""
    own = {f"value {name}": "" for name in parameters} | {
        f"check {name}": "deg" for name in study.data.checks
    }
    own = {n: u for n, u in OF_RUNS.items() if n != "total mass" or masses} | own
    if study.data.truth:
        own |= {n: u for n, u in OF_TRUTH.items() if n != "mass error" or masses}
        own |= {f"error {name}": "" for name in parameters}
    return own


def check_measures(study: StudySettings, known: Mapping[str, str], where: str) -> None:
    """Refuse a measure or a parameter that the study does not have.

    Raises:
        SettingsError: with those that it has.
    """
    named = [(f"tables.{i}.columns", c) for i, t in enumerate(study.tables) for c in t.columns]
    named += [(f"claims.{i}.column", c.column) for i, c in enumerate(study.claims) if not c.untested]
    named += [(f"figures.{i}.column", f.column) for i, f in enumerate(study.figures) if f.kind == "spread"]
    for key, name in named:
        if name not in known:
            raise SettingsError(f"{key}: no measure {name!r}", where=where, hint=f"known: {', '.join(known)}")
    parameters = [name.removeprefix("value ") for name in known if name.startswith("value ")]
    for i, figure in enumerate(study.figures):
        grouped = (n for groups in figure.orders.values() for group in groups for n in group)
        for name in (*figure.parameters, *grouped):
            if name not in parameters:
                hint = f"known: {', '.join(parameters)}"
                raise SettingsError(f"figures.{i}: no parameter {name!r}", where=where, hint=hint)


def measured(task: Task, result: Result, directions: Directions | None) -> Row:
    """Return the measures of one run."""
    if "failed" in result:
        return Row(task.cell, task.seed, {}, str(result["failed"]))
    theta: dict[str, float] = result["theta"]
    masses = [n for n, p in task.settings.parameters.items() if p.quantity == "mass"]
    values = {
        "objective": result["objective"],
        "largest error": result["largest_deg"],
        "mean absolute error": result["mean_deg"],
        "rms error": result["rms_deg"],
        "mean squared error": result["rms_deg"] ** 2,
        "generations": generations_to_converge(result["history"]),
        "simulations": result["simulations"],
        "diverged": result["diverged"],
        "seconds": result["seconds"],
    }
    values |= {f"value {name}": value for name, value in theta.items()}
    values |= {f"check {n}": math.nan if v is None else v for n, v in result["checks"].items()}
    if masses:
        values["total mass"] = sum(theta[n] for n in masses)
    if directions is not None:
        estimate = np.array([theta[n] for n in directions.names])
        errors = relative_error(estimate, directions.truth)
        signed = (estimate - directions.truth) / directions.truth
        values["parameter error"] = float(errors.sum())
        values["identifiable error"] = float(np.abs(directions.determined(signed)).sum())
        values |= {f"error {n}": float(e) for n, e in zip(directions.names, errors, strict=True)}
        true_mass = dict(zip(directions.names, directions.truth.tolist(), strict=True))
        if masses and set(masses) <= set(true_mass):
            values["mass error"] = abs(values["total mass"] - sum(true_mass[n] for n in masses))
    return Row(task.cell, task.seed, {name: float(value) for name, value in values.items()})


def generations_to_converge(history: Sequence[Sequence[float | None]]) -> float:
    """Return the generation after which CONVERGED of the best objective's descent is left.

    `history` has rows of generation, simulations and best objective; the descent begins with the first
    finite one.
    """
    best = np.array([math.inf if row[2] is None else row[2] for row in history], dtype=float)
    finite = best[np.isfinite(best)]
    if not finite.size:
        return math.nan
    limit = finite[-1] + CONVERGED * (finite[0] - finite[-1])
    return float(history[int(np.argmax(best <= limit))][0] or 0)
