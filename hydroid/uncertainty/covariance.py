"""How well the data determine each parameter: covariance, intervals, flags.

The estimate minimises the weighted squares of the residuals, and of the statements' scores times the
residual's level; the noise need not be white, nor the weights match it. With J the derivatives of all that
per relative change, shape (p, R), and S the covariance of the noise, that of the estimate is the *sandwich*

    C = (J J')^-1 J S J' (J J')^-1        (P. J. Huber, 1967; G. A. F. Seber and C. J. Wild, 1989)

which for white noise of one level is the usual s² (J J')^-1. All of it goes through one singular value
decomposition J = V D U, C^-1 = G' G with G = (U S U')^-1/2 D V': directions that the data do not feel keep a
singular value of exactly zero, and nothing is squared on the way.

It is a first-order, local look, and holds as far as the model does: an error of the model that shifts an
estimate is in no interval. An estimate on a bound is treated as if the bound were not there, and gets no
interval.
"""

from collections.abc import Iterable
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
    """What the data say about P parameters, p of them free, at an estimate.

    Attributes:
        theta: the estimate, shape (P,).
        jacobian: derivatives there.
        noise: of each channel.
        free: which parameters are free, shape (P,).
        root: G of C^-1 = G' G, shape (p, p): a relative change v of the free parameters is |G v| standard
            deviations away from the estimate.
        relative: relative standard deviation of each parameter, shape (P,); inf where it is not determined,
            NaN where it is fixed.
        interval: of 95 %, from Student's t, shape (P, 2); infinite where not determined, NaN where fixed or
            at a bound.
        correlation: of the free parameters' estimates, shape (p, p); NaN where not determined.
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
    """Return how well the problem's data determine theta, shape (P,), with the noise that they show there."""
    slopes = jacobian(problem, theta)
    noise = tuple(
        channel_noise(channel, slopes.residual[channel.rows], problem.settings.objective)
        for channel in problem.channels
    )
    return judge(problem, theta, slopes, noise)


def judge(problem: Problem, theta: Array, slopes: Jacobian, noise: tuple[Noise, ...]) -> Uncertainty:
    """Return the uncertainty from derivatives and the residual's noise: `uncertainty` without simulations."""
    free = problem.parameters.free
    root, noise, freedom = _root(problem, slopes, noise)
    covariance, lost = covariance_of(root)
    relative = np.full(len(theta), np.nan)
    relative[free] = np.where(lost, np.inf, np.sqrt(np.diag(covariance)))
    # with few independent samples Student's t is wide: so wide must a flag's limits be taken
    widening = float(student.ppf(0.5 + COVERAGE / 2, freedom) / normal.ppf(0.5 + COVERAGE / 2))
    unknown = widening * relative > UNIDENTIFIABLE_ABOVE
    relative[unknown] = np.inf
    bound: list[Side | None] = [
        next((side for side, at in at_bounds(parameter, value) if at), None)
        for parameter, value in zip(problem.parameters.parameters, theta, strict=True)
    ]
    half = student.ppf(0.5 + COVERAGE / 2, freedom) * relative * slopes.scale
    interval = np.stack([theta - half, theta + half], axis=1)
    interval[[side is not None for side in bound] & ~unknown] = np.nan
    status = tuple(
        _status(widening * float(relative[i]), slopes, i, bound[i])
        if free[i]
        else ParameterStatus(Flag.FIXED)
        for i in range(len(theta))
    )
    deviation = np.where(unknown[free], np.nan, relative[free])
    return Uncertainty(
        theta,
        slopes,
        noise,
        free,
        root,
        relative,
        interval,
        covariance / np.outer(deviation, deviation),
        freedom,
        status,
    )


def covariance_of(root: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return (G' G)^-1 over the felt directions, (p, p), and who has a part in the others, (p,)."""
    _, values, directions = np.linalg.svd(root)
    felt = values > RANK_TOLERANCE * values.max(initial=0.0)
    known = directions[felt] / values[felt, None]
    return known.T @ known, np.linalg.norm(directions[~felt], axis=0) > NULL_COMPONENT


def at_bounds(parameter: Parameter, value: Array | float) -> tuple[tuple[Side, NDArray[np.bool_]], ...]:
    """Whether values lie at each bound."""
    margin = BOUND_MARGIN * (parameter.upper - parameter.lower)
    return (
        ("lower", np.asarray(value - parameter.lower <= margin)),
        ("upper", np.asarray(parameter.upper - value <= margin)),
    )


def decompose(free: NDArray[np.bool_], slopes: Jacobian) -> tuple[Array, Array, Array]:
    """Return V, D, U of J = V D U: directions (p, p), strengths (p,), what they do to residuals (p, R + M).

    A strength that is not beyond what two steps of the differences differ by is 0.
    """
    felt = np.nan_to_num(np.hstack([slopes.slopes, slopes.unit * slopes.statements])[free])
    directions, values, course = np.linalg.svd(felt, full_matrices=False)
    error = np.linalg.norm(directions.T @ np.nan_to_num(slopes.error[free]), axis=1)
    values[values <= np.maximum(error, RANK_TOLERANCE * values[0])] = 0.0
    return directions, values, course


def _root(
    problem: Problem, slopes: Jacobian, noise: tuple[Noise, ...]
) -> tuple[Array, tuple[Noise, ...], float]:
    """Return G, shape (p, p), the noise with what the fit took up, its degrees of freedom."""
    directions, values, course = decompose(problem.parameters.free, slopes)
    unit = slopes.unit
    count = len(slopes.residual)
    statements = unit**2 * course[:, count:] @ course[:, count:].T
    parts = [course[:, channel.rows] for channel in problem.channels]
    scatter = statements + _sum(
        process.covariance_of(part) for process, part in zip(noise, parts, strict=True)
    )
    taken = values > 0
    noise = tuple(
        unbiased(process, part[taken], scatter[np.ix_(taken, taken)])
        if process.source == "residual"
        else process
        for process, part in zip(noise, parts, strict=True)
    )
    scatter = statements + _sum(
        process.covariance_of(part) for process, part in zip(noise, parts, strict=True)
    )
    strength, axes = np.linalg.eigh(scatter)
    inverse = (axes / np.sqrt(np.maximum(strength, np.finfo(float).tiny))) @ axes.T
    # the strength of slow noise is known as from half its effective samples: AR(1), delta method at 0 Hz
    freedom = 0.5 * sum(process.effective_sample_size for process in noise) - np.count_nonzero(values)
    return inverse @ (values[:, None] * directions.T), noise, max(freedom, 1.0)


def _sum(matrices: Iterable[Array]) -> Array:
    return np.sum(list(matrices), axis=0)


def _status(relative: float, slopes: Jacobian, i: int, at_bound: Side | None) -> ParameterStatus:
    return ParameterStatus(
        Flag.NO_EFFECT if slopes.without_effect[i] else flag_of(relative),
        at_bound,
        float(slopes.doubt[i]) if slopes.doubt[i] > DOUBT_ABOVE else None,
        diverges=not np.isfinite(slopes.slopes[i]).all(),
    )
