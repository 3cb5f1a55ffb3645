"""Covariance of an estimate, and the intervals and flags that follow from it.

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
the estimate by more than an interval says. A parameter at a bound is held there, and has no interval; but one
that the logs do not determine says nothing by lying there, and stays free.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial.hermite_e import hermegauss
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.optimize import root_scalar
from scipy.stats import norm as normal

from hydroid.parameters import Array, Parameter, ParameterSet
from hydroid.posterior.flags import UNIDENTIFIABLE_ABOVE, Flag, ParameterStatus, Side, flag_of
from hydroid.posterior.jacobian import Jacobian, estimate_box, jacobian, white_posterior
from hydroid.posterior.noise import STEP, Noise, channel_noise, neighbours, transformed, unbiased
from hydroid.posterior.posterior import COVERAGE, NORMAL, WEAK_PRIOR, Posterior, regular
from hydroid.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class Linear:
    """Least squares at an estimate, linearised in the p parameters that vary: J = V D U.

    Attributes:
        changes: relative change of each parameter per unit of each effect, V D^-1, shape (p, p).
        effects: orthonormal rows U of the residuals, behind them the M priors' scores, behind these the weak
            priors' of the p parameters, shape (p, R + M + p).
        prior_scatter: what the priors' uncertainty scatters in each effect, shape (p, p).
    """

    changes: Array
    effects: Array
    prior_scatter: Array


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """How precisely the data determine P parameters, p of them free, at an estimate.

    Attributes:
        theta: the estimate, shape (P,).
        jacobian: derivatives there.
        noise: of each channel.
        free: which parameters are free, shape (P,).
        linear: least squares linearised there.
        posterior: what is known of all parameters that vary: free ones, but for those held at a bound.
        relative: relative standard deviation of each parameter, shape (P,); inf where it is not
            identifiable, NaN where it is fixed or held.
        interval: of 95 %, shape (P, 2); infinite where not identifiable, NaN where fixed or at a bound.
        status: of each parameter.
    """

    theta: Array
    jacobian: Jacobian
    noise: tuple[Noise, ...]
    free: NDArray[np.bool_]
    linear: Linear
    posterior: Posterior
    relative: Array
    interval: Array
    status: tuple[ParameterStatus, ...]

    @property
    def standard_deviation(self) -> Array:
        """Of each parameter, in its unit, shape (P,)."""
        return self.relative * self.jacobian.scale


def uncertainty(problem: Problem, theta: Array, first: Array | None = None) -> Uncertainty:
    """Return the uncertainty of theta, shape (P,), for the noise that its residuals show.

    `first` are derivatives to begin with (`jacobian`).
    """
    return uncertainty_from(problem, theta, jacobian(problem, theta, first))


def uncertainty_from(
    problem: Problem, theta: Array, derivatives: Jacobian, noise: tuple[Noise, ...] | None = None
) -> Uncertainty:
    """Return the uncertainty from the derivatives, without simulations; None: for the residual's noise."""
    free, determined = problem.parameters.free, (Flag.IDENTIFIABLE, Flag.WEAK)
    whole = _with_varied(problem, theta, derivatives, noise, free)
    held = np.array([status.at_bound is not None and status.flag in determined for status in whole.status])
    if not held.any() or not (free & ~held).any():
        return whole
    inside = _with_varied(problem, theta, derivatives, noise, free & ~held)
    status = tuple(a if h else b for a, b, h in zip(whole.status, inside.status, held, strict=True))
    return replace(inside, status=status)


def linearise(varied: NDArray[np.bool_], derivatives: Jacobian) -> Linear:
    """Return least squares linearised in some parameters, shape (P,), from the derivatives."""
    weight, scores = derivatives.prior_weight, derivatives.prior_slopes[varied]
    weak = np.eye(int(varied.sum())) / WEAK_PRIOR
    rows = np.hstack([np.nan_to_num(derivatives.slopes[varied]), weight * scores, weight * weak])
    directions, values, effects = np.linalg.svd(rows, full_matrices=False)
    priors = weight * effects[:, derivatives.residual.size :]
    return Linear(directions / values, effects, priors @ priors.T)


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
    """Return for each bound whether values lie within a thousandth of the range from it, on its scale."""
    position = parameter.position(value)
    return ("lower", np.asarray(position <= 1e-3)), ("upper", np.asarray(position >= 1 - 1e-3))


def quantile(spread: float) -> float:
    """Half the interval of a normal estimate whose variance is estimated, in standard deviations.

    `spread` is the standard deviation of the logarithm of the estimated variance: 0 gives 1.96.
    """
    nodes, weights = hermegauss(60)

    def outside(half: float) -> float:
        chance = weights @ (2 * normal.sf(half * np.exp(spread * nodes / 2))) / weights.sum()
        return float(chance) - (1 - COVERAGE)

    return float(root_scalar(outside, bracket=(1.0, 3.0 * np.exp(3 * spread))).root)


