"""Test movements: one joint at rest, its command stepped and held.

Speeds are in the direction of the command. Events between two samples are interpolated, so that everything
is smooth in the parameters, and differences give its derivatives.
"""

from dataclasses import dataclass, replace

import numpy as np

from hydroid.parameters import Array
from hydroid.quantities.joint import TestedJoint
from hydroid.simulation import Candidates

DURATION = 1.2
"""of a test movement at most [s]"""
WINDOW = 0.1
"""at its end, over which the speed is measured [s]"""


@dataclass(frozen=True, eq=False)
class Movement:
    """A step of the command [%] from an angle [rad], held for some samples."""

    tested: TestedJoint
    command: float
    start: float
    samples: int

    def speeds(self, candidates: Candidates) -> Array:
        """Return the speeds between samples [deg/s], shape (n, samples)."""
        angle = self.tested.drive(candidates, self.command, self.start, self.samples)
        return self._sign * np.degrees(np.diff(angle, axis=1)) / self.tested.period

    def final(self, speeds: Array) -> Array:
        """Return the mean speed at the end, shape (n,), from the speeds between samples."""
        return speeds[:, -max(round(WINDOW / self.tested.period), 1) :].mean(axis=1)

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
        return np.where(over.any(axis=1), (k + 0.5 - width * (1.0 - part)) * self.tested.period, np.nan)

    def through_pose(self, estimate: Candidates) -> "Movement":
        """Return the movement whose end one candidate passes at the joint's angle."""
        away = np.cumsum(self.speeds(estimate)[0]) * self._sign * np.radians(self.tested.period)
        if not np.isfinite(away).all():
            return self
        fits = np.abs(away) <= np.where(away > 0, self.tested.room(-1.0), self.tested.room(1.0))
        last = self.samples if fits.all() else max(int(np.argmin(fits)), 2)
        return replace(self, start=self.start - float(away[last - 1]), samples=last)

    @property
    def _sign(self) -> float:
        return -1.0 if self.command < 0 else 1.0


def movement(tested: TestedJoint, command: float) -> Movement:
    """Return the movement from the joint's angle."""
    return Movement(tested, command, tested.angle, max(round(DURATION / tested.period), 2))
