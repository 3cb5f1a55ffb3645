"""The error of a model on parts of the logs left out: each part is predicted by a refinement without it.

A term that only follows the noise loses there.
"""

import numpy as np

from hydroid.arrays import Array, Mask, record
from hydroid.estimate import finite
from hydroid.posterior.linear import least_squares_rows
from hydroid.posterior.noise import prior_weight
from hydroid.problem.problem import Problem
from hydroid.search.axes import Function
from hydroid.search.least_squares import least_squares
from hydroid.settings.search import RefinementSettings

SHORT = RefinementSettings(iterations=30, gain_tolerance=1e-3)  # of the refinements from an estimate


@record
class Refit:
    """What a short refinement leads to.

    Attributes:
        problem: what was refined.
        theta: shape (P,).
        errors: weighted output errors on each part of the samples, of refinements without that part [rad],
            shape (1, R); infinite where the start cannot be simulated.
    """

    problem: Problem
    theta: Array
    errors: Array

    @property
    def left_out(self) -> float:
        """Rms error of the angles [rad]."""
        return self.problem.rms(self.errors)[0]

    @property
    def by_joint(self) -> dict[str, float | None]:
        """Rms error of each compared joint by name [deg]."""
        rms, settings = self.problem.rms, self.problem.settings
        names = settings.arm.joint_names
        return {names[j - 1]: finite(np.degrees(rms(self.errors, [j])[0])) for j in settings.outputs}


def refitted(problem: Problem, theta: Array, weight: float | None = None) -> Refit:
    """Refine an estimate, shape (P,), with all samples, and without each part of them.

    The parts are the logs, in three groups at most, or the halves of one log. `weight` is that of a prior's
    score beside the residuals [rad]; None: as the noise at theta has it.
    """
    parameters, size = problem.parameters, problem.measured.size
    if weight is None:
        weight = prior_weight(problem, problem.residuals(theta[None])[0])
    rows = least_squares_rows(problem, theta, weight)

    def fitted(point: Array, function: Function, kept: Mask | slice = slice(None)) -> Array:
        return least_squares(
            point, lambda points: function(parameters.from_unit(points))[:, kept], SHORT
        ).point

    whole = fitted(parameters.to_unit(theta), rows)
    best, unseen = parameters.from_unit(whole), np.full(size, np.nan)
    here = rows(best[None])[0]
    if not np.isfinite(here).all():
        return Refit(problem, theta, np.full((1, size), np.inf))
    number = np.append(parts(problem), np.zeros(here.size - size))
    for part in np.unique(number[:size]):
        out = number == part
        if len(problem.logs) > 1:  # only the other logs are simulated
            kept = sorted({c.log for c in problem.channels if not out[c.rows.start]})
            others = problem.varied(problem.settings, [problem.logs[i] for i in kept])
            point = fitted(whole, least_squares_rows(others, theta, weight))
        else:
            point = fitted(whole, rows, ~out)
        unseen[out[:size]] = rows(parameters.from_unit(point)[None])[0, out]
    return Refit(problem, best, problem.unfiltered(unseen[None]))


def parts(problem: Problem) -> Array:
    """Return which part each sample is in, from 1, shape (R,)."""
    number = np.empty(problem.measured.size)
    for c in problem.channels:
        halves = np.arange(len(c.measured)) >= len(c.measured) // 2
        number[c.rows] = 1 + (c.log % 3 if len(problem.logs) > 1 else halves)
    return number
