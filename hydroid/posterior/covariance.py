"""Covariance of an estimate, and the intervals and flags that follow from it.

The estimate minimises the weighted sum of squares of the residuals and of the priors' scores. The noise need
not be white, and the weights need not match it. Let J, shape (p, R), be the derivatives of all these
residuals per relative change of the free parameters, and S the covariance of the noise. The covariance of the
estimate is then the *sandwich*

    C = (J J')^-1 J S J' (J J')^-1        (P. J. Huber, 1967; G. A. F. Seber and C. J. Wild, 1989)

For white noise of one level this is the usual s² (J J')^-1. It is computed from one singular value
decomposition J = V D U as C^-1 = G' G with G = (U S U')^-1/2 D V'. No product J J' is formed, and a direction
that the residuals do not depend on keeps a singular value of exactly zero.

The process that describes the noise is estimated too. The variance of a parameter is then uncertain, and its
interval must be wider than one with a known variance. The logarithm of the estimated variance is about
normal: `quantile`. (Student's t, for a variance that follows a χ², is far too wide where the noise is slow:
its quantile grows without limit, while a variance from a spectrum errs to both sides.)

The covariance is a local, first-order approximation. It assumes that the model is right: a wrong model shifts
the estimate by more than an interval says. At a bound the covariance is computed as if there were none, and
the parameter gets no interval.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.hermite_e import hermegauss
from numpy.typing import NDArray
from scipy.optimize import root_scalar
from scipy.stats import norm as normal

from hydroid.parameters import Array, Parameter, ParameterSet
from hydroid.posterior.axes import RANK_TOLERANCE
from hydroid.posterior.flags import UNIDENTIFIABLE_ABOVE, Flag, ParameterStatus, Side, flag_of
from hydroid.posterior.jacobian import Jacobian, jacobian
from hydroid.posterior.noise import Noise, channel_noise, covariances, unbiased
from hydroid.posterior.noise_error import STEP, neighbours
from hydroid.posterior.sources import data_shares
from hydroid.problem.problem import Problem

COVERAGE = 0.95
"""probability with which an interval covers the true value"""
BOUND_MARGIN = 1e-3
"""part of the range within which an estimate is called at a bound"""
NULL_COMPONENT = 0.01
"""component in an unmeasured direction below which a parameter does not depend on it"""
DOUBT_ABOVE = 0.25
"""relative change of a standard deviation in the last round, above which it is reported"""
TINY = float(np.finfo(float).tiny)
MAX_LOG_SPREAD = 5.0
"""beyond it nothing is known of a variance, and no interval is of use"""
_NODES, _WEIGHTS = hermegauss(60)


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """How precisely the data determine P parameters, p of them free, at an estimate.

    Attributes:
        theta: the estimate, shape (P,).
        jacobian: derivatives there.
        noise: of each channel.
        free: which parameters are free, shape (P,).
        root: G of C^-1 = G' G, shape (p, p): a relative change v of the free parameters is |G v| standard
            deviations long.
        relative: relative standard deviation of each parameter, shape (P,); inf where it is not
            identifiable, NaN where it is fixed.
        interval: of 95 %, shape (P, 2); infinite where not identifiable, NaN where fixed or at a bound.
        quantile: half the interval in standard deviations, shape (P,): 1.96 where the noise is well known.
        correlation: of the free parameters' estimates, shape (p, p); NaN where not identifiable.
        status: of each parameter.
    """

    theta: Array
    jacobian: Jacobian
    noise: tuple[Noise, ...]
    free: NDArray[np.bool_]
    root: Array
    relative: Array
    interval: Array
    quantile: Array
    correlation: Array
    status: tuple[ParameterStatus, ...]

    @property
    def standard_deviation(self) -> Array:
        """Of each parameter, in its unit, shape (P,)."""
        return self.relative * self.jacobian.scale


def uncertainty(problem: Problem, theta: Array) -> Uncertainty:
    """Return the uncertainty of theta, shape (P,), for the noise that its residuals show."""
    return uncertainty_from(problem, theta, jacobian(problem, theta))


def uncertainty_from(
    problem: Problem, theta: Array, derivatives: Jacobian, noise: tuple[Noise, ...] | None = None
) -> Uncertainty:
    """Return the uncertainty from the derivatives, without simulations; None: for the residual's noise."""
    free, parameters = problem.parameters.free, problem.parameters.parameters
    root, noise, changes = _root(problem, derivatives, noise)
    covariance, unmeasured = covariance_of(root)
    relative, widths = np.full((2, len(theta)), np.nan)
    relative[free] = np.where(unmeasured, np.inf, np.sqrt(np.diag(covariance)))
    widths[free] = [quantile(spread) for spread in np.minimum(_log_spread(root, changes), MAX_LOG_SPREAD)]
    # where the noise is not well known the intervals are wider, and the flags are set accordingly
    widened = relative * widths / float(normal.ppf(0.5 + COVERAGE / 2))
    unidentifiable = widened > UNIDENTIFIABLE_ABOVE
    shares = np.ones(len(theta))
    shares[free] = data_shares(derivatives.prior_slopes[free], relative[free] ** 2)
    unidentifiable &= shares == 1.0  # no prior limits it
    relative[unidentifiable] = np.inf
    interval = ends(problem.parameters, theta, derivatives.scale, widths * relative)
    status: list[ParameterStatus] = []
    for i, parameter in enumerate(parameters):
        if not free[i]:
            status.append(ParameterStatus(Flag.FIXED))
            continue
        bound: Side | None = next((side for side, at in at_bounds(parameter, theta[i]) if at), None)
        if bound is not None and not unidentifiable[i]:
            interval[i] = np.nan
        doubt, diverges = float(derivatives.doubt[i]), not np.isfinite(derivatives.slopes[i]).all()
        flag = flag_of(float(widened[i]), shares[i])
        flag = Flag.NO_EFFECT if derivatives.without_effect[i] else flag
        doubtful = doubt if doubt > DOUBT_ABOVE else None
        status.append(ParameterStatus(flag, bound, doubtful, diverges, float(shares[i])))
    deviation = np.where(unidentifiable[free], np.nan, relative[free])
    correlation = covariance / np.outer(deviation, deviation)
    return Uncertainty(
        theta, derivatives, noise, free, root, relative, interval, widths, correlation, tuple(status)
    )


