"""Measures of an estimate, of a search's course, and of what a record can tell.

page.md defines those of the tables.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from hydroid.parameters import Array
from hydroid.posterior.error_model import likelihood_at
from hydroid.posterior.linear import linearised
from hydroid.posterior.uncertainty import WEAK_ABOVE
from hydroid.problem.problem import Problem

CONVERGED = 0.05
"""part of the objective's whole descent that is left when a search counts as
converged"""
DETERMINED_AT_DEG = 0.1
"""noise of the angle for which a direction counts as identifiable [deg]"""
PEAK_DEG = 3.0
"""how far a maximum of the angle stands out to count as a peak [deg]"""


class Directions:
    """What the data determine at the true parameters.

    slopes: derivatives of the output by relative changes of the p free parameters
    [rad], (p, R). axes: the identifiable directions, of unit length, (rank, p).
    """

    def __init__(self, problem: Problem, truth: Mapping[str, float]) -> None:
        self.parameters = problem.parameters
        self.truth = self.parameters.vector(truth, "truth")
        likelihood = likelihood_at(problem, self.truth)
        self.slopes = likelihood.errors.errors(
            linearised(likelihood, self.truth).slopes
        )
        self.axes = determined(self.slopes)
        self.names = [
            n
            for n, free in zip(self.parameters.names, self.parameters.free, strict=True)
            if free
        ]

    def measures(self, values: Mapping[str, float]) -> dict[str, float]:
        estimate, free = self.parameters.vector(values, "a run"), self.parameters.free
        change = ((estimate - self.truth) / self.truth)[free]
        masses = [i for i, p in enumerate(self.parameters.parameters) if p.unit == "kg"]
        result = {
            f"error {n}": abs(float(c)) for n, c in zip(self.names, change, strict=True)
        }
        result["parameter error"] = float(np.abs(change).sum())
        result["identifiable error"] = float(
            np.abs(self.axes.T @ (self.axes @ change)).sum()
        )
        total = {"mass error": abs(float(np.sum((estimate - self.truth)[masses])))}
        return result | (total if free[masses].any() else {})

    def sensitivities(self, segments: NDArray[np.int64]) -> dict[str, float]:
        """Return how strongly the output depends on each parameter, in all and by
        segment, (S, 2)."""
        rms = np.degrees(0.01 * np.sqrt(np.mean(self.slopes**2, axis=1)))
        parts = [self.slopes[:, first:end] for first, end in segments]
        norms = np.array([np.linalg.norm(part, axis=1) for part in parts])
        ratios = norms[:, self.names.index("D")] / norms[:, self.names.index("S")]
        slopes = {f"slope {n}": float(s) for n, s in zip(self.names, rms, strict=True)}
        for p, true in zip(
            self.parameters.parameters, self.truth.tolist(), strict=True
        ):
            if p.unit == "kg" and p.name in self.names:
                slopes[f"slope {p.name} per kg"] = slopes[f"slope {p.name}"] / (
                    0.01 * true
                )
        return slopes | {
            "D over S, lowest segment": float(min(ratios)),
            "D over S, highest segment": float(max(ratios)),
            "directions of the record": len(self.axes),
            "directions of one segment": max(len(determined(part)) for part in parts),
        }


def determined(slopes: Array) -> Array:
    """Return the directions, (rank, p), known to WEAK_ABOVE at DETERMINED_AT_DEG of
    white noise."""
    axes, singular, _ = np.linalg.svd(slopes, full_matrices=False)
    with np.errstate(divide="ignore"):  # the largest comes first
        rank = int(np.sum(np.radians(DETERMINED_AT_DEG) / singular <= WEAK_ABOVE))
    return axes.T[:rank]


def output_errors(problem: Problem, theta: Array) -> dict[str, float]:
    """Return the errors of the first log's compared angle [deg] for parameters (P,),
    and those at its peaks.

    `peak height` is the rise over the start at the measured angle's maxima, simulated
    over measured.
    """
    measured = np.degrees(problem.logs[0].angle[:, problem.outputs[0]])
    response = np.degrees(problem.responses(theta[None])[0].angle[0, :, 0])
    error, peaks = response - measured, find_peaks(measured, prominence=PEAK_DEG)[0]
    masses = [i for i, p in enumerate(problem.parameters.parameters) if p.unit == "kg"]
    found = {
        "largest error": float(np.abs(error).max()),
        "mean absolute error": float(np.abs(error).mean()),
        "mean squared error": float(np.mean(error**2)),
        "rms error": float(np.sqrt(np.mean(error**2))),
        "error over motion": float(np.abs(error).max() / np.ptp(measured)),
        "total mass": float(sum(theta[masses])),
    }
    if peaks.size:
        rise = float(np.mean(measured[peaks]) - measured[0])
        found["peak error"] = float(np.mean(error[peaks]))
        found["peak height"] = 1 + found["peak error"] / rise
    return found


def course(history: Sequence[Sequence[float | None]]) -> dict[str, Any]:
    """Return the generation after which CONVERGED of the best objective's descent is
    left, and its course.

    `history` has rows of generation, simulations and best objective; the descent begins
    with the first finite one.
    """
    best = np.array(
        [np.nan if row[2] is None else row[2] for row in history], dtype=float
    )
    finite = best[np.isfinite(best)]
    limit = finite[-1] + CONVERGED * (finite[0] - finite[-1])
    return {
        "generations": float(history[int(np.argmax(best <= limit))][0] or 0),
        "objective at half": float(best[(len(best) - 1) // 2]),
        "history": " ".join(f"{value:.4g}" for value in best),
    }
