"""The prior of open start angles: how well a log's sensor shows where the arm starts.

A start is wrong by the noise of one reading, or of the mean of a few. A residual shows this noise, and the
error of the model besides. So it is no more than the residual's level, and no more than 0.2°, or what the
signal itself jumps between samples. What the start angles may explain then stays small where the model
errs by degrees. A joint that is not compared has a sensor like the others', and no more noise than its angle
spreads.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.posterior.noise import channel_noise, prior_weight
from hydroid.problem.free_start import start_slopes
from hydroid.problem.problem import Problem
from hydroid.search.axes import Function


def with_open_start(problem: Problem, theta: Array) -> Problem:
    """Return the problem whose residuals hold for any start angle that its logs leave open.

    The effect of the start angles, and the noise that their priors follow from, are those at theta, (P,). It
    is the same problem where all logs show where they start.
    """
    if not problem.leaves_start_open:
        return problem
    return _opened(problem, tuple(theta.tolist()))


def least_squares_rows(problem: Problem, at: Array, prior_weight: float) -> Function:
    """Return what least squares minimises: candidates, (n, P), to residuals and weighed scores, (n, R + M).

    The start angles are open as at an estimate, shape (P,).
    """
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
    row, objective = free.residuals(theta[None])[0], problem.settings.objective
    if not np.isfinite(row).all():
        return free
    weight, levels = prior_weight(problem.channels, row, objective), dict[int, dict[int, float]]()
    for channel in problem.channels:
        if channel.quantity == "angle":
            level = channel_noise(channel, row[channel.rows], objective).level / channel.weight
            levels.setdefault(channel.log, {})[channel.joint] = level
    deviations = [start_deviations(problem.logs[each.log], each.joints, levels[each.log]) for each in slopes]
    return problem.with_open_starts(
        [each.opened(sd / weight) for each, sd in zip(slopes, deviations, strict=True)]
    )


def start_deviations(log: Log, joints: Sequence[int], levels: Mapping[int, float]) -> Array:
    """Return how well a log shows the start angles of some of its joints [rad], shape (k,).

    `levels` [rad] are those of the compared angles' residuals, by joint.
    """
    noise = {joint: sensor_noise(log, joint, level) for joint, level in levels.items()}
    worst = max(noise.values())
    found = [noise.get(j, min(worst, float(np.std(log.angle[:, j - 1])))) for j in joints]
    samples = np.array([log.start_samples[joint - 1] for joint in joints])
    return np.array(found) / np.sqrt(np.maximum(samples, 1.0))


def sensor_noise(log: Log, joint: int, level: float) -> float:
    """Standard deviation of one reading of a joint's angle [rad], no more than `level`.

    The third difference of white noise has 20 times its variance, and that of a motion is next to nothing.
    """
    jumps = np.diff(log.angle[:, joint - 1], n=3)
    shown = float(np.sqrt(np.mean(jumps**2) / 20)) if len(jumps) else 0.0
    return min(level, max(float(np.radians(0.2)), shown))