def covariance_of(root: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return (G' G)^-1 over the measured directions, (p, p), and which parameters need the others, (p,)."""
    _, values, directions = np.linalg.svd(root)
    measured = values > RANK_TOLERANCE * values.max(initial=0.0)
    inverse = directions[measured] / values[measured, None]
    return inverse.T @ inverse, np.linalg.norm(directions[~measured], axis=0) > NULL_COMPONENT


def ends(parameters: ParameterSet, theta: Array, scale: Array, half: Array) -> Array:
    """Return intervals, shape (P, 2), from half their widths in relative changes, shape (P,).

    Those on a log scale are multiplicative. No end is below 0 where the parameter cannot be.
    """
    log = parameters.log
    with np.errstate(over="ignore"):  # inf without an interval
        factor = np.exp(np.where(log, half, 0.0))
    change = np.where(log, 0.0, half * scale)
    low = theta / factor - change
    low = np.where(np.isfinite(low) & (parameters.lower >= 0), np.maximum(low, 0.0), low)
    return np.stack([low, theta * factor + change], axis=1)


def at_bounds(parameter: Parameter, value: Array | float) -> tuple[tuple[Side, NDArray[np.bool_]], ...]:
    """Return for each bound whether values lie at it, on the parameter's scale."""
    position = parameter.position(value)
    return (
        ("lower", np.asarray(position <= BOUND_MARGIN)),
        ("upper", np.asarray(position >= 1 - BOUND_MARGIN)),
    )


def decompose(free: NDArray[np.bool_], derivatives: Jacobian) -> tuple[Array, Array, Array]:
    """Return V, D, U of J = V D U: directions (p, p), singular values (p,), effects (p, R + M).

    The effects are unit rows of residuals with the M priors behind them.
    """
    priors = derivatives.prior_weight * derivatives.prior_slopes[free]
    rows = np.hstack([np.nan_to_num(derivatives.slopes[free]), priors])
    directions, values, effects = np.linalg.svd(rows, full_matrices=False)
    values[values <= RANK_TOLERANCE * values[0]] = 0.0
    return directions, values, effects


def quantile(spread: float) -> float:
    """Half the interval of a normal estimate whose variance is estimated, in standard deviations.

    `spread` is the standard deviation of the logarithm of the estimated variance: 0 gives 1.96.
    """

    def outside(half: float) -> float:
        chance = _WEIGHTS @ (2 * normal.sf(half * np.exp(spread * _NODES / 2))) / _WEIGHTS.sum()
        return float(chance) - (1 - COVERAGE)

    return float(root_scalar(outside, bracket=(1.0, 3.0 * np.exp(3 * spread))).root)


def _log_spread(root: Array, changes: Array) -> Array:
    """Standard deviation of the logarithm of each free parameter's estimated variance, shape (p,).

    `changes`, (m, p, p), are those of G^-T C^-1 G^-1 when the noise changes by each of its standard errors.
    """
    left, values, directions = np.linalg.svd(root)
    measured = values > RANK_TOLERANCE * values.max(initial=0.0)
    # columns: G^-T of one parameter's change
    rows = left[:, measured] @ (directions[measured] / values[measured, None])
    length = np.sum(rows**2, axis=0)
    moved = np.einsum("ip,mij,jp->mp", rows, changes, rows) / np.where(length > 0, length, 1.0)
    return np.sqrt(np.sum(moved**2, axis=0))


def _root(
    problem: Problem, derivatives: Jacobian, noise: tuple[Noise, ...] | None
) -> tuple[Array, tuple[Noise, ...], Array]:
    """Return G, shape (p, p), the noise with what the fit absorbed, and the changes for `_log_spread`."""
    directions, values, effects = decompose(problem.parameters.free, derivatives)
    fitted = values > 0
    samples, weight = len(derivatives.residual), derivatives.prior_weight
    priors = weight**2 * effects[:, samples:] @ effects[:, samples:].T
    parts = [effects[:, channel.rows] for channel in problem.channels]
    if noise is None:
        noise = _unabsorbed(problem, derivatives, [part[fitted] for part in parts], priors[fitted][:, fitted])
    scatter = priors
    moved: list[Array] = []
    for part, process in zip(parts, noise, strict=True):
        each = covariances([process, *neighbours(process)], part)
        scatter += each[0]
        moved += [(other - each[0]) / STEP for other in each[1:]]
    variance, axes = np.linalg.eigh(scatter[np.ix_(fitted, fitted)])
    inverse = np.zeros_like(scatter)  # along a direction without effect, effects are rounding only
    inverse[np.ix_(fitted, fitted)] = (axes / np.sqrt(np.maximum(variance, TINY))) @ axes.T
    changes = np.array([inverse @ m @ inverse for m in moved]).reshape(-1, *inverse.shape)
    return inverse @ (values[:, None] * directions.T), noise, changes


def _unabsorbed(
    problem: Problem, derivatives: Jacobian, effects: Sequence[Array], priors: Array
) -> tuple[Noise, ...]:
    """Return each channel's noise before the fit absorbed a part of it.

    `effects`, (k, T) of each channel, are orthonormal together; `priors`, (k, k), is their scatter.
    """
    residual, objective = derivatives.residual, problem.settings.objective
    noise = tuple(channel_noise(c, residual[c.rows], objective) for c in problem.channels)
    spread = priors + np.sum(
        [process.covariance_of(part) for process, part in zip(noise, effects, strict=True)], axis=0
    )
    return tuple(
        process if process.source == "settings" else unbiased(process, part, spread)
        for process, part in zip(noise, effects, strict=True)
    )
