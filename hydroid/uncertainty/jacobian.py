"""Derivatives of the residuals at one parameter vector, by finite differences whose step is checked."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydroid.parameters import Array, ParameterSet
from hydroid.problem.problem import Problem
from hydroid.uncertainty.noise import prior_weight
from hydroid.uncertainty.open_start import with_open_start

STEP = 1e-4
"""relative step of the differences: truncation and the simulation's rounding then leave about 1e-7"""
WIDER_STEPS = (1e-3, 1e-2, 3e-2)
"""steps that check the one before, as far as needed; the response is not smooth where oil cavitates: such
jumps, of about 1e-5 rad, change a wide step's derivative less"""
STEPS_DISAGREE_ABOVE = 0.02
"""relative difference of two steps' derivatives above which a wider one is tried"""
MIN_SCALE = 0.01
"""part of the bounds' width: a smaller value is changed by parts of this instead of its own"""
NO_EFFECT_BELOW = 1e-6
"""a parameter whose effect is below this part of the strongest one's has none"""


@dataclass(frozen=True, eq=False)
class Jacobian:
    """Derivatives at a parameter vector, per relative change of each of its P parameters.

    Attributes:
        residual: weighted output errors there [rad], shape (R,).
        slopes: their derivatives, shape (P, R); NaN of a fixed parameter, and where simulations diverge on
            both sides.
        prior_slopes: derivatives of the M priors' scores, shape (P, M).
        scale: what a relative change of 1 is, in the parameter's unit, shape (P,).
        error: difference between two steps' derivatives, shape (P, R).
        prior_weight: weight of a score of 1 beside the residuals [rad] (`noise.prior_weight`).
    """

    residual: Array
    slopes: Array
    prior_slopes: Array
    scale: Array
    error: Array
    prior_weight: float

    @property
    def effects(self) -> Array:
        """Rms change of the residual [rad] per 1 % of each parameter, shape (P,); NaN where unknown."""
        return 0.01 * np.sqrt(np.mean(self.slopes**2, axis=1))

    @property
    def without_effect(self) -> NDArray[np.bool_]:
        """Parameters that the outputs do not depend on, shape (P,)."""
        return self.effects <= NO_EFFECT_BELOW * np.nanmax(self.effects, initial=0.0)

    @property
    def doubt(self) -> Array:
        """Relative difference between two steps' derivatives, shape (P,); 0 where there is no effect."""
        length, error = np.linalg.norm(self.slopes, axis=1), np.linalg.norm(self.error, axis=1)
        return np.where(self.without_effect, 0.0, error / np.maximum(length, np.finfo(float).tiny))


def jacobian(problem: Problem, theta: Array) -> Jacobian:
    """Return the derivatives at theta, shape (P,), from 1 + 4 p simulations, p parameters being free.

    Differences are central, or one-sided and of second order at a bound. Each is taken with two steps. Where
    these disagree, wider ones follow, two simulations each, until two in a row agree; then the wider one of
    those that agree best counts, and `doubt` is their difference.
    """
    problem = with_open_start(problem, theta)
    scale, left = relative_scale(problem.parameters, theta), problem.parameters.free
    residual = problem.residuals(theta[None])[0]

    def derivatives(step: float) -> Array:
        found = slopes_of(problem.residuals, problem.parameters, theta, residual, (step * scale, left))
        return found * scale[:, None]

    slopes = derivatives(STEP)
    effect = np.linalg.norm(slopes, axis=1)
    felt = ~(effect <= NO_EFFECT_BELOW * np.nanmax(effect, initial=0.0))
    errors, finer, least = np.full_like(slopes, np.nan), slopes.copy(), np.full(len(theta), np.inf)
    for step in WIDER_STEPS:
        wider = derivatives(step)
        error, length = finer - wider, np.linalg.norm(wider, axis=1)
        disagreement = np.linalg.norm(error, axis=1) / np.maximum(length, np.finfo(float).tiny)
        agree, closer = disagreement <= STEPS_DISAGREE_ABOVE, disagreement < least
        taken = closer & ~(agree & (step == WIDER_STEPS[0]))
        slopes[taken] = wider[taken]
        errors[closer], least[closer] = error[closer], disagreement[closer]
        left, finer = left & ~agree & felt & np.isfinite(length), wider
        if not left.any():
            break
    change = np.diag(STEP * scale)
    scores = problem.priors.scores(np.vstack([theta + change, theta - change]))
    prior_slopes = (scores[: len(theta)] - scores[len(theta) :]) / (2 * STEP)
    weight = prior_weight(problem.channels, residual, problem.settings.objective)
    return Jacobian(residual, slopes, prior_slopes, scale, errors, weight)


def relative_scale(parameters: ParameterSet, theta: Array) -> Array:
    """Return what a relative change of 1 is, shape (P,).

    It is the value; on a linear scale at least MIN_SCALE of the bounds' width.
    """
    least = np.where(parameters.log, 0.0, MIN_SCALE * (parameters.upper - parameters.lower))
    return np.maximum(np.abs(theta), least)


def slopes_of(
    function: Callable[[Array], Array],
    parameters: ParameterSet,
    theta: Array,
    value: Array,
    steps: tuple[Array, NDArray[np.bool_]],
) -> Array:
    """Derivatives of a function, (n, P) -> (n, R), at theta, (P,), shape (P, R).

    `steps` are a step by each parameter, (P,), and which parameters are changed, (P,): those of the others
    are NaN. A derivative is that of the parabola through `value`, the function there, and two other points.
    The two lie on both sides, a step away, or both on one side where a bound is near.
    """
    step, which = steps
    above = theta + step > np.maximum(parameters.upper, theta)
    below = theta - step < np.minimum(parameters.lower, theta)
    first = np.where(above, -step, step)
    second = np.where(above, -2 * step, np.where(below, 2 * step, -step))
    rows = function(theta + np.vstack([np.diag(first)[which], np.diag(second)[which]]))
    first, second = first[which, None], second[which, None]
    near, far = (rows[: len(first)] - value) / first, (rows[len(first) :] - value) / second
    both = (near * second - far * first) / (second - first)
    one_side = np.where(np.isfinite(near), near, far)  # where the other one diverges
    slopes = np.full((len(theta), value.size), np.nan)
    slopes[which] = np.where(np.isfinite(both), both, one_side)
    return slopes
