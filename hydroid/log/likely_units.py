"""The unit in which an angle or a position is rather than in that of the settings."""

from collections.abc import Iterator

import numpy as np

from hydroid.arrays import Array
from hydroid.log.table import Signal
from hydroid.units import UNITS, Unit, units_of

LARGEST_ANGLE = np.radians(400.0)
"""of an arm's joint [rad]; larger numbers are lengths or counts"""
LARGEST_METRES = 50.0
"""of a position, for no telescope is longer"""
FARTHEST = {"angle": LARGEST_ANGLE, "length": LARGEST_METRES}
"""what no joint reaches, by what is measured"""


def likely_unit(
    signal: Signal, values: Array, stated: Unit | None = None
) -> Unit | None:
    """Return the unit in which the values of a signal, (R,), are all within its limits;
    None: there is none.

    Of several it is the `stated` one, else the largest. One that is smaller than that
    of the settings is unlikely unless no joint reaches what is read.
    """
    fitting = [*_fitting_units(signal, values)]
    if stated in fitting:
        return stated
    given = signal.setting_unit
    is_far = np.nanmax(np.abs(values)) > FARTHEST.get(given.quantity, np.inf)
    for unit in fitting:
        if is_far or unit.factor > given.factor:
            return unit
    return None


def larger_unit(signal: Signal, values: Array) -> Unit | None:
    """Return the largest unit in which the values of a signal, (R,), are all within its
    limits, if that of the settings is smaller."""
    largest = next(_fitting_units(signal, values), None)
    if largest and largest.factor > signal.setting_unit.factor:
        return largest
    return None


def _fitting_units(signal: Signal, values: Array) -> Iterator[Unit]:
    """Yield the other units in which values are within the limits, the largest first."""
    given = signal.setting_unit
    # the length of a cylinder stands for an angle: no factor brings one to the other
    if signal.rod is not None:
        return
    units = [UNITS[name.lower()] for name in units_of(given.quantity)]
    for unit in sorted(units, key=lambda unit: unit.factor, reverse=True):
        in_unit = values / given.factor * unit.factor
        if unit.factor != given.factor and is_within(signal, in_unit):
            yield unit


def is_within(signal: Signal, values: Array) -> bool:
    """Return whether values, (R,), NaN where there is none, are in a signal's
    limits."""
    low = np.nanmin(values)
    high = np.nanmax(values)
    return bool(low >= signal.low and high <= signal.high)
