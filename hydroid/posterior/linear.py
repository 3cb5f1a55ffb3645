"""Least squares linearised at an estimate, by finite differences as wide as the uncertainty.

Open start angles join with a prior: how well a log's sensor shows where the arm starts. A start is wrong by
the noise of one reading, or of the mean of a few. A residual shows this noise, and the error of the model
besides. So it is no more than the residual's level, and no more than 0.2°, or what the signal itself jumps
between samples. What the start angles may explain then stays small where the model errs by degrees. A joint
that is not compared has a sensor like the others', and no more noise than its angle spreads.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache

import numpy as np

from hydroid.arrays import Array, Mask, record
from hydroid.errors import SettingsError
from hydroid.log import Log
from hydroid.parameters import ParameterSet
from hydroid.posterior.noise import Noise, error_level, prior_weight, problem_noise
from hydroid.posterior.posterior import WEAK_PRIOR, Posterior, regular
from hydroid.problem.channels import Channel
from hydroid.problem.free_start import start_slopes
from hydroid.problem.priors import Priors
from hydroid.problem.problem import OpenStart, Problem
from hydroid.search.axes import Box, Function, differentiate, single_axes

NO_EFFECT_BELOW = 1e-6
"""a parameter whose effect is below this part of the strongest one's has none"""


@record
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
    diverging: Mask

    @cached_property
    def white(self) -> Posterior:
        """What is known if the noise is white, with as many samples as the noise's effective ones."""
        return white_posterior(self.box, self.slopes / self.prior_weight, self.prior_slopes)

    @cached_property
    def _svd(self) -> tuple[Array, Array, Array]:
        weight, weak = self.prior_weight, np.eye(len(self.slopes)) / WEAK_PRIOR
        rows = np.hstack([self.slopes, weight * self.prior_slopes, weight * weak])
        return np.linalg.svd(rows, full_matrices=False)

    @property
    def changes(self) -> Array:
        """Relative change of each parameter per unit of each effect, V D^-1, shape (p, p)."""
        return self._svd[0] / self._svd[1]

    @property
    def effects(self) -> Array:
        """Orthonormal rows U, shape (p, R + M + p)."""
        return self._svd[2]

    @cached_property
    def prior_scatter(self) -> Array:
        """What the priors' uncertainty scatters in each effect, shape (p, p)."""
        priors = self.prior_weight * self.effects[:, self.residual.size :]
        return priors @ priors.T

    def scatters(self, channels: Sequence[Channel], noise: Sequence[Noise]) -> Array:
        """Covariance of the effects by the noise of each channel, U S U', shape (C, p, p)."""
        pairs = zip(channels, noise, strict=True)
        return np.array([one.covariance_of(self.effects[:, channel.rows]) for channel, one in pairs])

    def of(self, kept: Mask) -> "Linear":
        """Return it with only some of the p parameters varying, shape (p,)."""
        rows = {name: getattr(self, name)[kept] for name in ("slopes", "prior_slopes", "diverging")}
        return replace(self, box=self.box.of(kept), **rows)

    def spread(self, values: Array) -> Array:
        """Return values of the parameters that vary, shape (p,), among all, shape (P,); NaN elsewhere."""
        whole = np.full(self.box.at.size, np.nan)
        whole[self.box.varied] = values
        return whole


