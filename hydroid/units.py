"""Units as files, settings and data sheets write them: what each measures, and what one of it is in SI."""

import math
from dataclasses import dataclass

_UNITS = (
    ("time", 1.0, "s sec secs second seconds"),
    ("time", 1e-3, "ms msec"),
    ("time", 1e-6, "us µs"),
    ("time", 1e-9, "ns"),
    ("time", 60.0, "min"),
    ("time", 3600.0, "h"),
    ("time", 86400.0, "day"),
    ("angle", 1.0, "rad"),
    ("angle", math.pi / 180, "deg ° degree degrees"),
    ("pressure", 1.0, "Pa"),
    ("pressure", 1e3, "kPa"),
    ("pressure", 1e5, "bar"),
    ("pressure", 1e6, "MPa"),
    ("command", 1.0, "% pct percent"),
    ("voltage", 1.0, "V volt volts"),
    ("voltage", 1e-3, "mV"),
    ("current", 1e-3, "mA"),
    ("length", 1.0, "m meter metre"),
    ("length", 1e-2, "cm"),
    ("length", 1e-3, "mm"),
    ("area", 1e-6, "mm²"),
    ("volume", 1e-6, "cm³"),
    ("stiffness", 1e3, "N/mm"),
    ("flow", 1e-3 / 60, "l/min"),
    ("other", 1.0, "mbar psi N kN Nm m/s deg/s rad/s °/s rpm °C kg"),
    ("ambiguous", 1.0, "1 - none a amp mrad hz"),
)
"""quantity, factor to SI (of a command to %), spellings; an ambiguous one counts only in a row of units"""


@dataclass(frozen=True)
class Unit:
    """A unit by its usual spelling: what it measures, and what one of it is in SI."""

    name: str
    quantity: str
    factor: float


UNITS = {
    spelling.lower(): Unit(names.split()[0], quantity, factor)
    for quantity, factor, names in _UNITS
    for spelling in names.split()
}
"""by their spelling in lower case"""


def unit_of(text: str) -> Unit | None:
    """Return the unit that a text spells, with or without brackets around it; None where it spells none."""
    return UNITS.get(bare(text).lower())


def bare(text: str) -> str:
    """Return a unit without the brackets around it."""
    return text.strip().strip("[]()<>").strip()


def likely_time_unit(step: float) -> str:
    """Return the unit in which a step between samples is one of 2 to 1000 samples a second; "": in none."""
    units = ("s", "ms", "us", "ns", "min", "day")
    return next((name for name in units if 9e-4 < step * UNITS[name].factor < 0.6), "")


def way(degrees: float, *, slides: bool) -> str:
    """Write how far a joint moves, in m of one that slides."""
    return f"{math.radians(degrees):.3g} m" if slides else f"{degrees:.3g} deg"
