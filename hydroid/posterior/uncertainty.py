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

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.hermite_e import hermegauss
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.optimize import root_scalar
from scipy.stats import norm as normal

from hydroid.parameters import Array, ParameterSet
from hydroid.posterior.flags import UNIDENTIFIABLE_ABOVE, WEAK_ABOVE, Flag, ParameterStatus, Side, flag_of
from hydroid.posterior.linear import Linear, linearised, white_posterior
from hydroid.posterior.noise import STEP, Noise, channel_noise, neighbours, transformed, unbiased
from hydroid.posterior.posterior import COVERAGE, NORMAL, WEAK_PRIOR, Posterior, regular
from hydroid.problem.problem import Problem
from hydroid.search.axes import held_by_bound


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """How precisely the data determine P parameters, p of them free, at an estimate.

    Attributes:
        linear: least squares linearised there, in the parameters that vary: free ones, but for those held at
            a bound.
        noise: of each channel.
        free: which parameters are free, shape (P,).
        sensitivity: rms change of the residual [rad] per 1 % of each parameter, shape (P,); NaN where fixed
            or where simulations diverge.
        posterior: what is known of the parameters that vary.
        relative: relative standard deviation of each parameter, shape (P,); inf where it is not
            identifiable, NaN where it is fixed or held.
        interval: of 95 %, shape (P, 2); infinite where not identifiable, NaN where fixed or at a bound.
        status: of each parameter.
    """

    linear: Linear
    noise: tuple[Noise, ...]
    free: NDArray[np.bool_]
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
    """Return the uncertainty of theta, shape (P,), for the noise that its residuals show.

    `first` are derivatives to begin with (`linearised`).
    """
    return uncertainty_from(problem, linearised(problem, theta, first))


def uncertainty_from(problem: Problem, whole: Linear, noise: tuple[Noise, ...] | None = None) -> Uncertainty:
    """Return the uncertainty from derivatives by all free parameters, without simulations.

    None: for the noise that the residual shows.
    """
    free, white = whole.box.varied, whole.white.deviations
    sides, held = _bounds(whole)
    linear = whole.of(~held)
    noise = _noise(problem, linear) if noise is None else noise
    scatter, spread = _scatter(problem, linear, noise)
    size = np.linalg.norm(linear.changes, axis=0)  # D V' is (V D^-1)^-1
    half = np.linalg.cholesky(scatter)
    root = regular(solve_triangular(half, (linear.changes / size**2).T, lower=True))
    # where the logarithm of a variance is known to 5 or worse, nothing is, and no interval is of use
    widths = np.array([quantile(each) for each in np.minimum(spread, 5.0)])
    # a quantity may depend on the parameter whose noise is least known
    posterior = Posterior(linear.box, root, quantile=float(widths.max()))
    relative, widths = linear.spread(posterior.deviations), linear.spread(widths)
    # held ones are flagged as if the noise were white
    known = np.where(np.isnan(relative), whole.spread(white), relative)
    prior = whole.spread(white_posterior(whole.box, whole.prior_slopes).deviations)
    shares = np.where(free, np.clip(1 - (known / prior) ** 2, 0.0, 1.0), 1.0)
    shares[whole.sensitivity == 0] = 0.0  # not the rounding of their factorisation
    # where the noise is not well known the intervals are wider, and the flags are set accordingly;
    # a stated prior limits a parameter to half of what the weak one leaves, or less
    widened = known * np.where(np.isnan(widths), NORMAL, widths) / NORMAL
    unknown = (widened > UNIDENTIFIABLE_ABOVE) & ~(prior < 0.5 * WEAK_PRIOR)
    relative[unknown] = np.inf
    interval = ends(problem.parameters, linear.box.at, linear.box.scale, widths * relative)
    status: list[ParameterStatus] = []
    for i, sensitivity in enumerate(whole.sensitivity):
        if not free[i]:
            status.append(ParameterStatus(Flag.FIXED))
            continue
        flag = Flag.NO_EFFECT if sensitivity == 0 else flag_of(float(widened[i]), shares[i])
        diverges = bool(np.isnan(sensitivity))
        status.append(ParameterStatus(flag, sides.get(i), diverges, float(shares[i]), not unknown[i]))
    return Uncertainty(linear, noise, free, whole.sensitivity, posterior, relative, interval, tuple(status))


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


def quantile(spread: float) -> float:
    """Half the interval of a normal estimate whose variance is estimated, in standard deviations.

    `spread` is the standard deviation of the logarithm of the estimated variance: 0 gives 1.96.
    """
    nodes, weights = hermegauss(60)

    def outside(half: float) -> float:
        chance = weights @ (2 * normal.sf(half * np.exp(spread * nodes / 2))) / weights.sum()
        return float(chance) - (1 - COVERAGE)

    return float(root_scalar(outside, bracket=(1.0, 3.0 * np.exp(3 * spread))).root)


def _bounds(whole: Linear) -> tuple[dict[int, Side], NDArray[np.bool_]]:
    """The bound that each parameter, 0 to P - 1, lies at, and which of the p are held there."""
    room, deviations = whole.box.room, whole.white.deviations
    edge = held_by_bound(room, deviations)
    nearest: tuple[Side, Side] = ("lower", "upper")
    places = zip(np.flatnonzero(whole.box.varied).tolist(), room.argmin(axis=0), edge, strict=True)
    sides = {i: nearest[side] for i, side, there in places if there}
    held = edge & (deviations <= UNIDENTIFIABLE_ABOVE)
    return sides, held & ~held.all()


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


def _noise(problem: Problem, linear: Linear) -> tuple[Noise, ...]:
    """Return each channel's noise before the fit absorbed a part of it."""
    objective = problem.settings.objective
    pairs = [
        (channel_noise(c, linear.residual[c.rows], objective), linear.effects[:, c.rows])
        for c in problem.channels
    ]
    spread = linear.prior_scatter + np.sum([each.covariance_of(part) for each, part in pairs], axis=0)
    return tuple(each if each.source == "settings" else unbiased(each, part, spread) for each, part in pairs)


@dataclass(frozen=True, eq=False)
class Identifiability:
    """The directions that are determined, and those that are not.

    Attributes:
        names: of the p parameters that vary.
        alone: those of them that are not determined to WEAK_ABOVE, whatever the others are.
        combinations: of the other parameters that are not determined either, the least determined first: the
            relative changes, the largest +1, of those that take a tenth of it or more.
    """

    names: tuple[str, ...]
    alone: tuple[str, ...]
    combinations: tuple[dict[str, float], ...]

    @property
    def rank(self) -> int:
        """Number of independent combinations that are determined."""
        return len(self.names) - len(self.alone) - len(self.combinations)


def identifiability(problem: Problem, uncertainty: Uncertainty) -> Identifiability:
    """Return the directions that are not determined at an estimate."""
    root = uncertainty.posterior.root
    names = np.array(problem.parameters.names)[uncertainty.linear.box.varied]
    alone = np.linalg.norm(root, axis=0) < 1 / WEAK_ABOVE
    _, values, axes = np.linalg.svd(root[:, ~alone], full_matrices=False)
    combinations: list[dict[str, float]] = []
    for axis in axes[values < 1 / WEAK_ABOVE][::-1]:
        changes = axis / axis[np.argmax(np.abs(axis))]
        order = [i for i in np.argsort(-np.abs(changes), kind="stable") if abs(changes[i]) >= 0.1]
        combinations.append({str(names[~alone][i]): float(changes[i]) for i in order})
    return Identifiability(tuple(names.tolist()), tuple(names[alone].tolist()), tuple(combinations))
