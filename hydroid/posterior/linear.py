"""Least squares linearised at an estimate, by finite differences as wide as the
uncertainty."""

from dataclasses import replace
from functools import cached_property

import numpy as np

from hydroid.arrays import Array, Mask, record
from hydroid.errors import SettingsError
from hydroid.parameters import ParameterSet
from hydroid.posterior.error_model import Likelihood
from hydroid.posterior.posterior import WEAK_PRIOR, Posterior, regular
from hydroid.problem.priors import Priors
from hydroid.search.axes import Box, differentiate, single_axes

NO_EFFECT_BELOW = 1e-6
"""a parameter whose effect is below this part of the strongest one's has none"""


@record
class Linear:
    """Derivatives at an estimate by relative changes of the p parameters that vary, of
    P.

    Innovations, the M priors' scores and the weak priors of the p parameters stand in
    one row; its derivatives are J = V D U. All have a variance of 1.

    Attributes:
        box: the estimate, its bounds, what a relative change of 1 is, and which
            parameters vary.
        innovations: shape (R,).
        slopes: their derivatives, shape (p, R); 0 without effect, and where they
            diverge.
        prior_slopes: derivatives of the priors' scores, shape (p, M).
        diverging: parameters whose simulations diverge on both sides, shape (p,).
    """

    box: Box
    innovations: Array
    slopes: Array
    prior_slopes: Array
    diverging: Mask

    @cached_property
    def white(self) -> Posterior:
        """What is known if the errors are as the likelihood has them."""
        return white_posterior(self.box, self.slopes, self.prior_slopes)

    @cached_property
    def _svd(self) -> tuple[Array, Array, Array]:
        weak = np.eye(len(self.slopes)) / WEAK_PRIOR
        rows = np.hstack([self.slopes, self.prior_slopes, weak])
        return np.linalg.svd(rows, full_matrices=False)

    @property
    def changes(self) -> Array:
        """Relative change of each parameter per unit of each effect, V D^-1, shape (p,
        p)."""
        axes, sizes, _ = self._svd
        return axes / sizes

    @property
    def effects(self) -> Array:
        """Orthonormal rows U, shape (p, R + M + p)."""
        return self._svd[2]

    @cached_property
    def prior_scatter(self) -> Array:
        """What the priors' uncertainty scatters in each effect, shape (p, p)."""
        priors = self.effects[:, self.innovations.size :]
        return priors @ priors.T

    def restricted(self, kept: Mask) -> "Linear":
        """Return it with only some of the p parameters varying, shape (p,)."""
        return Linear(
            box=self.box.restricted(kept),
            innovations=self.innovations,
            slopes=self.slopes[kept],
            prior_slopes=self.prior_slopes[kept],
            diverging=self.diverging[kept],
        )

    def spread(self, values: Array) -> Array:
        """Return values of the parameters that vary, shape (p,), among all, shape (P,);
        NaN elsewhere."""
        whole = np.full(self.box.at.size, np.nan)
        whole[self.box.varied] = values
        return whole


def linearised(
    likelihood: Likelihood, theta: Array, first: Array | None = None
) -> Linear:
    """Return the derivatives at theta, shape (P,), by its p free parameters.

    The first differences are by each parameter, p simulations. Then come differences of
    a standard deviation to each side along the axes of the covariance that follows, 2 p
    or more. The axes are of one joint's parameters alone where there are such: then
    what the other joints' valves open is known from the other differences. They are
    taken once more where a standard deviation changed to four times
    or a quarter: the first axes were that far off. `first` are derivatives to begin
    with, shape (p, R), such as those of the least squares that ended there.
    """
    problem = likelihood.problem
    box = estimate_box(problem.parameters, theta)
    here = likelihood.innovations(theta[None])[0]
    if first is None:
        single = single_axes(box, 1e-3)
        slopes = differentiate(likelihood.innovations, box, single.one_sided, here)
        if not np.isfinite(slopes).all():  # NaN where simulations diverge on both sides
            slopes = differentiate(likelihood.innovations, box, single, here)
    else:
        slopes = first.copy()
    diverging = np.logical_not(np.isfinite(slopes).all(axis=1))
    slopes[diverging] = 0.0
    now = Linear(box, here, slopes, prior_slopes(problem.priors, box), diverging)
    owner = problem.bindings.owners()[box.varied]
    for _ in range(2):
        white = now.white
        slopes = differentiate(
            likelihood.innovations, box, white.axes(1.0, owner), here, now.slopes
        )
        now = replace(now, slopes=slopes)
        before = white.deviations
        after = now.white.deviations
        # above 100 % it does not matter how large a standard deviation is
        matters = np.minimum(before, after) < 1.0
        change = np.abs(np.log(after / before))[matters]
        if (change <= np.log(4.0)).all():
            break
    effects = np.linalg.norm(now.slopes, axis=1)
    # not the rounding that the axes bring
    idle = effects <= NO_EFFECT_BELOW * effects.max()
    now.slopes[diverging | idle] = 0.0
    return now


def estimate_box(parameters: ParameterSet, theta: Array) -> Box:
    """Return theta, (P,), between its bounds, with the scale of relative changes; the
    free ones vary.

    A relative change of 1 is the value; on a linear scale at least a hundredth of the
    bounds' width, of an effect of a group its prior's standard deviation. Raises
    SettingsError: a free parameter on a log scale is 0.
    """
    width = parameters.upper - parameters.lower
    least = np.where(parameters.log, 0.0, 0.01 * width)
    of_groups = [p.least for p in parameters.parameters]
    scale = np.maximum(np.abs(theta), least)
    scale = np.maximum(scale, of_groups)
    for name in parameters.named(parameters.free & (scale == 0)):
        raise SettingsError(
            f"parameter {name} is 0",
            hint="it is on a log scale: state a value above 0, or fix it",
        )
    return Box(theta, parameters.lower, parameters.upper, scale, parameters.free)


def prior_slopes(priors: Priors, box: Box) -> Array:
    """Derivatives of the M priors' scores, shape (p, M), per relative change of each
    free parameter."""
    # they are smooth, and cost no simulation: single coordinates will do
    axes = single_axes(box, 1e-4)
    return differentiate(priors.weighed_at(box.at), box, axes)


def white_posterior(box: Box, *parts: Array) -> Posterior:
    """Return the posterior of independent measurements, each (p, m): derivatives over
    their noise."""
    # what nothing measures keeps a large standard deviation, and not an infinite one
    weak = np.eye(box.varied.sum()) / WEAK_PRIOR
    rows = [weak, *(part.T for part in parts)]
    return Posterior(box, regular(np.vstack(rows)))
