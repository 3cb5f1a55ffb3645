"""Derivatives of the residuals at one parameter vector, by finite differences as wide as the uncertainty."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydroid.parameters import Array, ParameterSet
from hydroid.posterior.noise import prior_weight
from hydroid.posterior.open_start import with_open_start
from hydroid.posterior.posterior import WEAK_PRIOR, Posterior, regular
from hydroid.problem.priors import Priors
from hydroid.problem.problem import Problem
from hydroid.search.axes import Box, differentiate, single_axes

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
        doubt: relative change of each standard deviation in a second round, (P,); 0 without one.
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


def jacobian(problem: Problem, theta: Array, first: Array | None = None) -> Jacobian:
    """Return the derivatives at theta, shape (P,), from 1 + p simulations, p free, and 2 p or more a round.

    The first differences are by each parameter. Then come rounds of differences, a standard deviation to each
    side along the axes of the covariance that follows. A second round follows where a standard deviation
    changed to four times or a quarter: the first axes were that far off. Below, one changes standard
    deviations by a few per cent.

    Args:
        problem: the problem.
        theta: the parameters.
        first: derivatives to begin with, shape (p, R), such as those of the least squares that ended there.
    """
    problem = with_open_start(problem, theta)
    at, residual = estimate_box(problem.parameters, theta), problem.residuals(theta[None])[0]
    scores = prior_slopes(problem.priors, at)
    weight = prior_weight(problem.channels, residual, problem.settings.objective)
    if first is None:
        single = single_axes(at, 1e-3)
        slopes = differentiate(problem.residuals, at, single.one_sided, residual)
        if not np.isfinite(slopes).all():  # NaN where simulations diverge on both sides
            slopes = differentiate(problem.residuals, at, single, residual)
    else:
        slopes = first.copy()
    diverges = np.logical_not(np.isfinite(slopes).all(axis=1))
    slopes[diverges] = 0.0
    doubt = np.zeros(len(slopes))
    after = white_posterior(at, slopes / weight, scores)
    for further in (False, True):
        before = after.deviations
        slopes = differentiate(problem.residuals, at, after.axes(step=1.0), residual, slopes)
        after = white_posterior(at, slopes / weight, scores)
        # above 100 % it does not matter how large a standard deviation is
        known = np.minimum(before, after.deviations) < 1.0
        change = np.where(known, np.exp(np.abs(np.log(after.deviations / before))) - 1, 0.0)
        doubt = change if further else doubt
        if (change <= 3.0).all():
            break
    effects = np.linalg.norm(slopes, axis=1)
    slopes[effects <= NO_EFFECT_BELOW * effects.max()] = 0.0  # not the rounding that the axes bring
    slopes[diverges] = np.nan

    def spread(values: Array, rest: float) -> Array:
        whole = np.full((len(theta), *values.shape[1:]), rest)
        whole[at.varied] = values
        return whole

    doubts = spread(doubt, 0.0)
    return Jacobian(residual, spread(slopes, np.nan), spread(scores, np.nan), at.scale, doubts, weight)


def estimate_box(parameters: ParameterSet, theta: Array) -> Box:
    """Return theta, (P,), between its bounds, with the scale of relative changes; the free ones vary.

    A relative change of 1 is the value; on a linear scale at least a hundredth of the bounds' width.
    """
    least = np.where(parameters.log, 0.0, 0.01 * (parameters.upper - parameters.lower))
    scale = np.maximum(np.abs(theta), least)
    return Box(theta, parameters.lower, parameters.upper, scale, parameters.free)


def prior_slopes(priors: Priors, at: Box) -> Array:
    """Derivatives of the M priors' scores, shape (p, M), per relative change of each free parameter."""
    if not len(priors):
        return np.zeros((int(at.varied.sum()), 0))
    return differentiate(priors.scores, at, single_axes(at, 1e-4))  # they are smooth


def white_posterior(at: Box, *parts: Array) -> Posterior:
    """Return the posterior of independent measurements, each (p, m): derivatives over their noise."""
    weak = np.eye(int(at.varied.sum())) / WEAK_PRIOR
    return Posterior(at, regular(np.vstack([weak, *(part.T for part in parts)])))
