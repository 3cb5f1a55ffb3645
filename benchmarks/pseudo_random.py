"""Pseudo-random commands for the studies: random levels and dwells, as in the article's figure 17."""

import numpy as np

from hydroid.log import Log


def pseudo_random_log(
    pose: np.ndarray,
    joints: list[int],
    duration: float = 75.0,
    period: float = 0.01,
    seed: int = 0,
    reach: float = np.inf,
) -> Log:
    """Make a log of commands without motion: `joints` (1-based) driven, every joint at `pose` [rad].

    A level that would take the sum of commands beyond ±`reach` [% s] is turned round: a hydraulic joint moves
    at a speed, and an operator keeps it off its stops.
    """
    rng = np.random.default_rng(seed)
    samples = round(duration / period)
    command = np.zeros((samples, len(pose)))
    for joint in joints:
        start, total = 0, 0.0
        while start < samples:
            dwell = round(rng.uniform(1.0, 5.0) / period)
            level = round(rng.uniform(-100.0, 100.0), 1)
            if abs(total + level * dwell * period) > reach:
                level = -np.sign(total) * abs(level)
            command[start : start + dwell, joint - 1] = level
            total += level * dwell * period
            start += dwell
    angle = np.tile(pose, (samples, 1))
    return Log("pseudo-random", np.arange(samples) * period, command, angle, period)
