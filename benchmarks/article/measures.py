"""Measures that need the true parameters, and how soon a search has converged.

The article sums the relative errors of all parameters. A sum counts directions that the data do not
determine: there an estimate is where chance left it. `identifiable error` sums the same relative errors after
projecting them on the directions that the data determine (choices.md).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hydroid.parameters import Array, relative_error
from hydroid.posterior.flags import WEAK_ABOVE
from hydroid.posterior.jacobian import jacobian
from hydroid.problem.problem import Problem
from hydroid.studies.runs import Result, Task
from hydroid.studies.study import Row

CONVERGED = 0.05
"""part of the objective's whole descent that is left when a search counts as converged"""

UNITS = {
    "objective": "", "largest error": "deg", "mean absolute error": "deg", "rms error": "deg",
    "mean squared error": "deg²", "generations": "", "simulations": "", "diverged": "", "seconds": "",
    "total mass": "kg", "parameter error": "", "identifiable error": "", "mass error": "kg",
}  # fmt: skip
"""units; `value NAME` has the parameter's, `check NAME` deg, `error NAME` none"""


@dataclass(frozen=True, eq=False)
class Directions:
    """What the data determine at the true parameters.

    names: of the p free parameters. truth: their values, (p,). relative_sd: of each direction, smallest
    first, (p,). axes: these directions, relative changes of unit length, one a row, (p, p).
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
    theta, free = problem.parameters.vector(truth, "truth"), problem.parameters.free
    slopes = np.nan_to_num(jacobian(problem, theta).slopes[free])
    axes, singular, _ = np.linalg.svd(slopes, full_matrices=False)
    with np.errstate(divide="ignore"):
        relative = np.radians(noise_deg) / singular
    names = tuple(n for n, f in zip(problem.parameters.names, free, strict=True) if f)
    return Directions(names, theta[free], relative, axes.T)


def with_truth(row: Row, task: Task, result: Result, directions: Directions | None) -> Row:
    """Return a run's measures with those of the article."""
    if row.failed:
        return row
    values, theta = dict(row.values), result["theta"]
    masses = [n for n, p in task.settings.parameters.items() if p.quantity == "mass"]
    values["mean squared error"] = values["rms error"] ** 2
    values["generations"] = generations_to_converge(result["history"])
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
    return replace(row, values=values)


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
