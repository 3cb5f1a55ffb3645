"""Cylinders whose lengths a log holds: angles of the joints that they turn, by the
triangle of their pins."""

from collections.abc import Mapping

import numpy as np

from hydroid.arrays import Array, Limits, record
from hydroid.settings.arm import Arm
from hydroid.settings.cylinder import LinearActuator
from hydroid.units import UNITS

POINTS = 2001
"""of a table of lengths over a joint's range"""
STEPS = 3
"""of Newton's method from there"""
MARGIN = 0.02
"""part of the stroke by which lengths may lie outside: drawings and sensors err"""


@record
class Rod:
    """A cylinder that turns a joint from a lower to an upper angle [rad], `limits`."""

    cylinder: LinearActuator
    limits: Limits

    @property
    def ends(self) -> Limits:
        """Its length from pin to pin with the rod in and out [m]."""
        lengths = self.cylinder.length(np.array(self.limits))
        return float(lengths.min()), float(lengths.max())

    @property
    def margin(self) -> float:
        """How far a length may lie outside [m]."""
        shortest, longest = self.ends
        return MARGIN * (longest - shortest)

    def reading(self, cells: Array, unit: str) -> tuple[str, float] | None:
        """Return the unit of cells, (R,), which are its lengths or its rod's travel,
        and the offset in it.

        `unit`: the one that the file states; empty: none. None: they are neither.
        """
        shortest, longest = self.ends
        finite = cells[np.isfinite(cells)]
        candidates = [unit] if unit else ["mm", "cm", "m"]
        most = -np.inf
        reading = None
        for name in candidates:
            factor = UNITS[name].factor
            low = factor * finite.min()
            high = factor * finite.max()
            for offset in (0.0, shortest):
                if low + offset < shortest - self.margin:
                    continue
                if high + offset > longest + self.margin:
                    continue
                # of several that fit, the one in which the rod moves farthest
                if high - low > most:
                    most = high - low
                    reading = name, float(f"{offset / factor:.9g}")
        return reading

    def nearest_unit(self, cells: Array) -> str:
        """Return the unit in which cells, (R,), are most like the cylinder's mean
        length."""
        middle = sum(self.ends) / 2
        size = max(abs(float(np.nanmedian(cells))), 1e-9)
        return min(
            ("mm", "cm", "m"),
            key=lambda name: abs(np.log(UNITS[name].factor * size / middle)),
        )

    def angle(self, length: Array) -> Array:
        """Return the joint's angle [rad] at lengths [m], (R,); those outside count as
        the nearest end.

        The length rises or falls throughout the range, or the arm would be refused.
        """
        grid = np.linspace(*self.limits, POINTS)
        table = self.cylinder.length(grid)
        if table[0] > table[-1]:
            grid = grid[::-1]
            table = table[::-1]
        within = np.clip(length, table[0], table[-1])
        angle = np.interp(within, table, grid)
        for _ in range(STEPS):
            error = self.cylinder.length(angle) - within
            # the moment arm is the length's derivative by the angle
            angle = angle - error / self.cylinder.moment_arm(angle)
        return angle


def rods_of(arm: Arm) -> Mapping[int, Rod]:
    """Return the cylinders of an arm that turn joints, by the joints' numbers (from
    1)."""
    rods = dict[int, Rod]()
    for number, joint in enumerate(arm.joints, 1):
        if isinstance(joint.actuator, LinearActuator) and not joint.slides:
            rods[number] = Rod(joint.actuator, joint.limits)
    return rods
