"""A table of unknown columns -> a `log` section that maps them, with a reason for each guess.

The unit of a column, or else the words of its name, tell what it is. The joint of a column is the one whose
name or number its own name holds, or else the next in order.
"""

from collections.abc import Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from hydroid.errors import LogError
from hydroid.log.clues import column_unit, direction, joint_of, kind_of, likely_range, number_in
from hydroid.log.log import Floats
from hydroid.log.table import Signal, Table
from hydroid.units import UNITS, likely_time_unit


class ColumnGuess(NamedTuple):
    """What the columns of a log seem to hold.

    Attributes:
        log: a `log` section of a fit's settings.
        reasons: a line for each column that it uses, and for what is uncertain.
        unused: the other columns.
    """

    log: dict[str, Any]
    reasons: tuple[str, ...]
    unused: tuple[str, ...]


class _Column(NamedTuple):
    name: str
    kind: str
    unit: str
    values: Floats
    clock: bool

    @property
    def why(self) -> str:
        return "by its unit" if self.unit else "by its name"


def guess_columns(table: Table, joints: Sequence[str]) -> ColumnGuess:
    """Guess which columns are time, commands and angles, of which joints, in which units.

        guess = guess_columns(open_table(Path("log.csv")), ["swing", "boom", "stick", "bucket"])

    Args:
        table: an opened log.
        joints: names of the arm's joints, in order.

    Raises:
        LogError: no column looks like a time.
    """
    columns = _columns(table)
    times = [column for column in columns if column.kind == "time"]
    time = max(times, key=lambda column: _rises(column.values), default=None)
    if time is None:
        hint = f"the columns are: {', '.join(name for name in table.names if name)[:500]}"
        raise LogError("has no column that looks like a time", where=table.source, hint=hint)
    step = float(np.nanmedian(np.diff(time.values)))
    unit = "s" if time.clock else time.unit or likely_time_unit(step) or "s"
    step *= UNITS[unit].factor
    said = "dates or times of day" if time.clock else unit
    reasons = [f"{time.name}: time in {said}, {time.why}, every {step:.3g} s"]
    angles, commands = (
        _by_joint([c for c in columns if c.kind == kind], joints, reasons) for kind in ("angle", "command")
    )
    unitless = [np.nanmax(np.abs(column.values)) for column, *_ in angles.values() if column.unit == ""]
    default = "rad" if unitless and max(unitless) <= 6.3 else "deg"
    entries, used = dict[int, dict[str, Any]](), {time.name}
    for joint in sorted({*angles, *commands}):
        entry = entries[joint] = {"command": None, "angle": None}
        name = f"joint {joint}" if joints[joint - 1] == f"joint{joint}" else joints[joint - 1]
        if pair := commands.get(joint):
            entry["command"], said = _command(pair)
            reasons.append(f"{said} of {name}, {pair[0].why}")
        for column in angles.get(joint, []):
            angle_unit = column.unit or default
            entry["angle"] = {"column": column.name, "unit": angle_unit}
            reasons.append(f"{column.name}: angle in {angle_unit} of {name}, {column.why}")
        used |= {column.name for column in (*commands.get(joint, ()), *angles.get(joint, ()))}
    log = {"time": {"column": time.name, "unit": unit}, "command": None, "angle": None}
    periods = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
    log |= {"period_s": min(periods, key=lambda period: abs(np.log(period / step))), "joints": entries}
    return ColumnGuess(log, tuple(reasons), tuple(n for n in table.names if n and n not in used))


def _columns(table: Table) -> list[_Column]:
    """Read all columns whose names or units say that they are times, commands or angles.

    If they cannot be read together, read those that have the most frequent length.
    """
    given = {name: column_unit(name, table.units.get(name, "")) for name in table.names if name}
    kinds = {name: kind for name, unit in given.items() if (kind := kind_of(name, unit)) != "other"}
    units = {name: unit.name if unit else "" for name, unit in given.items()}

    def read(names: Sequence[str]) -> list[_Column]:
        recording = table.read([Signal(n, "command" if kinds[n] == "command" else "angle") for n in names])
        read = zip(names, recording.values.T, strict=True)
        return [_Column(n, kinds[n], units[n], values, n in recording.clocks) for n, values in read]

    columns = list[_Column]()
    try:
        columns = read([*kinds]) if kinds else []
    except LogError:  # text, or different lengths or clocks
        for name in kinds:
            with suppress(LogError):
                columns += read([name])
    lengths = [len(column.values) for column in columns]
    usual = max(lengths, key=lengths.count, default=0)
    return [c for c in columns if len(c.values) == usual and np.isfinite(c.values).any()]


def _rises(values: Floats) -> bool:
    """Return whether a time rises steadily."""
    steps = np.diff(values[np.isfinite(values)])
    return bool(len(steps) and (steps > 0).all() and np.median(steps) > 0.5 * steps.mean())


def _by_joint(
    columns: Sequence[_Column], joints: Sequence[str], reasons: list[str]
) -> dict[int, list[_Column]]:
    """Give each column a joint: one column, or two for the directions; tell what is uncertain."""
    groups, named = dict[Any, list[_Column]](), dict[int, list[_Column]]()
    for column in columns:
        sign, others = direction(column.name)
        groups.setdefault(others if sign and column.kind == "command" else column.name, []).append(column)
    groups = {key: sorted(pair, key=lambda c: -direction(c.name)[0])[:2] for key, pair in groups.items()}
    from_zero = any(number_in(column.name) == 0 for column in columns)
    for pair in groups.values():
        number = number_in(pair[0].name)
        joint = joint_of(pair[0].name, joints) or (None if number is None else number + from_zero)
        if joint and joint <= len(joints):
            named.setdefault(joint, pair)
    if named and from_zero:
        reasons.append("the numbers in the names count from 0: joint 1 is number 0")
    if columns and not named:  # a column without a joint, beside others with one, is something else
        names = ", ".join(column.name for column in columns)
        reasons.append(f"the joints of {names} are given by their order: check them")
        named = dict(enumerate([*groups.values()][: len(joints)], 1))
    return named


def _command(columns: Sequence[_Column]) -> tuple[dict[str, Any], str]:
    """Return the settings of a command, and its name with what its numbers seem to be."""
    names = [column.name for column in columns]
    likely = likely_range(*(np.nan_to_num(column.values) for column in columns))
    entry: dict[str, Any] = {"column": names[0] if len(names) == 1 else names}
    if likely is None or "%" in (columns[0].unit, likely.name):
        return entry, f"{' and '.join(names)}: command in %"
    entry |= {"scale": likely.scale} | ({"offset": likely.offset} if likely.offset else {})
    return entry, f"{' and '.join(names)}: command in {likely.name}"
