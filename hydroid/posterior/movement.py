"""Test movements: one joint at rest, its command stepped and held.

Speeds are in the direction of the command. Events between two samples are interpolated, so that everything
is smooth in the parameters, and differences give its derivatives.
"""

from dataclasses import dataclass, replace

import numpy as np

from hydroid.parameters import Array
from hydroid.posterior.bench import Bench
from hydroid.simulation import Candidates

DURATION = 1.2
"""of a test movement at most [s]"""
WINDOW = 0.1
"""at its end, over which the speed is measured [s]"""
ROUNDS = 3
"""corrections of the angle from which a movement starts; each leaves a tenth of the error or less"""


@dataclass(frozen=True, eq=False)
class Movement:
    """A step of the command [%] from an angle [rad], held for some samples."""

    bench: Bench
    command: float
    start: float
    samples: int

    def speeds(self, candidates: Candidates) -> Array:
        """Return the speeds between samples [deg/s], shape (n, samples)."""
        angle = self.bench.drive(candidates, self.command, self.start, self.samples)
        return self._sign * np.degrees(np.diff(angle, axis=1)) / self.bench.period

    def final(self, speeds: Array) -> Array:
        """Return the mean speed at the end, shape (n,), from the speeds between samples."""
        return speeds[:, -self._window :].mean(axis=1)

    def speed(self, candidates: Candidates) -> Array:
        """Return the mean speed at the end [deg/s], shape (n,)."""
        return self.final(self.speeds(candidates))

    def reaches(self, speeds: Array, level: Array) -> Array:
        """Return when speeds, shape (n, samples), first reach a level, shape (n,) [s]; NaN where never."""
        over = speeds >= level[:, None]
        k, row = np.argmax(over, axis=1), np.arange(len(speeds))
        before = np.where(k > 0, speeds[row, k - 1], 0.0)  # the joint starts at rest
        width = np.where(k > 0, 1.0, 0.5)  # and the first speed is that of half a sample
        with np.errstate(divide="ignore", invalid="ignore"):
            part = (level - before) / (speeds[row, k] - before)
        return np.where(over.any(axis=1), (k + 0.5 - width * (1.0 - part)) * self.bench.period, np.nan)

    def through_pose(self, estimate: Candidates) -> "Movement":
        """Return the movement in which one candidate passes the joint's angle in the middle of the window.

        It starts as long before as this one lasts, or at the joint's stop and is shorter.
        """
        half, angle, move = self._window // 2, self.bench.angle, self
        for _ in range(ROUNDS):
            turned = self.bench.drive(estimate, self.command, move.start, self.samples)[0]
            if not np.isfinite(turned).all():
                return self
            start = move.start + angle - float(turned[self.samples - half])
            move = replace(self, start=float(np.clip(start, *self.bench.reach)))
        turned = self.bench.drive(estimate, self.command, move.start, self.samples)[0]
        passed = self._sign * (turned - angle) >= 0
        last = int(np.argmax(passed)) + half if passed.any() else self.samples
        return replace(move, samples=min(max(last, self._window + 1), self.samples))

    @property
    def _window(self) -> int:
        return max(round(WINDOW / self.bench.period), 1)

    @property
    def _sign(self) -> float:
        """Direction in which the command turns the joint."""
        return -self.bench.sense if self.command < 0 else self.bench.sense


def movement(bench: Bench, command: float) -> Movement:
    """Return the movement from the joint's angle."""
    return Movement(bench, command, bench.angle, max(round(DURATION / bench.period), 2))
