"""How a joint moves in a log: how fast, which way, how long after its command, and above which one."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydroid.log import Direction, Log, direction_of

Floats = NDArray[np.float64]

FAST = 95
"""percentile of the speeds in a log that counts as what its valves let through"""
SMOOTHING_S = 0.1
"""over which a speed is taken"""
LATEST_S = 0.8
"""lags of a joint behind its command that are tried"""
CLEAR = 0.3
"""correlation of command and speed from which on it counts"""
STEP = 5.0
"""width of the ranges of commands in which a joint moves or does not [%]"""
SLOW = 0.1
"""part of its speed below which a joint counts as standing"""
FEWEST = 5
"""samples in such a range"""


@dataclass(frozen=True)
class Motion:
    """What a log says of one joint.

    Attributes:
        speed: at which it moves when it moves [rad/s].
        travel_deg: between its smallest and its largest angle [deg].
        direction: of its travel under strong commands; None: no command, or too little travel.
        correlation: of its speed with its own command, at the lag where that is largest; 0: no command.
        lag: behind its command [s].
        dead_band: command below which it does not move, about [%].
        other: joint, from 1, whose command it follows more than its own, and the correlation; None: none.
    """

    speed: float
    travel_deg: float
    direction: Direction | None = None
    correlation: float = 0.0
    lag: float = 0.0
    dead_band: float = 0.0
    other: tuple[int, float] | None = None

    @property
    def turned(self) -> bool:
        """Whether it moves against its command, as `hydroid check` says it too."""
        return self.direction is not None and self.direction.turned

    def remarks(self, names: Sequence[str], joint: int) -> list[str]:
        """Return what a user should know, for joint [from 1] of those with the given names."""
        name, own = names[joint - 1], f"{self.correlation:.2f}"
        if self.other is not None:
            other = names[self.other[0] - 1]
            return [
                f"{name} follows the command of {other} (correlation {self.other[1]:.2f}) more than its own "
                f"({own}): check which columns belong together"
            ]
        lines: list[str] = []
        if self.turned:
            assert self.direction is not None
            share = f"for {self.direction.against:.0%} of {self.direction.travel:.3g} deg of travel"
            lines.append(f"{name} moves against its command ({share}): the sign of the command is reversed")
        if self.dead_band > 2 * STEP:
            lines.append(f"{name} does not move below about {self.dead_band:g} % of command: a dead band")
        return lines


def find_motion(log: Log, joint: int) -> Motion:
    """Return how a measured joint, numbered from 1, moves."""
    apart = max(round(SMOOTHING_S / log.period), 1)
    angle = log.angle[:, joint - 1]
    travel = float(np.degrees(np.ptp(angle)))
    if len(angle) <= 2 * apart:
        return Motion(0.0, travel)
    moved = angle[apart:] - angle[:-apart]
    speed = float(np.percentile(np.abs(moved), FAST)) / (apart * log.period)
    if not log.driven[joint - 1]:
        return Motion(speed, travel)
    found = {int(other): _follows(log, int(other), moved) for other in np.flatnonzero(log.driven) + 1}
    correlation, late = found[joint]
    most = max(found, key=lambda other: abs(found[other][0]))
    unlike = abs(found[most][0]) > abs(correlation) + CLEAR
    dead = _dead_band(log.command[: len(moved) - late, joint - 1], moved[late:])
    lag = (late + apart / 2) * log.period
    direction, other = direction_of(log, joint), (most, found[most][0]) if unlike else None
    return Motion(speed, travel, direction, correlation, lag, dead, other)


def _follows(log: Log, joint: int, moved: Floats) -> tuple[float, int]:
    """Largest correlation of a motion with a joint's command over all lags, and its lag [samples]."""
    command = log.command[:, joint - 1]
    lags = range(max(min(round(LATEST_S / log.period), len(moved) // 2), 1))
    tried = [(_correlation(command[: len(moved) - lag], moved[lag:]), lag) for lag in lags]
    return max(tried, key=lambda pair: abs(pair[0]))


def _correlation(a: Floats, b: Floats) -> float:
    scale = float(np.std(a) * np.std(b))
    return float(np.mean((a - a.mean()) * (b - b.mean()))) / scale if scale > 0 else 0.0


def _dead_band(command: Floats, moved: Floats) -> float:
    """Command [%] up to which the joint stands, most of the time."""
    slow, size, dead = SLOW * np.percentile(np.abs(moved), FAST), np.abs(command), 0.0
    for low in np.arange(0.0, 100.0, STEP):
        there = np.abs(moved[(size >= low) & (size < low + STEP)])
        if len(there) >= FEWEST:
            if np.median(there) > slow:
                break
            dead = low + STEP
    return float(dead)
