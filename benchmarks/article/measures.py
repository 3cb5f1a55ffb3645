"""Measures that need the true parameters, and how soon a search has converged.

The article sums the relative errors of all parameters. A sum counts directions that the data do not
determine: there an estimate is where chance left it. `identifiable error` sums the same relative errors after
projecting them on the directions that the data determine (choices.md).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hydroid.parameters import Array, ParameterSet
from hydroid.posterior.linear import linearised
from hydroid.posterior.uncertainty import WEAK_ABOVE
from hydroid.problem.problem import Problem
from hydroid.studies import Result, Row

CONVERGED = 0.05
"""part of the objective's whole descent that is left when a search counts as converged"""
DETERMINED_AT_DEG = 0.1
"""noise of the angle for which a direction counts as identifiable [deg]"""
BLIND, CENTRE = "blind draw", "centre of the box"
"""cells of estimates that no data went into"""
UNITS = dict.fromkeys(("largest error", "mean absolute error", "rms error"), "deg")
UNITS |= {"mean squared error": "deg²", "total mass": "kg", "mass error": "kg"}
"""of measures that have one; `value NAME` has the parameter's, `check NAME` deg"""


@dataclass(frozen=True, eq=False)
class Directions:
    """What the data determine at the true parameters.

    parameters: all P. truth: their values, (P,). rank: how many directions are known to WEAK_ABOVE of the
    values or better. axes: these directions, relative changes of the p free ones, of unit length, (rank, p).
    """

    parameters: ParameterSet
    truth: Array
    rank: int
    axes: Array

    def measures(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the errors of an estimate."""
        estimate, free = self.parameters.vector(values, "a run"), self.parameters.free
        change = ((estimate - self.truth) / self.truth)[free]
        names = np.array(self.parameters.names)[free]
        masses = [i for i, p in enumerate(self.parameters.parameters) if p.unit == "kg"]
        result = {f"error {n}": abs(float(c)) for n, c in zip(names, change, strict=True)}  # tables 1 and 6
        result["parameter error"] = float(np.abs(change).sum())
        result["identifiable error"] = float(np.abs(self.axes.T @ (self.axes @ change)).sum())
        if masses:
            result["mass error"] = abs(float(np.sum((estimate - self.truth)[masses])))
        return result

    def without_data(self, draws: int) -> Iterator[Row]:
        """Yield the errors of estimates drawn blindly within the bounds, and of the box's centre."""
        unit = np.random.default_rng(0).random((draws, int(self.parameters.free.sum())))
        middle = np.full_like(unit[:1], 0.5)
        for cell, points in ((BLIND, unit), (CENTRE, middle)):
            for seed, theta in enumerate(self.parameters.from_unit(points), 1):
                yield Row(cell, seed, self.measures(self.parameters.mapping(theta)))


def true_directions(problem: Problem, truth: Mapping[str, float]) -> Directions:
    """Return what the data determine at the truth, with white noise of DETERMINED_AT_DEG."""
    theta = problem.parameters.vector(truth, "truth")
    axes, singular, _ = np.linalg.svd(linearised(problem, theta).slopes, full_matrices=False)
    with np.errstate(divide="ignore"):  # the largest comes first
        rank = int(np.sum(np.radians(DETERMINED_AT_DEG) / singular <= WEAK_ABOVE))
    return Directions(problem.parameters, theta, rank, axes.T[:rank])


def with_truth(row: Row, result: Result, directions: Directions | None) -> Row:
    """Return a run's measures with those of the article."""
    if row.failed:
        return row
    values = dict(row.values) | {"generations": generations_to_converge(result["history"])}
    values["mean squared error"] = values["rms error"] ** 2
    values["total mass"] = sum(v for name, v in result["theta"].items() if name.startswith("M"))
    return replace(row, values=values | (directions.measures(result["theta"]) if directions else {}))


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
