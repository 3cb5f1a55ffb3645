"""What the columns of a log could be, told by their numbers alone:
for a person who knows the machine."""

from collections.abc import Iterator

import numpy as np

from hydroid.arrays import Array
from hydroid.errors import LogError
from hydroid.log import Table
from hydroid.log.angle_columns import LARGEST_RADIANS
from hydroid.log.clues import column_unit
from hydroid.log.likely_units import LARGEST_ANGLE, LARGEST_METRES
from hydroid.log.signals import likely_range
from hydroid.log.table import Signal
from hydroid.units import likely_time_unit

MOST = 60  # columns that are listed


def column_lines(table: Table) -> tuple[str, ...]:
    """Return a line for each column: its name, its smallest and largest value,
    and what it could be."""
    names = [name for name in dict.fromkeys(table.names) if name]
    lines = list[str]()
    for name in names[:MOST]:
        shown = name
        if not name.isprintable():
            shown = ascii(name)[1:-1]
        lines.append(f"{shown}: {_described(table, name)}")
    if len(names) > MOST:
        lines.append(f"and {len(names) - MOST} more columns")
    return tuple(lines)


def holds_measurements(table: Table) -> bool:
    """Return whether two columns or more hold numbers: a time and what was measured."""
    named = {*table.names} - {""}
    of_numbers = sum(_numbers(table, name) is not None for name in named)
    return of_numbers >= 2


def _described(table: Table, name: str) -> str:
    values = _numbers(table, name)
    if values is None:
        return "no numbers"
    low = values.min()
    high = values.max()
    if low == high:
        return f"{low:g} throughout"
    unit = column_unit(name, table.units.get(name, ""))
    stated = f", in {unit.name}" if unit else ""
    choices = " or ".join(_choices(values, unit.name if unit else ""))
    return f"{low:.4g} to {high:.4g}{stated}; {choices or 'neither command nor angle'}"


def _choices(values: Array, unit: str) -> Iterator[str]:
    """Yield what numbers could be, by their range, their steps and the unit that is
    stated."""
    steps = np.diff(values)
    if len(steps) and (steps > 0).all():
        yield f"a time in {likely_time_unit(float(np.median(steps))) or 's'}"
    likely = likely_range(values, unit=unit)
    if likely and likely.name == "%":
        yield "a command in %"
    elif likely:
        offset = ""
        if likely.offset:
            offset = f", offset: {likely.offset:.4g}"
        yield f"a command in {likely.name} (scale: {likely.scale:.4g}{offset})"
    most = np.abs(values).max()
    if most <= LARGEST_RADIANS:
        yield "an angle in rad"
    if np.radians(most) <= LARGEST_ANGLE:
        yield "an angle in deg"
    if most <= LARGEST_METRES:
        yield "a position in m"


def _numbers(table: Table, name: str) -> Array | None:
    """Return the numbers of a column, (n,); None: it has none."""
    try:
        values = table.read([Signal(name, "command")]).time
    except (LogError, KeyError):
        return None
    values = values[np.isfinite(values)]
    return values if len(values) else None
