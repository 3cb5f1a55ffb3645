"""The error of a model on parts of the logs left out: each part is predicted by a refinement without it.

A term that only follows the noise loses there.
"""

import math
from collections.abc import Mapping
from dataclasses import field
from functools import partial

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
        theta: shape (P,).
        left_out: rms error of the angles on each part of the samples, of refinements without that part [rad];
            infinite where the start cannot be simulated.
        by_joint: the same of each joint by name [deg].
        errors: the same of all samples, weighted [rad], shape (R,).
    """

    theta: Array
    left_out: float = math.inf
    by_joint: Mapping[str, float | None] = field(default_factory=dict[str, float | None])
    errors: Array = field(default_factory=partial(np.empty, 0))

    @classmethod
    def of(cls, problem: Problem, theta: Array, errors: Array) -> "Refit":
        """Judge a refinement by the output errors of samples that it has not seen, shape (1, R)."""
        names, settings = problem.settings.arm.joint_names, problem.settings
        by_joint = {names[j - 1]: finite(np.degrees(problem.rms(errors, [j])[0])) for j in settings.outputs}
        return cls(theta, problem.rms(errors)[0], by_joint, errors[0])


def refitted(problem: Problem, theta: Array, weight: float | None = None) -> Refit:
    """Refine an estimate, shape (P,), with all samples, and without each part of them.

    The parts are the logs, in three groups at most, or the halves of one log. `weight` is that of a prior's
    score beside the residuals [rad]; None: as the noise at theta has it.
    """
    parameters, size = problem.parameters, problem.measured.size
    if weight is None:
        weight = prior_weight(problem, problem.residuals(theta[None])[0])
    rows = least_squares_rows(problem, theta, weight)

    def fitted(point: Array, function: Function) -> Array:
        return least_squares(point, lambda points: function(parameters.from_unit(points)), SHORT).point

    whole = fitted(parameters.to_unit(theta), rows)
    best, unseen = parameters.from_unit(whole), np.full(size, np.nan)
    here = rows(best[None])[0]
    if not np.isfinite(here).all():
        return Refit(theta)
    several, number = len(problem.logs) > 1, np.append(parts(problem), np.zeros(here.size - size))
    for part in np.unique(number[:size]):
        out = number == part
        if several:  # only the other logs are simulated
            kept = [log for i, log in enumerate(problem.logs) if 1 + i % 3 != part]
            others = least_squares_rows(problem.varied(problem.settings, kept), theta, weight)
        else:
            others = partial(_some, rows, ~out)
        unseen[out[:size]] = rows(parameters.from_unit(fitted(whole, others))[None])[0, out]
    return Refit.of(problem, best, problem.unfiltered(unseen[None]))


def _some(rows: Function, kept: Mask, theta: Array) -> Array:
    return rows(theta)[:, kept]


def parts(problem: Problem) -> Array:
    """Return which part each sample is in, from 1, shape (R,)."""
    number = np.empty(problem.measured.size)
    for c in problem.channels:
        halves = np.arange(len(c.measured)) >= len(c.measured) // 2
        number[c.rows] = 1 + (c.log % 3 if len(problem.logs) > 1 else halves)
    return number
