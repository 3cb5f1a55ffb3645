"""Uncertainty of an estimate: its covariance, and the intervals and flags that follow
from it.

The estimate minimises the sum of squares of innovations and of the priors' scores, all
of variance 1. Let J, shape (p, R), be their derivatives per relative change of the free
parameters, and S their covariance. The covariance of the estimate is

    C = (J J')^-1 J S J' (J J')^-1        (G. A. F. Seber and C. J. Wild, *Nonlinear Regression*, 1989),

which is (J J')^-1 where S = 1: where least squares weighs the errors as they are. That
of stage 1 does not: it minimises output errors, and S is what their drift makes of it.
C is computed from one singular value decomposition J = V D U as C^-1 = G' G with G =
L^-1 D V', L L' = U S U'. No product J J' is formed. The weak prior on every parameter
(`WEAK_PRIOR`), one more row each, makes J regular.

Intervals are those of Student's t, as S comes from errors too (`freedom`).

The covariance is a local, first-order approximation. It assumes that the model is
right: a wrong model shifts the estimate by more than an interval says (`by_log`,
`whiteness`). A parameter within a tenth of a standard deviation of a bound is held
there, and has no interval; but one that the logs do not determine says nothing by lying
there, and stays free.
"""

import math
from dataclasses import replace
from enum import StrEnum
from typing import Literal

import numpy as np
from scipy.linalg import solve_triangular
from scipy.stats import t as student

from hydroid.arrays import Array, Mask, record, rms
from hydroid.parameters import ParameterSet
from hydroid.posterior.error_model import ErrorModel, Likelihood, likelihood_at
from hydroid.posterior.freedom import degrees_of_freedom
from hydroid.posterior.linear import Linear, linearised, white_posterior
from hydroid.posterior.posterior import (
    COVERAGE,
    UNIDENTIFIABLE_ABOVE,
    WEAK_PRIOR,
    Posterior,
    interval,
    regular,
)
from hydroid.problem.problem import Problem
from hydroid.search.axes import Box, held_by_bound

