"""Units as files, settings and data sheets write them: what each measures,
and what one of it is in SI."""

import math
import re
from typing import NamedTuple

import numpy as np

from hydroid.files import read_table


class Unit(NamedTuple):
    """A unit by its usual spelling: what it measures, and what one of it is in SI."""

    name: str
    quantity: str
    factor: float


def _units() -> dict[str, Unit]:
    """Return the rows of `units.yaml`, by each spelling in lower case."""
    units = dict[str, Unit]()
    for quantity, rows in read_table("units.yaml").items():
        for names, factor in rows.items():
            spellings = names.split()
            for spelling in spellings:
                units[spelling.lower()] = Unit(spellings[0], quantity, factor)
    return units


class Display(NamedTuple):
    """How it is written where a joint is: every unit of an angle, or of the position of
    a joint that slides, is decided here."""

    word: str
    unit: str
    """which a reader is shown"""
    mark: str
    """the unit behind a number, where there is little room"""
    factor: float
    """what 1 rad, or 1 m of a joint that slides, is in the unit"""
    si: str
    setting: str
    """unit of its range, and of what a log's settings say without another"""

    def of_degrees(self, value: float) -> float:
        """Return, in the unit, what files keep in degrees; of a joint that slides they
        keep 1 m as if it were 1 rad."""
        if self is TURNING:
            return value
        return self.factor * math.radians(value)

    def rounded(self, value: float) -> float:
        """Return an angle [rad], or a position [m], that is whole in the unit."""
        if self is TURNING:
            return float(np.radians(np.round(np.degrees(value))))
        return float(np.round(self.factor * value) / self.factor)

    def in_setting(self, value: float) -> float:
        """Return an angle [rad], or a position [m], in the unit of settings."""
        if self is TURNING:
            return math.degrees(value)
        return value

    def way(self, degrees: float) -> str:
        """Write how far the joint moves, in the unit of settings."""
        value = degrees
        if self is not TURNING:
            value = math.radians(degrees)
        return f"{value:.3g} {self.setting}"


TURNING = Display("angle", "deg", "°", math.degrees(1.0), "rad", "deg")
SLIDING = Display("position", "mm", " mm", 1e3, "m", "m")


def display(*, slides: bool) -> Display:
    """Return how a joint that turns, or one that `slides`, is shown."""
    return SLIDING if slides else TURNING


UNITS = _units()
"""by their spelling in lower case"""


NO_UNIT = Unit("", "", 1.0)
"""of a number that has none"""


def units_of(quantity: str) -> tuple[str, ...]:
    """Return the units of what is measured by their usual spellings, in the order of
    `units.yaml`."""
    names = [unit.name for unit in UNITS.values() if unit.quantity == quantity]
    return tuple(dict.fromkeys(names))


def unit_of(text: str) -> Unit | None:
    """Return the unit that a text spells, with or without brackets around it;
    None where it spells none."""
    return UNITS.get(bare(text).lower())


def seconds(text: str) -> float | None:
    """Return the time that a text such as 5min says [s]; None where it says none."""
    parts = re.fullmatch(r"\s*(\d+\.?\d*)\s*(\w+)\s*", text)
    if parts is None:
        return None
    unit = unit_of(parts[2])
    if unit is None or unit.quantity != "time":
        return None
    return float(parts[1]) * unit.factor


def bare(text: str) -> str:
    """Return a unit without the brackets around it."""
    return text.strip().strip("[]()<>").strip()


def is_usual_step(seconds: float) -> bool:
    """Return whether a step between samples is one of 2 to 1000 samples a second."""
    return 9e-4 < seconds < 0.6


def likely_time_unit(step: float) -> str:
    """Return the unit in which a step between samples is a usual one; "": in none."""
    for name in ("s", "ms", "us", "ns", "min", "day"):
        if is_usual_step(step * UNITS[name].factor):
            return name
    return ""
