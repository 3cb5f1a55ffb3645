"""Least squares linearised at an estimate, by finite differences as wide as the uncertainty."""

from dataclasses import dataclass, replace
from functools import cached_property

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
class Linear:
    """Derivatives at an estimate by relative changes of the p parameters that vary, of P.

    Residuals, the M priors' scores and the weak priors of the p parameters stand in one row; its derivatives
    are J = V D U.

    Attributes:
        box: the estimate, its bounds, what a relative change of 1 is, and which parameters vary.
        residual: weighted output errors [rad], shape (R,).
        slopes: their derivatives, shape (p, R); 0 without effect, and where they diverge.
        prior_slopes: derivatives of the priors' scores, shape (p, M).
        prior_weight: weight of a score of 1 beside the residuals [rad] (`noise.prior_weight`).
        diverging: parameters whose simulations diverge on both sides, shape (p,).
    """

    box: Box
    residual: Array
    slopes: Array
    prior_slopes: Array
    prior_weight: float
    diverging: NDArray[np.bool_]

    @property
    def idle(self) -> NDArray[np.bool_]:
        """Parameters that the residuals do not depend on, shape (p,)."""
        return ~self.slopes.any(axis=1) & ~self.diverging

    @property
    def sensitivity(self) -> Array:
        """Rms change of the residual [rad] per 1 % of each parameter, shape (P,); NaN where unknown."""
        rms = 0.01 * np.sqrt(np.mean(self.slopes**2, axis=1))
        return self.spread(np.where(self.diverging, np.nan, rms))

    @cached_property
    def white(self) -> Posterior:
        """What is known if the noise is white, with as many samples as the noise's effective ones."""
        return white_posterior(self.box, self.slopes / self.prior_weight, self.prior_slopes)

    @cached_property
    def _parts(self) -> tuple[Array, Array]:
        weight, weak = self.prior_weight, np.eye(len(self.slopes)) / WEAK_PRIOR
        rows = np.hstack([self.slopes, weight * self.prior_slopes, weight * weak])
        directions, values, effects = np.linalg.svd(rows, full_matrices=False)
        return directions / values, effects

    @property
    def changes(self) -> Array:
        """Relative change of each parameter per unit of each effect, V D^-1, shape (p, p)."""
        return self._parts[0]

    @property
    def effects(self) -> Array:
        """Orthonormal rows U, shape (p, R + M + p)."""
        return self._parts[1]

    @cached_property
    def prior_scatter(self) -> Array:
        """What the priors' uncertainty scatters in each effect, shape (p, p)."""
        priors = self.prior_weight * self.effects[:, self.residual.size :]
        return priors @ priors.T

    def of(self, kept: NDArray[np.bool_]) -> "Linear":
        """Return it with only some of the p parameters varying, shape (p,)."""
        varied = self.box.varied.copy()
        varied[varied] = kept
        box, diverging = replace(self.box, varied=varied), self.diverging[kept]
        return replace(
            self, box=box, slopes=self.slopes[kept], prior_slopes=self.prior_slopes[kept], diverging=diverging
        )

    def spread(self, values: Array, others: float = np.nan) -> Array:
        """Return values of the parameters that vary, shape (p,), for all of them, shape (P,)."""
        whole = np.full(self.box.at.size, others)
        whole[self.box.varied] = values
        return whole


def linearised(problem: Problem, theta: Array, first: Array | None = None) -> Linear:
    """Return the derivatives at theta, shape (P,), by its p free parameters.

    The first differences are by each parameter, p simulations. Then come differences of a standard deviation
    to each side along the axes of the covariance that follows, 2 p or more. They are taken once more where a
    standard deviation changed to four times or a quarter: the first axes were that far off.

    Args:
        problem: the problem.
        theta: the parameters.
        first: derivatives to begin with, shape (p, R), such as those of the least squares that ended there.
    """
    problem = with_open_start(problem, theta)
    box, residual = estimate_box(problem.parameters, theta), problem.residuals(theta[None])[0]
    weight = prior_weight(problem.channels, residual, problem.settings.objective)
    if first is None:
        single = single_axes(box, 1e-3)
        slopes = differentiate(problem.residuals, box, single.one_sided, residual)
        if not np.isfinite(slopes).all():  # NaN where simulations diverge on both sides
            slopes = differentiate(problem.residuals, box, single, residual)
    else:
        slopes = first.copy()
    diverging = np.logical_not(np.isfinite(slopes).all(axis=1))
    slopes[diverging] = 0.0
    now = Linear(box, residual, slopes, prior_slopes(problem.priors, box), weight, diverging)
    for _ in range(2):
        white = now.white
        slopes = differentiate(problem.residuals, box, white.axes(step=1.0), residual, now.slopes)
        now = replace(now, slopes=slopes)
        before, after = white.deviations, now.white.deviations
        # above 100 % it does not matter how large a standard deviation is
        change = np.abs(np.log(after / before))[np.minimum(before, after) < 1.0]
        if (change <= np.log(4.0)).all():
            break
    effects = np.linalg.norm(now.slopes, axis=1)
    # not the rounding that the axes bring
    now.slopes[diverging | (effects <= NO_EFFECT_BELOW * effects.max())] = 0.0
    return now


def estimate_box(parameters: ParameterSet, theta: Array) -> Box:
    """Return theta, (P,), between its bounds, with the scale of relative changes; the free ones vary.

    A relative change of 1 is the value; on a linear scale at least a hundredth of the bounds' width.
    """
    least = np.where(parameters.log, 0.0, 0.01 * (parameters.upper - parameters.lower))
    scale = np.maximum(np.abs(theta), least)
    return Box(theta, parameters.lower, parameters.upper, scale, parameters.free)


def prior_slopes(priors: Priors, box: Box) -> Array:
    """Derivatives of the M priors' scores, shape (p, M), per relative change of each free parameter."""
    if not len(priors):
        return np.zeros((int(box.varied.sum()), 0))
    return differentiate(priors.scores, box, single_axes(box, 1e-4))  # they are smooth


def white_posterior(box: Box, *parts: Array) -> Posterior:
    """Return the posterior of independent measurements, each (p, m): derivatives over their noise."""
    weak = np.eye(int(box.varied.sum())) / WEAK_PRIOR
    return Posterior(box, regular(np.vstack([weak, *(part.T for part in parts)])))
