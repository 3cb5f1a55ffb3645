"""Covariance of an estimate, and the intervals and flags that follow from it.

The estimate minimises the weighted sum of squares of the residuals and of the priors' scores. The noise need
not be white, and the weights need not match it. Let J, shape (p, R), be the derivatives of all these
residuals per relative change of the free parameters, and S the covariance of the noise. The covariance of the
estimate is then the *sandwich*

    C = (J J')^-1 J S J' (J J')^-1        (P. J. Huber, 1967; G. A. F. Seber and C. J. Wild, 1989)

For white noise of one level this is the usual s² (J J')^-1. It is computed from one singular value
decomposition J = V D U as C^-1 = G' G with G = (U S U')^-1/2 D V'. No product J J' is formed, and a direction
that the residuals do not depend on keeps a singular value of exactly zero.

The covariance is a local, first-order approximation. It assumes that the model is right: a wrong model shifts
the estimate by more than an interval says. At a bound the covariance is computed as if there were none, and
the parameter gets no interval.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm as normal
from scipy.stats import t as student

from hydroid.parameters import Array, Parameter
from hydroid.problem.problem import Problem
from hydroid.uncertainty.flags import UNIDENTIFIABLE_ABOVE, Flag, ParameterStatus, Side, flag_of
from hydroid.uncertainty.jacobian import Jacobian, jacobian
from hydroid.uncertainty.noise import Noise, channel_noise, unbiased

COVERAGE = 0.95
"""probability with which an interval covers the true value"""
BOUND_MARGIN = 1e-3
"""part of the range within which an estimate is called at a bound"""
RANK_TOLERANCE = 1e-12
"""singular values below this part of the largest are zero"""
NULL_COMPONENT = 0.01
"""component in an unmeasured direction below which a parameter does not depend on it"""
DOUBT_ABOVE = 0.1
"""relative difference between two steps' derivatives above which it is reported"""


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
        interval: of 95 %, from Student's t, shape (P, 2); infinite where not identifiable, NaN where fixed
            or at a bound.
        correlation: of the free parameters' estimates, shape (p, p); NaN where not identifiable.
        freedom: degrees of freedom of the noise's level.
        status: of each parameter.
    """

    theta: Array
    jacobian: Jacobian
    noise: tuple[Noise, ...]
    free: NDArray[np.bool_]
    root: Array
    relative: Array
    interval: Array
    correlation: Array
    freedom: float
    status: tuple[ParameterStatus, ...]

    @property
    def standard_deviation(self) -> Array:
        """Of each parameter, in its unit, shape (P,)."""
        return self.relative * self.jacobian.scale


def uncertainty(problem: Problem, theta: Array) -> Uncertainty:
    """Return the uncertainty of theta, shape (P,), for the noise that its residuals show."""
    derivatives = jacobian(problem, theta)
    residual, objective = derivatives.residual, problem.settings.objective
    noise = tuple(channel_noise(c, residual[c.rows], objective) for c in problem.channels)
    return uncertainty_from(problem, theta, derivatives, noise)


def uncertainty_from(
    problem: Problem, theta: Array, derivatives: Jacobian, noise: tuple[Noise, ...]
) -> Uncertainty:
    """Return the uncertainty from the derivatives and the residual's noise, without simulations."""
    free, parameters = problem.parameters.free, problem.parameters.parameters
    root, noise, freedom = _root(problem, derivatives, noise)
    covariance, unmeasured = covariance_of(root)
    relative = np.full(len(theta), np.nan)
    relative[free] = np.where(unmeasured, np.inf, np.sqrt(np.diag(covariance)))
    quantile = float(student.ppf(0.5 + COVERAGE / 2, freedom))
    # with a small effective sample size the intervals are wider, and the flags are set accordingly
    widened = relative * quantile / float(normal.ppf(0.5 + COVERAGE / 2))
    unidentifiable = widened > UNIDENTIFIABLE_ABOVE
    relative[unidentifiable] = np.inf
    half, log = quantile * relative, problem.parameters.log
    with np.errstate(over="ignore"):  # inf without an interval
        factor = np.exp(np.where(log, half, 0.0))
    change = np.where(log, 0.0, half * derivatives.scale)
    interval = np.stack([theta / factor - change, theta * factor + change], axis=1)
    status: list[ParameterStatus] = []
    for i, parameter in enumerate(parameters):
        if not free[i]:
            status.append(ParameterStatus(Flag.FIXED))
            continue
        bound: Side | None = next((side for side, at in at_bounds(parameter, theta[i]) if at), None)
        if bound is not None and not unidentifiable[i]:
            interval[i] = np.nan
        doubt, diverges = float(derivatives.doubt[i]), not np.isfinite(derivatives.slopes[i]).all()
        flag = Flag.NO_EFFECT if derivatives.without_effect[i] else flag_of(float(widened[i]))
        status.append(ParameterStatus(flag, bound, doubt if doubt > DOUBT_ABOVE else None, diverges))
    deviation = np.where(unidentifiable[free], np.nan, relative[free])
    correlation = covariance / np.outer(deviation, deviation)
    return Uncertainty(
        theta, derivatives, noise, free, root, relative, interval, correlation, freedom, tuple(status)
    )


