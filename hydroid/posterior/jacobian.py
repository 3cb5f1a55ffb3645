"""Derivatives of the residuals at one parameter vector, by finite differences as wide as the uncertainty."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydroid.parameters import Array, ParameterSet
from hydroid.posterior.axes import Axes, changed, covariance_axes, deviations, room, single_axes
from hydroid.posterior.noise import prior_weight
from hydroid.posterior.open_start import with_open_start
from hydroid.problem.priors import Priors
from hydroid.problem.problem import Problem

STEP = 1e-3
"""relative step of the first differences, by each parameter"""
SHORTER = 0.1
"""second step along each axis, as a part of the first"""
CURVED = 0.3
"""part of the first step's effect; where the second's is smaller, the first one's is mostly curvature"""
ROUNDS = 2
"""times at most that the axes of the covariance are found and followed"""
AGREE = 0.1
"""relative change of every standard deviation, below which another round would change nothing"""
UNKNOWN = 1.0
"""relative standard deviation above which it does not matter how large it is"""
UNFELT = 1e3
"""relative standard deviation of a direction that the residuals do not depend on: the rest is rounding"""
MIN_SCALE = 0.01
"""part of the bounds' width: a smaller value is changed by parts of this instead of its own"""
NO_EFFECT_BELOW = 1e-6
"""a parameter whose effect is below this part of the strongest one's has none"""
FINE_STEP = 1e-4
"""relative step of what is smooth: the priors, and a design's responses"""

Residuals = Callable[[Array], Array]
"""relative changes of the free parameters, (n, p) -> (n, R)"""


@dataclass(frozen=True, eq=False)
class Jacobian:
    """Derivatives at a parameter vector, per relative change of each of its P parameters.

    Attributes:
        residual: weighted output errors there [rad], shape (R,).
        slopes: their derivatives, shape (P, R); NaN of a fixed parameter, and where simulations diverge on
            both sides.
        prior_slopes: derivatives of the M priors' scores, shape (P, M).
        scale: what a relative change of 1 is, in the parameter's unit, shape (P,).
        doubt: relative change of each standard deviation in the last round, shape (P,).
        prior_weight: weight of a score of 1 beside the residuals [rad] (`noise.prior_weight`).
    """

    residual: Array
    slopes: Array
    prior_slopes: Array
    scale: Array
    doubt: Array
    prior_weight: float

    @property
    def effects(self) -> Array:
        """Rms change of the residual [rad] per 1 % of each parameter, shape (P,); NaN where unknown."""
        return 0.01 * np.sqrt(np.mean(self.slopes**2, axis=1))

    @property
    def without_effect(self) -> NDArray[np.bool_]:
        """Parameters that the outputs do not depend on, shape (P,)."""
        return self.effects <= NO_EFFECT_BELOW * np.nanmax(self.effects, initial=0.0)


def jacobian(problem: Problem, theta: Array) -> Jacobian:
    """Return the derivatives at theta, shape (P,), from 1 + 2 p simulations, p free, and 4 p a round.

    The first differences are by each parameter. Then come rounds of differences along the axes of the
    covariance that follows: a standard deviation and a tenth of it to each side. The long step counts, which
    events disturb less, unless its effect is mostly curvature. A further round follows where a standard
    deviation changed.
    """
    problem = with_open_start(problem, theta)
    parameters, free = problem.parameters, problem.parameters.free
    scale, residual = relative_scale(parameters, theta), problem.residuals(theta[None])[0]
    within = room(parameters, theta, scale)

    def moved(relative: Array) -> Array:
        changes = np.zeros((len(relative), len(theta)))
        changes[:, free] = relative * scale[free]
        return problem.residuals(changed(parameters, theta, changes))

    prior_slopes = score_slopes(problem.priors, theta, scale)
    weight = prior_weight(problem.channels, residual, problem.settings.objective)
    slopes = single_axes(STEP, within).slopes(moved, residual)
    diverges = np.logical_not(np.isfinite(slopes).all(axis=1))
    slopes[diverges] = 0.0
    root, doubt = _root(slopes, prior_slopes[free], weight), np.zeros(len(slopes))
    for _ in range(ROUNDS):
        before, axes = deviations(root), covariance_axes(root, within, step=1.0)
        slopes = _felt(axes.by_parameter(_along(axes, moved, residual, axes.directions @ slopes)), weight)
        root = _root(slopes, prior_slopes[free], weight)
        after = deviations(root)
        known = np.minimum(before, after) < UNKNOWN
        doubt[known] = np.abs(after[known] / before[known] - 1)
        if (doubt <= AGREE).all():
            break
    effects = np.linalg.norm(slopes, axis=1)
    slopes[effects <= NO_EFFECT_BELOW * effects.max()] = 0.0  # not the rounding that the axes bring
    found, doubts = np.full((len(theta), residual.size), np.nan), np.zeros(len(theta))
    found[free], doubts[free] = slopes, doubt
    found[np.flatnonzero(free)[diverges]] = np.nan
    return Jacobian(residual, found, prior_slopes, scale, doubts, weight)


def score_slopes(priors: Priors, theta: Array, scale: Array) -> Array:
    """Derivatives of the M priors' scores at theta, shape (P, M), per relative change of each parameter."""
    change = np.diag(FINE_STEP * scale)
    scores = priors.scores(np.vstack([theta + change, theta - change]))
    return (scores[: len(theta)] - scores[len(theta) :]) / (2 * FINE_STEP)


def relative_scale(parameters: ParameterSet, theta: Array) -> Array:
    """Return what a relative change of 1 is, shape (P,).

    It is the value; on a linear scale at least MIN_SCALE of the bounds' width.
    """
    least = np.where(parameters.log, 0.0, MIN_SCALE * (parameters.upper - parameters.lower))
    return np.maximum(np.abs(theta), least)


def _along(axes: Axes, moved: Residuals, residual: Array, former: Array) -> Array:
    """Derivatives along axes, (p, R); `former`, (p, R), where simulations diverge on both sides."""
    found = [one.slopes(moved, residual) for one in (axes, axes.shortened(SHORTER))]
    long, short = (np.where(np.isfinite(one).all(axis=1, keepdims=True), one, former) for one in found)
    curved = np.linalg.norm(short, axis=1) < CURVED * np.linalg.norm(long, axis=1)
    return np.where(curved[:, None], short, long)


def _felt(slopes: Array, weight: float) -> Array:
    """Return derivatives, (p, R), that are exactly 0 along directions without effect."""
    directions, values, effects = np.linalg.svd(slopes, full_matrices=False)
    felt = values * UNFELT > weight
    return (directions[:, felt] * values[felt]) @ effects[felt]


def _root(slopes: Array, prior_slopes: Array, weight: float) -> Array:
    """Return G of C^-1 = G' G, shape (p, p), for white noise of a level that the prior's weight implies."""
    rows = np.hstack([slopes / weight, prior_slopes])
    directions, values, _ = np.linalg.svd(rows, full_matrices=False)
    return values[:, None] * directions.T
