"""The speed of a joint against its command, as its logs show it.

A delay, and one speed for each command that never falls with it: isotonic regression of
the speeds on the delayed commands (R. E. Barlow, D. J. Bartholomew, J. M. Bremner and
H. D. Brunk, 1972), by the delay at which it errs least. It assumes no law, so it shows
what a law of few numbers cannot be: dead bands of unlike sides, a valve that opens all
at once.

Speeds count less while the command changes, when they follow it late, and not at all
near the ends of a joint's travel: there it may stand at a stop, or its sensor at the
end of its range.
"""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import isotonic_regression

from hydroid.arrays import Array, Limits, Mask, record
from hydroid.log import Log, one_size
from hydroid.log.command_sizes import LEAST_COMMAND

LONGEST_SEEN_DELAY = 0.8
"""between a command and its motion [s]"""
WINDOW = 0.15
"""over which a speed is measured, at least a sample to each side [s]"""
SETTLING = 0.25
"""for so long before a speed its command counts, too [s]"""
STEADY = 10.0
"""change of the command in that time at which a speed counts half [%]"""
END = 0.02
"""part of a joint's travel at each end of it where speeds do not count"""
REACHED = 0.97
"""part of a side's samples below the speed that it reaches"""
ALIKE = 1.0
"""commands that differ by less are one [%]"""
LEAST_SAMPLES = 10  # that show a curve


@record
class SpeedCurve:
    """What a joint's logs show of its speed.

    Attributes:
        delay: at which the speed follows the command best, the lags included [s].
        command: those of the logs, ascending, ALIKE apart, below 0 for the negative
            side [%], shape (n,).
        speed: of each in the direction in which positive commands move the joint, never
            falling [rad/s], shape (n,); 0 at a command of 0.
        weight: how many samples each stands for, shape (n,).
        direction: 1 where a positive command moves the joint to larger angles, else -1.
    """

    delay: float
    command: Array
    speed: Array
    weight: Array
    direction: float

    def side(self, sign: int) -> "SpeedCurve":
        """Return the side of positive (1) or negative (-1) commands, both command and
        speed above 0."""
        own = sign * self.command >= LEAST_COMMAND
        command = sign * self.command[own]
        speed = np.maximum(sign * self.speed[own], 0.0)
        order = np.argsort(command, kind="stable")
        return SpeedCurve(
            self.delay,
            command[order],
            speed[order],
            self.weight[own][order],
            sign * self.direction,
        )

    @property
    def top(self) -> float:
        """Speed that a side reaches, but for a few samples, which may be wrong
        [rad/s]."""
        reached = np.cumsum(self.weight) / self.weight.sum()
        return float(np.interp(REACHED, reached, self.speed))

    @property
    def one_size(self) -> bool:
        """Whether a side has commands of one size only, as a valve has that is open or
        shut."""
        return one_size(self.command, self.weight)


def measured_speeds(logs: Sequence[Log], joint: int) -> SpeedCurve | None:
    """Return the speeds of a joint (number, from 1) in the logs that drive and measure
    it.

    None where there are none.
    """
    own = [log for log in logs if log.drives(joint) and log.measures(joint)]
    if not own:
        return None
    angles = np.concatenate([log.angle_of(joint) for log in own])
    reach = (float(angles.min()), float(angles.max()))
    period = min(log.period for log in own)
    # a finer delay than a sample makes no difference to the pairs
    delays = np.arange(0.0, LONGEST_SEEN_DELAY, period).tolist()
    # which delay is right is seen where commands change, and how fast it moves where
    # they do not
    left = list[tuple[float, float]]()
    for delay in delays:
        result = _isotonic(own, joint, reach, delay, steady=False)
        if result is not None:
            left.append((result[0], delay))
    if not left:
        return None
    # of delays that leave the same the shortest
    _, likely = min(left)
    result = _isotonic(own, joint, reach, likely, steady=True)
    if result:
        return result[1]
    return None


def _isotonic(
    logs: Sequence[Log],
    joint: int,
    reach: Limits,
    delay: float,
    *,
    steady: bool,
) -> tuple[float, SpeedCurve] | None:
    """Return the curve of a delay [s], and the mean square that it leaves, as a part of
    the speeds'.

    `steady`: whether speeds count less while the command changes.
    """
    # one curve for all logs: a valve is the same in each
    pairs = [_pairs(log, joint, reach, delay) for log in logs]
    command, speed, weight = np.hstack(pairs)
    if len(command) < LEAST_SAMPLES:
        return None
    commands_differ = np.ptp(command) > LEAST_COMMAND
    if not commands_differ or not speed.any():
        return None
    if not steady:
        weight = np.ones(len(command))
    together = np.average(command * speed, weights=weight)
    direction = -1.0
    if together >= 0.0:
        direction = 1.0
    # commands that are alike have one speed: sorted by chance, they would seem to rise
    # with each other
    number = np.unique(np.round(command / ALIKE), return_inverse=True)[1]
    total: Array = np.bincount(number, weight).astype(float)
    asked = np.bincount(number, weight * command) / total
    mean = np.bincount(number, weight * direction * speed) / total
    # a valve that opens farther never makes a joint slower: of all such curves the
    # nearest, without a law of the opening
    fitted = isotonic_regression(mean, weights=total).x
    # a drift at rest, such as a sensor's, is no speed of the valve: the curve has one
    # sign at each side
    fitted = np.where(asked > 0.0, np.maximum(fitted, 0.0), np.minimum(fitted, 0.0))
    error = direction * speed - fitted[number]
    left = np.average(error**2, weights=weight)
    whole = np.average(speed**2, weights=weight)
    curve = SpeedCurve(delay, asked, fitted, total, direction)
    return float(left / whole), curve


def _pairs(log: Log, joint: int, reach: Limits, delay: float) -> Array:
    """Return commands [%], the speeds that follow them [rad/s], and their weights,
    shape (3, n)."""
    command = log.command_of(joint)
    angle = log.angle_of(joint)
    half = max(round(0.5 * WINDOW / log.period), 1)
    lag = round(delay / log.period)
    settling = round(SETTLING / log.period)
    first = max(half, lag + settling)
    at = np.arange(first, len(angle) - half)
    if len(at) == 0:
        return np.empty((3, 0))
    way = angle[at + half] - angle[at - half]
    speed = way / (2 * half * log.period)
    asked = command[at - lag]
    recent = [command[at - lag - shift] for shift in range(settling + 1)]
    changed = np.ptp(np.stack(recent), axis=0) / STEADY
    weight = 1.0 / (1.0 + changed * changed)
    there = inside(angle, reach)[at]
    return np.stack([asked, speed, weight])[:, there]


def inside(angle: Array, reach: Limits) -> Mask:
    """Return which samples are not near the ends of a joint's travel in all logs,
    (T,)."""
    low, high = reach
    margin = END * (high - low)
    return (angle > low + margin) & (angle < high - margin)
