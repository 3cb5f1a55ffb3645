"""Uncertainty of an estimate: its covariance, and the intervals and flags that follow from it.

The estimate minimises the weighted sum of squares of the residuals and of the priors' scores. The noise need
not be white, and the weights need not match it. Let J, shape (p, R), be the derivatives of all these
residuals per relative change of the free parameters, and S the covariance of the noise. The covariance of the
estimate is then the *sandwich*

    C = (J J')^-1 J S J' (J J')^-1        (P. J. Huber, 1967; G. A. F. Seber and C. J. Wild, 1989)

For white noise of one level this is the usual s² (J J')^-1. It is computed from one singular value
decomposition J = V D U as C^-1 = G' G with G = L^-1 D V', L L' = U S U'. No product J J' is formed. The weak
prior on every parameter (`WEAK_PRIOR`), one more residual each, makes J regular.

The process that describes the noise is estimated too. The variance of a parameter is then uncertain, and its
interval must be wider than one with a known variance. The logarithm of the estimated variance is about
normal: `quantile`. (Student's t, for a variance that follows a χ², is far too wide where the noise is slow:
its quantile grows without limit, while a variance from a spectrum errs to both sides.)

The covariance is a local, first-order approximation. It assumes that the model is right: a wrong model shifts
the estimate by more than an interval says. A parameter within a tenth of a standard deviation of a bound is
held there, and has no interval; but one that the logs do not determine says nothing by lying there, and stays
free.
"""

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import Literal

import numpy as np
from numpy.polynomial.hermite_e import hermegauss
from scipy.linalg import solve_triangular
from scipy.optimize import brentq
from scipy.stats import norm as normal

from hydroid.arrays import Array, record, rms
from hydroid.parameters import ParameterSet
from hydroid.posterior.linear import Linear, linearised, white_posterior
from hydroid.posterior.noise import STEP, Noise, neighbours, problem_noise, transformed, unbiased
from hydroid.posterior.posterior import (
    COVERAGE,
    NORMAL,
    UNIDENTIFIABLE_ABOVE,
    WEAK_PRIOR,
    Posterior,
    interval,
    regular,
)
from hydroid.problem.problem import Problem
from hydroid.search.axes import Box, held_by_bound

WEAK_ABOVE = 0.3  # relative standard deviation above which a parameter or direction is weakly identifiable


class Flag(StrEnum):
    """How well the logs determine a parameter, whatever a prior adds."""

    IDENTIFIABLE = "identifiable"
    WEAK = "weakly identifiable"
    UNIDENTIFIABLE = "not identifiable"
    NO_EFFECT = "no effect"
    FIXED = "fixed"


class Source(StrEnum):
    """Where what is known of a parameter comes from."""

    DATA = "data"
    BOTH = "data and prior"
    PRIOR = "prior only"


@record
class ParameterStatus:
    """How well one parameter is known.

    Attributes:
        flag: what the logs alone determine.
        at_bound: the bound that it lies at.
        share: part of the information that the logs gave: 1 - posterior / prior variance.
        known: whether logs and priors together determine it.
    """

    flag: Flag
    at_bound: Literal["lower", "upper"] | None = None
    share: float = 1.0
    known: bool = True

    @property
    def source(self) -> Source | None:
        """Where the information comes from; None where there is none, or the parameter is fixed."""
        if self.flag is Flag.FIXED or not self.known:
            return None
        # nine tenths of the information are the only source that is named
        return Source.DATA if self.share > 0.9 else Source.BOTH if self.share >= 0.1 else Source.PRIOR


def flag_of(relative_sd: float, share: float = 1.0) -> Flag:
    """Return the flag of a relative standard deviation, of which the logs gave a share of the information.

    The logs alone leave a variance of the posterior's divided by their share. NaN counts as infinite.
    """
    alone = relative_sd / math.sqrt(share) if share > 0 else math.inf
    if not alone <= UNIDENTIFIABLE_ABOVE:
        return Flag.UNIDENTIFIABLE
    return Flag.WEAK if alone > WEAK_ABOVE else Flag.IDENTIFIABLE


@record
class Uncertainty:
    """How precisely the data determine P parameters, p of them free, at an estimate.

    Attributes:
        linear: least squares linearised there, in the parameters that vary: free ones, but for those held at
            a bound.
        noise: of each channel.
        scatters: covariance of the effects by each channel's noise, shape (C, p, p).
        sensitivity: rms change of the output error [rad] per 1 % of each parameter, shape (P,); NaN where
            fixed or where simulations diverge.
        posterior: what is known of the parameters that vary.
        relative: relative standard deviation of each parameter, shape (P,); inf where it is not
            identifiable, NaN where it is fixed or held.
        interval: of 95 %, shape (P, 2); infinite where not identifiable, NaN where fixed or at a bound.
        status: of each parameter.
    """

    linear: Linear
    noise: Sequence[Noise]
    scatters: Array
    sensitivity: Array
    posterior: Posterior
    relative: Array
    interval: Array
    status: tuple[ParameterStatus, ...]

    @property
    def theta(self) -> Array:
        """The estimate, shape (P,)."""
        return self.linear.box.at

    @property
    def standard_deviation(self) -> Array:
        """Of each parameter, in its unit, shape (P,)."""
        return self.relative * self.linear.box.scale