def linearised(problem: Problem, theta: Array, first: Array | None = None) -> Linear:
    """Return the derivatives at theta, shape (P,), by its p free parameters.

    The first differences are by each parameter, p simulations. Then come differences of a standard deviation
    to each side along the axes of the covariance that follows, 2 p or more. They are taken once more where a
    standard deviation changed to four times or a quarter: the first axes were that far off. `first` are
    derivatives to begin with, shape (p, R), such as those of the least squares that ended there.
    """
    problem = with_open_start(problem, theta)
    box, residual = estimate_box(problem.parameters, theta), problem.residuals(theta[None])[0]
    weight = prior_weight(problem, residual)
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

    A relative change of 1 is the value; on a linear scale at least a hundredth of the bounds' width, of an
    effect of a group its prior's standard deviation.
    Raises SettingsError: a free parameter on a log scale is 0.
    """
    least = np.where(parameters.log, 0.0, 0.01 * (parameters.upper - parameters.lower))
    scale = np.maximum(np.maximum(np.abs(theta), least), [p.least for p in parameters.parameters])
    for name in parameters.named(parameters.free & (scale == 0)):
        raise SettingsError(
            f"parameter {name} is 0", hint="it is on a log scale: state a value above 0, or fix it"
        )
    return Box(theta, parameters.lower, parameters.upper, scale, parameters.free)


def prior_slopes(priors: Priors, box: Box) -> Array:
    """Derivatives of the M priors' scores, shape (p, M), per relative change of each free parameter."""
    return differentiate(priors.scores, box, single_axes(box, 1e-4))  # they are smooth


def white_posterior(box: Box, *parts: Array) -> Posterior:
    """Return the posterior of independent measurements, each (p, m): derivatives over their noise."""
    weak = np.eye(box.varied.sum()) / WEAK_PRIOR
    return Posterior(box, regular(np.vstack([weak, *(part.T for part in parts)])))


def with_open_start(problem: Problem, theta: Array) -> Problem:
    """Return the problem whose residuals hold for any start angle that its logs leave open.

    The effect of the start angles, and the noise that their priors follow from, are those at theta, (P,). It
    is the same problem where all logs show where they start.
    """
    return _opened(problem, tuple(theta.tolist())) if problem.leaves_start_open else problem


def least_squares_rows(problem: Problem, at: Array, prior_weight: float) -> Function:
    """Return the rows that least squares minimises, (n, R + M), by (n, P); starts are open as at one."""
    opened = with_open_start(problem, at)

    def rows(theta: Array) -> Array:
        return np.hstack([opened.residuals(theta), prior_weight * problem.priors.scores(theta)])

    return rows


@lru_cache(maxsize=1)  # a refinement asks for the same once more
def _opened(problem: Problem, values: tuple[float, ...]) -> Problem:
    theta = np.array(values)
    slopes = start_slopes(problem, theta)
    # first without a prior
    unbound = [
        each.opened(np.where(np.isin(each.joints, problem.settings.outputs), 1e9, 0.0)) for each in slopes
    ]
    free = problem.with_open_starts(unbound)
    row = free.residuals(theta[None])[0]
    if not np.isfinite(row).all():
        return free
    opened, noise, weight = list[OpenStart](), problem_noise(problem, row), prior_weight(problem, row)
    for each in slopes:
        levels = {
            c.joint: error_level(c, n)
            for c, n in zip(problem.channels, noise, strict=True)
            if c.log == each.log and c.quantity == "angle"
        }
        deviations = start_deviations(problem.logs[each.log], each.joints, levels)
        opened.append(each.opened(deviations / weight))
    return problem.with_open_starts(opened)


def start_deviations(log: Log, joints: Sequence[int], levels: Mapping[int, float]) -> Array:
    """Return how well a log shows the start angles of some of its joints [rad], shape (k,).

    `levels` [rad] are those of the compared angles' residuals, by joint.
    """
    noise = {joint: sensor_noise(log, joint, level) for joint, level in levels.items()}
    worst = max(noise.values())
    readings = [noise.get(j, min(worst, np.std(log.angle[:, j - 1]))) for j in joints]
    return readings / np.sqrt(np.maximum([log.start_samples[j - 1] for j in joints], 1.0))


def sensor_noise(log: Log, joint: int, level: float) -> float:
    """Standard deviation of one reading of a joint's angle [rad], no more than `level`.

    The third difference of white noise has 20 times its variance, and that of a motion is next to nothing.
    """
    jumps = np.diff(log.angle[:, joint - 1], n=3)
    shown = np.sqrt(np.mean(jumps**2) / 20) if len(jumps) else 0.0
    return min(level, max(np.radians(0.2), shown))
