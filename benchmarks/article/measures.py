"""Measures that need the true parameters, and how soon a search has converged.

The article sums the relative errors of all parameters. A sum counts directions that the data do not
determine: there an estimate is where chance left it. `identifiable error` sums the same relative errors after
projecting them on the directions that the data determine (choices.md).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hydroid.parameters import Array
from hydroid.posterior.flags import WEAK_ABOVE
from hydroid.posterior.linear import linearised
from hydroid.problem.problem import Problem
from hydroid.studies.runs import Result, Task
from hydroid.studies.study import Row

CONVERGED = 0.05
"""part of the objective's whole descent that is left when a search counts as converged"""
UNITS = dict.fromkeys(("largest error", "mean absolute error", "rms error"), "deg")
UNITS |= {"mean squared error": "deg²", "total mass": "kg", "mass error": "kg"}
"""of measures that have one; `value NAME` has the parameter's, `check NAME` deg"""


@dataclass(frozen=True, eq=False)
class Directions:
    """What the data determine at the true parameters.

    names: of the p free parameters. truth: their values, (p,). rank: how many directions are known to
    WEAK_ABOVE of the values or better. axes: these directions, relative changes of unit length, (rank, p).
    """

    names: tuple[str, ...]
    truth: Array
    rank: int
    axes: Array

    def measures(self, theta: Mapping[str, float]) -> dict[str, float]:
        """Return the errors of an estimate."""
        estimate = np.array([theta[n] for n in self.names])
        errors = np.abs(estimate - self.truth) / np.abs(self.truth)  # as in tables 1 and 6
        determined = self.axes.T @ (self.axes @ ((estimate - self.truth) / self.truth))
        values = {
            "parameter error": float(errors.sum()),
            "identifiable error": float(np.abs(determined).sum()),
        }
        return values | {f"error {n}": float(e) for n, e in zip(self.names, errors, strict=True)}


def true_directions(problem: Problem, truth: Mapping[str, float], noise_deg: float) -> Directions:
    """Return what the data determine at the truth, with white noise of that standard deviation."""
    theta, free = problem.parameters.vector(truth, "truth"), problem.parameters.free
    axes, singular, _ = np.linalg.svd(linearised(problem, theta).slopes, full_matrices=False)
    with np.errstate(divide="ignore"):
        rank = int(np.sum(np.radians(noise_deg) / singular <= WEAK_ABOVE))  # the largest comes first
    names = tuple(n for n, f in zip(problem.parameters.names, free, strict=True) if f)
    return Directions(names, theta[free], rank, axes.T[:rank])


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
        values |= directions.measures(theta)
        true = dict(zip(directions.names, directions.truth.tolist(), strict=True))
        if masses and set(masses) <= set(true):
            values["mass error"] = abs(values["total mass"] - sum(true[n] for n in masses))
    return replace(row, values=values)


def generations_to_converge(history: Sequence[Sequence[float | None]]) -> float:
    """Return the generation after which CONVERGED of the best objective's descent is left.

    `history` has rows of generation, simulations and best objective; the descent begins with the first
    finite one.
    """
    best = np.array([np.inf if row[2] is None else row[2] for row in history], dtype=float)
    finite = best[np.isfinite(best)]
    if not finite.size:
        return np.nan
    limit = finite[-1] + CONVERGED * (finite[0] - finite[-1])
    return float(history[int(np.argmax(best <= limit))][0] or 0)