def uncertainty(problem: Problem, theta: Array, first: Array | None = None) -> Uncertainty:
    """Return the uncertainty of theta, shape (P,), for the noise that its residuals show (`linearised`)."""
    return uncertainty_from(problem, linearised(problem, theta, first))


def uncertainty_from(problem: Problem, whole: Linear, noise: Sequence[Noise] = ()) -> Uncertainty:
    """Return the uncertainty from derivatives by all free parameters, without simulations.

    Without `noise` of each channel it is that which the residual shows.
    """
    free, room, white = whole.box.varied, whole.box.room, whole.white.deviations
    effects = 0.01 * rms(problem.unfiltered(whole.slopes), axis=1)
    sensitivity = whole.spread(np.where(whole.diverging, np.nan, effects))
    edge = held_by_bound(room, white)
    held = edge & (white <= UNIDENTIFIABLE_ABOVE)
    linear = whole.of(~held | held.all())
    if not noise:  # that before the fit absorbed a part of it
        shown = problem_noise(problem, linear.residual)
        spread = linear.prior_scatter + linear.scatters(problem.channels, shown).sum(axis=0)
        pairs = zip(problem.channels, shown, strict=True)
        noise = [unbiased(one, linear.effects[:, channel.rows], spread) for channel, one in pairs]
    scatters = linear.scatters(problem.channels, noise)
    size = np.linalg.norm(linear.changes, axis=0)  # D V' is (V D^-1)^-1
    half = np.linalg.cholesky(scatters.sum(axis=0) + linear.prior_scatter)
    root = regular(solve_triangular(half, (linear.changes / size**2).T, lower=True))
    deviations = Posterior(linear.box, root).deviations
    widths = _widths(problem, linear, noise, deviations**2)
    # a quantity may depend on the parameter whose noise is least known
    posterior = Posterior(linear.box, root, quantile=float(widths.max()))
    relative, widths = linear.spread(deviations), linear.spread(widths)
    # held ones are flagged as if the noise were white
    known = np.where(np.isnan(relative), whole.spread(white), relative)
    prior = whole.spread(white_posterior(whole.box, whole.prior_slopes).deviations)
    shares = np.where(free, np.clip(1 - (known / prior) ** 2, 0.0, 1.0), 1.0)
    shares[sensitivity == 0] = 0.0  # not the rounding of their factorisation
    # where the noise is not well known the intervals are wider, and the flags are set accordingly;
    # a stated prior limits a parameter to half of what the weak one leaves, or less
    widened = known * np.where(np.isnan(widths), NORMAL, widths) / NORMAL
    unknown = (widened > UNIDENTIFIABLE_ABOVE) & ~(prior < 0.5 * WEAK_PRIOR)
    relative[unknown] = np.inf
    status = [ParameterStatus(Flag.FIXED)] * len(free)
    for i, at_edge, (down, up) in zip(np.flatnonzero(free).tolist(), edge, room.T, strict=True):
        flag = Flag.NO_EFFECT if sensitivity[i] == 0 else flag_of(widened[i], shares[i])
        side = ("lower" if down <= up else "upper") if at_edge else None
        status[i] = ParameterStatus(flag, side, float(shares[i]), not unknown[i])
    between = ends(problem.parameters, linear.box, widths * relative)
    return Uncertainty(linear, noise, scatters, sensitivity, posterior, relative, between, tuple(status))


def ends(parameters: ParameterSet, box: Box, half: Array) -> Array:
    """Return intervals, shape (P, 2), from half their widths in relative changes, shape (P,).

    Those on a log scale are multiplicative. No end is below 0 where the parameter cannot be.
    """
    between = interval(box.at, half * box.scale, parameters.log)
    low = between[:, 0]
    low[(low < 0) & np.isfinite(low) & (parameters.lower >= 0)] = 0.0
    return between


def quantile(spread: float) -> float:
    """Half the interval of a normal estimate whose variance is estimated, in standard deviations.

    `spread` is the standard deviation of the logarithm of the estimated variance: 0 gives 1.96.
    """
    nodes, weights = hermegauss(60)

    def outside(half: float) -> float:
        chance = weights @ (2 * normal.sf(half * np.exp(spread * nodes / 2))) / weights.sum()
        return chance - (1 - COVERAGE)

    return brentq(outside, 1.0, 3.0 * np.exp(3 * spread))  # pyright: ignore


def _widths(problem: Problem, linear: Linear, noise: Sequence[Noise], variance: Array) -> Array:
    """Half the interval of each parameter in standard deviations, shape (p,), from their variances, (p,)."""
    square = np.zeros_like(variance)
    for channel, process in zip(problem.channels, noise, strict=True):
        waves, power = linear.changes @ transformed(linear.effects[:, channel.rows]), process.power
        for other in neighbours(process):
            square += (waves**2 @ (other.power - power) / STEP) ** 2
    # where the logarithm of a variance is known to 5 or worse, nothing is, and no interval is of use
    return np.array([quantile(spread) for spread in np.minimum(np.sqrt(square) / variance, 5.0)])
