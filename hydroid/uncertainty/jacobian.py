"""What moves the residuals at one parameter set: derivatives by finite differences whose step is checked."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydroid.parameters import Array, ParameterSet
from hydroid.problem.problem import Problem
from hydroid.uncertainty.noise import statement_unit

STEP = 1e-4
"""relative step of the differences: truncation and the simulation's rounding then leave about 1e-7"""
WIDER = 10.0
"""how much wider the step is that checks it"""
DOUBTFUL = 0.02
"""two steps whose derivatives differ by more than this part disagree; the wider looks over small jumps"""
SMALL = 0.01
"""of a bounds' width: a value below it changes by parts of this instead of its own"""
NO_EFFECT_BELOW = 1e-6
"""a parameter that moves the response less than this times the strongest one's has no effect on it"""


@dataclass(frozen=True, eq=False)
class Jacobian:
    """Derivatives at a parameter set, per relative change of each of its P parameters.

    Attributes:
        residual: weighted output errors there [rad], shape (R,).
        slopes: their derivatives, shape (P, R); NaN of a fixed parameter, and where simulations diverge on
            both sides.
        statements: derivatives of the M statements' scores, shape (P, M).
        scale: what a relative change of 1 is, in the parameter's unit, shape (P,).
        error: by how much two steps' derivatives differ, shape (P, R).
        unit: what a statement's score counts in the refinement, in units of the residual [rad].
    """

    residual: Array
    slopes: Array
    statements: Array
    scale: Array
    error: Array
    unit: float

    @property
    def effects(self) -> Array:
        """Rms change of the residual [rad] per 1 % of each parameter, shape (P,); NaN where unknown."""
        return 0.01 * np.sqrt(np.mean(self.slopes**2, axis=1))

    @property
    def without_effect(self) -> NDArray[np.bool_]:
        """Parameters that the outputs do not feel at all, shape (P,)."""
        return self.effects <= NO_EFFECT_BELOW * np.nanmax(self.effects, initial=0.0)

    @property
    def doubt(self) -> Array:
        """Part by which two steps' derivatives differ, shape (P,); 0 where there is no effect."""
        length, error = np.linalg.norm(self.slopes, axis=1), np.linalg.norm(self.error, axis=1)
        return np.where(self.without_effect, 0.0, error / np.maximum(length, np.finfo(float).tiny))


def jacobian(problem: Problem, theta: Array) -> Jacobian:
    """Return the derivatives at theta, shape (P,), from 1 + 4 p simulations, p parameters being free.

    Differences are central, or one-sided and of second order at a bound. Each is taken with two steps; where
    these disagree the wider counts, and `doubt` says by how much.
    """
    scale, free = relative_scale(problem.parameters, theta), problem.parameters.free
    at = problem.residuals(theta[None])[0]
    fine, wide = (_slopes(problem, theta, at, scale, step) for step in (STEP, WIDER * STEP))
    error = fine - wide
    length = np.linalg.norm(wide, axis=1)
    disagree = ~(np.linalg.norm(error, axis=1) <= DOUBTFUL * length) & np.isfinite(length)
    change = np.diag(STEP * scale)
    scores = problem.priors.scores(np.vstack([theta + change, theta - change]))
    statements = (scores[: len(theta)] - scores[len(theta) :]) / (2 * STEP)
    slopes, errors = np.full((2, len(theta), at.size), np.nan)
    slopes[free], errors[free] = np.where(disagree[:, None], wide, fine), error
    unit = statement_unit(problem.channels, at, problem.settings.objective)
    return Jacobian(at, slopes, statements, scale, errors, unit)


def relative_scale(parameters: ParameterSet, theta: Array) -> Array:
    """Return what a relative change of 1 is, shape (P,): the value, or SMALL of its bounds' width if more."""
    return np.maximum(np.abs(theta), SMALL * (parameters.upper - parameters.lower))


def _slopes(problem: Problem, theta: Array, at: Array, scale: Array, step: float) -> Array:
    """Derivatives from the parabola through each free parameter's value and two others, shape (p, R)."""
    first, second = _sides(problem.parameters, theta, scale, step)
    free, count = problem.parameters.free, int(problem.parameters.free.sum())
    changed = np.vstack([np.diag(first * scale)[free], np.diag(second * scale)[free]])
    rows = problem.residuals(theta + changed)
    first, second = first[free, None], second[free, None]
    near, far = (rows[:count] - at) / first, (rows[count:] - at) / second
    both = (near * second - far * first) / (second - first)
    alone = np.where(np.isfinite(near), near, far)  # where one side diverges
    return np.where(np.isfinite(both), both, alone)


def _sides(parameters: ParameterSet, theta: Array, scale: Array, step: float) -> tuple[Array, Array]:
    """Two relative changes of each parameter, on both sides, or on one where a bound is near."""
    low, high = np.minimum(parameters.lower, theta), np.maximum(parameters.upper, theta)
    above, below = theta + step * scale > high, theta - step * scale < low
    first = np.where(above, -step, step)
    second = np.where(above, -2 * step, np.where(below, 2 * step, -step))
    return first, second