def covariance_of(root: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return (G' G)^-1 over the measured directions, (p, p), and which parameters need the others, (p,)."""
    _, values, directions = np.linalg.svd(root)
    measured = values > RANK_TOLERANCE * values.max(initial=0.0)
    inverse = directions[measured] / values[measured, None]
    return inverse.T @ inverse, np.linalg.norm(directions[~measured], axis=0) > NULL_COMPONENT


def at_bounds(parameter: Parameter, value: Array | float) -> tuple[tuple[Side, NDArray[np.bool_]], ...]:
    """Return for each bound whether values lie at it, on the parameter's scale."""
    position = parameter.position(value)
    return (
        ("lower", np.asarray(position <= BOUND_MARGIN)),
        ("upper", np.asarray(position >= 1 - BOUND_MARGIN)),
    )


def decompose(free: NDArray[np.bool_], derivatives: Jacobian) -> tuple[Array, Array, Array]:
    """Return V, D, U of J = V D U: directions (p, p), singular values (p,), effects (p, R + M).

    The effects are unit rows of residuals with the M priors behind them. A singular value that is no larger
    than the difference between two steps' derivatives is 0.
    """
    rows = np.hstack([derivatives.slopes, derivatives.prior_weight * derivatives.prior_slopes])[free]
    directions, values, effects = np.linalg.svd(np.nan_to_num(rows), full_matrices=False)
    error = np.linalg.norm(directions.T @ np.nan_to_num(derivatives.error[free]), axis=1)
    values[values <= np.maximum(error, RANK_TOLERANCE * values[0])] = 0.0
    return directions, values, effects


def _root(
    problem: Problem, derivatives: Jacobian, noise: tuple[Noise, ...]
) -> tuple[Array, tuple[Noise, ...], float]:
    """Return G, shape (p, p), the noise with what the fit absorbed, its degrees of freedom."""
    directions, values, effects = decompose(problem.parameters.free, derivatives)
    priors = effects[:, len(derivatives.residual) :]
    parts = [effects[:, channel.rows] for channel in problem.channels]

    def scatter(noise: tuple[Noise, ...]) -> Array:
        """U S U', shape (p, p)."""
        channels = [process.covariance_of(part) for process, part in zip(noise, parts, strict=True)]
        return derivatives.prior_weight**2 * priors @ priors.T + np.sum(channels, axis=0)

    fitted = values > 0
    spread = scatter(noise)[np.ix_(fitted, fitted)]
    noise = tuple(
        unbiased(process, part[fitted], spread) if process.source == "residual" else process
        for process, part in zip(noise, parts, strict=True)
    )
    variance, axes = np.linalg.eigh(scatter(noise))
    inverse = (axes / np.sqrt(np.maximum(variance, np.finfo(float).tiny))) @ axes.T
    # the level of slow noise is known as from half its effective samples: AR(1), delta method at 0 Hz
    freedom = 0.5 * sum(process.effective_sample_size for process in noise) - np.count_nonzero(values)
    return inverse @ (values[:, None] * directions.T), noise, max(freedom, 1.0)
