"""Pseudo-random commands for studies: random levels and dwells, as in the article's figure 17."""

from collections.abc import Callable

import numpy as np

from hydroid.log import Log


def pseudo_random_log(
    pose: np.ndarray,
    joints: list[int],
    duration: float = 75.0,
    period: float = 0.01,
    seed: int = 0,
    allowed: Callable[[Log], bool] = lambda log: True,
) -> Log:
    """Make a log of commands without motion: `joints` (1-based) driven, every joint at `pose` [rad].

    A level after which `allowed` is false of the log so far is turned round or reduced, as by an operator who
    keeps the arm off its stops.
    """
    rng = np.random.default_rng(seed)
    samples = round(duration / period)
    command = np.zeros((samples, len(pose)))

    def upto(end: int) -> Log:
        angle = np.tile(pose, (end, 1))
        return Log("pseudo-random", np.arange(end, dtype=float) * period, command[:end], angle, period)

    for joint in joints:
        start = 0
        while start < samples:
            dwell = round(rng.uniform(1.0, 5.0) / period)
            level = rng.uniform(-100.0, 100.0)
            for factor in (1.0, -1.0, 0.5, -0.5, 0.25, -0.25, 0.0):
                command[start : start + dwell, joint - 1] = round(factor * level, 1)
                if allowed(upto(min(start + dwell, samples))):
                    break
            start += dwell
    return upto(samples)