def _with_varied(
    problem: Problem,
    theta: Array,
    derivatives: Jacobian,
    noise: tuple[Noise, ...] | None,
    varied: NDArray[np.bool_],
) -> Uncertainty:
    """Return the uncertainty if the parameters `varied`, shape (P,), vary and the others are held."""
    free, scale, idle = problem.parameters.free, derivatives.scale, derivatives.without_effect
    linear = linearise(varied, derivatives)
    noise = _noise(problem, derivatives, linear) if noise is None else noise
    scatter, spread = _scatter(problem, linear, noise)
    size = np.linalg.norm(linear.changes, axis=0)  # D V' is (V D^-1)^-1
    half = np.linalg.cholesky(scatter)
    root = regular(solve_triangular(half, (linear.changes / size**2).T, lower=True))
    box = replace(estimate_box(problem.parameters, theta), scale=scale, varied=varied)
    posterior = Posterior(box, root)
    relative, widths, prior = np.full((3, len(theta)), np.nan)
    relative[varied] = posterior.deviations
    # where the logarithm of a variance is known to 5 or worse, nothing is, and no interval is of use
    widths[varied] = [quantile(each) for each in np.minimum(spread, 5.0)]
    prior[varied] = white_posterior(box, derivatives.prior_slopes[varied]).deviations
    shares = np.where(varied, np.clip(1 - (relative / prior) ** 2, 0.0, 1.0), 1.0)
    shares[idle] = 0.0  # not the rounding of their factorisation
    # where the noise is not well known the intervals are wider, and the flags are set accordingly;
    # a stated prior limits a parameter to half of what the weak one leaves, or less
    widened = relative * widths / NORMAL
    unknown = (widened > UNIDENTIFIABLE_ABOVE) & ~(prior < 0.5 * WEAK_PRIOR)
    relative[unknown] = np.inf
    interval = ends(problem.parameters, theta, scale, widths * relative)
    status: list[ParameterStatus] = []
    for i, parameter in enumerate(problem.parameters.parameters):
        if not free[i]:
            status.append(ParameterStatus(Flag.FIXED))
            continue
        bound: Side | None = next((side for side, at in at_bounds(parameter, theta[i]) if at), None)
        if bound is not None and not unknown[i]:
            interval[i] = np.nan
        flag = Flag.NO_EFFECT if idle[i] else flag_of(float(widened[i]), shares[i])
        doubt, diverges = float(derivatives.doubt[i]), not np.isfinite(derivatives.slopes[i]).all()
        doubtful = doubt if doubt > 0.25 else None
        status.append(ParameterStatus(flag, bound, doubtful, diverges, float(shares[i]), not unknown[i]))
    posterior = replace(posterior, quantile=float(np.nanmax(widths)))  # a quantity may depend on the worst
    return Uncertainty(theta, derivatives, noise, free, linear, posterior, relative, interval, tuple(status))


def _scatter(problem: Problem, linear: Linear, noise: tuple[Noise, ...]) -> tuple[Array, Array]:
    """Covariance of the effects, U S U', (p, p), and the spread of each parameter's variance, (p,).

    The spread is the standard deviation of the logarithm of the estimated variance.
    """
    scatter, moved = linear.prior_scatter, list[Array]()
    for channel, process in zip(problem.channels, noise, strict=True):
        waves, power = transformed(linear.effects[:, channel.rows]), process.power
        scatter = scatter + (waves * power) @ waves.T
        if others := neighbours(process):
            change = np.array([other.power - power for other in others]) / STEP
            moved.append((linear.changes @ waves) ** 2 @ change.T)
    variance = np.einsum("pi,ij,pj->p", linear.changes, scatter, linear.changes)
    return scatter, np.linalg.norm(np.hstack([np.zeros((len(variance), 1)), *moved]), axis=1) / variance


def _noise(problem: Problem, derivatives: Jacobian, linear: Linear) -> tuple[Noise, ...]:
    """Return each channel's noise before the fit absorbed a part of it."""
    objective, residual = problem.settings.objective, derivatives.residual
    effects = [linear.effects[:, c.rows] for c in problem.channels]
    noise = [channel_noise(c, residual[c.rows], objective) for c in problem.channels]
    pairs = list(zip(noise, effects, strict=True))
    spread = linear.prior_scatter + np.sum([each.covariance_of(part) for each, part in pairs], axis=0)
    return tuple(each if each.source == "settings" else unbiased(each, part, spread) for each, part in pairs)