# relative standard deviation above which a parameter or direction is weakly
# identifiable
WEAK_ABOVE = 0.3


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
        share: part of the information that the logs gave: 1 - posterior / prior
            variance.
        known: whether logs and priors together determine it.
    """

    flag: Flag
    at_bound: Literal["lower", "upper"] | None = None
    share: float = 1.0
    known: bool = True

    @property
    def source(self) -> Source | None:
        """Where the information comes from; None where there is none, or the parameter
        is fixed."""
        if self.flag is Flag.FIXED or not self.known:
            return None
        return source_of(self.share)


def source_of(share: float) -> Source:
    """Return the source of what is known, of which the logs gave a share."""
    # nine tenths of the information are the only source that is named
    if share > 0.9:
        return Source.DATA
    return Source.BOTH if share >= 0.1 else Source.PRIOR


def flag_of(relative_sd: float, share: float = 1.0) -> Flag:
    """Return the flag of a relative standard deviation, of which the logs gave a share
    of the information.

    The logs alone leave a variance of the posterior's divided by their share. NaN
    counts as infinite.
    """
    alone = math.inf
    if share > 0:
        alone = relative_sd / math.sqrt(share)
    # NaN is not below it either
    if not alone <= UNIDENTIFIABLE_ABOVE:
        return Flag.UNIDENTIFIABLE
    return Flag.WEAK if alone > WEAK_ABOVE else Flag.IDENTIFIABLE


@record
class Uncertainty:
    """How precisely the data determine P parameters, p of them free, at an estimate.

    Attributes:
        likelihood: that the estimate maximises.
        linear: least squares linearised there, in the parameters that vary: free ones,
            but for those held at a bound.
        errors: the model of the output errors, as they are.
        innovations: what it leaves of them, shape (R,).
        scatters: covariance of the effects by each channel's errors, shape (C, p, p).
        sensitivity: rms change of the output error [rad] per 1 % of each parameter,
            shape (P,); NaN where fixed or where simulations diverge.
        posterior: what is known of the parameters that vary.
        relative: relative standard deviation of each parameter, shape (P,); inf where
            it is not identifiable, NaN where it is fixed or held.
        interval: of 95 %, shape (P, 2); infinite where not identifiable, NaN where
            fixed or at a bound.
        status: of each parameter.
    """

    likelihood: Likelihood
    linear: Linear
    errors: ErrorModel
    innovations: Array
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

    def variance(self, row: Array) -> float:
        """Return the variance of the innovations that least squares takes, summed along
        a row, (R,)."""
        return float(_scatters(self.likelihood, self.errors, row[None]).sum())

    @property
    def standard_deviation(self) -> Array:
        """Of each parameter, in its unit, shape (P,)."""
        return self.relative * self.linear.box.scale


def uncertainty(
    problem: Problem,
    theta: Array,
    first: Array | None = None,
    numbers: Array | None = None,
) -> Uncertainty:
    """Return the uncertainty of theta, shape (P,) (`linearised`).

    `numbers` of the errors, (S, 5), are those that least squares ended with; None:
    those that the errors at theta show.
    """
    likelihood = likelihood_at(problem, theta, numbers)
    return uncertainty_from(likelihood, linearised(likelihood, theta, first))


def uncertainty_from(likelihood: Likelihood, whole: Linear) -> Uncertainty:
    """Return the uncertainty from derivatives by all free parameters, without
    simulations."""
    fitted = likelihood.errors
    white = whole.white.deviations
    at_bound = held_by_bound(whole.box.room, white)
    # what the logs do not determine says nothing by lying at a bound
    held = at_bound & (white <= UNIDENTIFIABLE_ABOVE)
    linear = whole.restricted(~held | held.all())
    shown = fitted.errors(whole.innovations[None])
    errors = likelihood.shown
    scatters = _scatters(likelihood, errors, linear.effects)
    posterior = _posterior(linear, scatters)
    freedom = degrees_of_freedom(
        errors,
        fitted,
        shown[0],
        linear.effects,
        scatters.sum(axis=0) + linear.prior_scatter,
    )
    quantile = float(student.ppf(0.5 + COVERAGE / 2, freedom))
    posterior = replace(posterior, quantile=quantile)
    relative = linear.spread(posterior.deviations)
    effects = 0.01 * rms(fitted.errors(whole.slopes), axis=1)
    sensitivity = whole.spread(np.where(whole.diverging, np.nan, effects))
    status = _status(whole, relative, sensitivity, at_bound)
    unknown = np.array([not parameter.known for parameter in status])
    relative[unknown] = np.inf
    parameters = likelihood.problem.parameters
    return Uncertainty(
        likelihood=likelihood,
        linear=linear,
        errors=errors,
        innovations=errors.innovations(shown)[0],
        scatters=scatters,
        sensitivity=sensitivity,
        posterior=posterior,
        relative=relative,
        interval=ends(parameters, linear.box, quantile * relative),
        status=status,
    )


def _posterior(linear: Linear, scatters: Array) -> Posterior:
    """Return what is known of the parameters that vary where effects scatter as the
    errors and the priors make them, (C, p, p)."""
    scatter = scatters.sum(axis=0) + linear.prior_scatter
    # D V' is (V D^-1)^-1
    size = np.linalg.norm(linear.changes, axis=0)
    rows = (linear.changes / size**2).T
    half = np.linalg.cholesky(scatter)
    return Posterior(linear.box, regular(solve_triangular(half, rows, lower=True)))


def _status(
    whole: Linear, relative: Array, sensitivity: Array, at_bound: Mask
) -> tuple[ParameterStatus, ...]:
    """Return how well each of P parameters is known.

    `relative` are their standard deviations, (P,), NaN where they are fixed or held;
    `at_bound` says which of the p free ones lie at a bound.
    """
    free = whole.box.varied
    # held ones are flagged as if they were free
    held = np.isnan(relative)
    white = whole.spread(whole.white.deviations)
    deviations = np.where(held, white, relative)
    before = white_posterior(whole.box, whole.prior_slopes)
    prior = whole.spread(before.deviations)
    gained = 1 - (deviations / prior) ** 2
    shares = np.where(free, np.clip(gained, 0.0, 1.0), 1.0)
    # not the rounding of their factorisation
    shares[sensitivity == 0] = 0.0
    # a stated prior limits a parameter to half of what the weak one leaves, or less
    stated = prior < 0.5 * WEAK_PRIOR
    unknown = (deviations > UNIDENTIFIABLE_ABOVE) & ~stated
    status = [ParameterStatus(Flag.FIXED)] * len(free)
    below, above = whole.box.room
    for k, i in enumerate(np.flatnonzero(free).tolist()):
        flag = flag_of(deviations[i], shares[i])
        if sensitivity[i] == 0:
            flag = Flag.NO_EFFECT
        bound: Literal["lower", "upper"] | None = None
        if at_bound[k]:
            bound = "lower" if below[k] <= above[k] else "upper"
        status[i] = ParameterStatus(flag, bound, float(shares[i]), not unknown[i])
    return tuple(status)


def _scatters(likelihood: Likelihood, errors: ErrorModel, rows: Array) -> Array:
    """Covariance of rows, (n, R + ...), times the innovations, by each of C channels'
    errors, (C, n, n)."""
    parts = list[Array]()
    for number, channel in enumerate(likelihood.problem.channels):
        of_channel = rows[:, channel.rows]
        parts.append(errors.scatter(number, of_channel, likelihood.errors))
    return np.array(parts)


def ends(parameters: ParameterSet, box: Box, half: Array) -> Array:
    """Return intervals, shape (P, 2), from half their widths in relative changes, shape
    (P,).

    Those on a log scale are multiplicative. No end is below 0 where the parameter
    cannot be.
    """
    between = interval(box.at, half * box.scale, parameters.log)
    low = between[:, 0]
    # an infinite end stays one: it says that there is no limit
    impossible = (low < 0) & (parameters.lower >= 0)
    low[impossible & np.isfinite(low)] = 0.0
    return between
