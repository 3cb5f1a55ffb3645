"""A table of unknown columns -> a `log` section that maps them, with a reason for each guess.

Names and units are believed first. Where they say nothing the numbers decide: a time increases steadily, a
command jumps or keeps its value, an angle changes smoothly. The joint of a column is the one whose name or
number its own name holds, or else the next in order.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hydroid.errors import LogError
from hydroid.log.log import Floats
from hydroid.log.names import Kind, column_unit, direction, joint_of, kind_of, number_in
from hydroid.log.ranges import likely_pair, likely_range
from hydroid.log.table import Table
from hydroid.units import UNITS, likely_time_unit

PERIODS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
"""sample periods that are proposed [s]"""
JUMP = 0.2  # largest step of a smooth signal, as a part of its range
STILL = 0.5  # part of the samples in which a command keeps its value
RADIANS = 6.3  # largest angle in a log in rad
STEADY = 0.5  # least ratio of the median and the mean step of a time


@dataclass(frozen=True)
class ColumnGuess:
    """What the columns of a log seem to hold.

    Attributes:
        log: a `log` section of a fit's settings.
        reasons: a line for each column that it uses, and for what is uncertain.
        unused: the other columns.
    """

    log: dict[str, Any]
    reasons: tuple[str, ...]
    unused: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Column:
    name: str
    kind: Kind
    unit: str
    values: Floats
    why: str
    clock: bool

    @property
    def steps(self) -> Floats:
        return np.diff(self.values[np.isfinite(self.values)])


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
    time = _time(table, columns)
    step = float(np.nanmedian(np.diff(time.values)))
    unit = "s" if time.clock else time.unit if time.unit in UNITS else likely_time_unit(step) or "s"
    step *= UNITS[unit].factor
    said = "dates or times of day" if time.clock else unit
    reasons = [f"{time.name}: time in {said}, {time.why}, every {step:.3g} s"]
    others = [column for column in columns if column is not time]
    angles, commands = (
        _by_joint([c for c in others if c.kind == k], joints, reasons) for k in ("angle", "command")
    )
    unitless = [np.nanmax(np.abs(column.values)) for column, *_ in angles.values() if column.unit == ""]
    default = "rad" if unitless and max(unitless) <= RADIANS else "deg"
    entries = dict[int, dict[str, Any]]()
    for joint in sorted({*angles, *commands}):
        entries[joint] = {"command": None, "angle": None}
        name = "" if joints[joint - 1] == f"joint{joint}" else f" ({joints[joint - 1]})"
        if joint in commands:
            entries[joint]["command"], said = _command(commands[joint])
            reasons.append(f"{said} of joint {joint}{name}, {commands[joint][0].why}")
        if joint in angles:
            (column, *_) = angles[joint]
            angle_unit = column.unit if column.unit == "rad" else default if column.unit == "" else "deg"
            entries[joint]["angle"] = {"column": column.name, "unit": angle_unit}
            reasons.append(f"{column.name}: angle in {angle_unit} of joint {joint}{name}, {column.why}")
    used = {time.name, *(c.name for group in (*angles.values(), *commands.values()) for c in group)}
    log = {"time": {"column": time.name, "unit": unit}, "command": None, "angle": None}
    log |= {"period_s": min(PERIODS, key=lambda period: abs(np.log(period / step))), "joints": entries}
    return ColumnGuess(log, tuple(reasons), tuple(n for n in table.names if n and n not in used))


def _columns(table: Table) -> list[_Column]:
    """Read every column of numbers, those of the usual length."""
    names = list(dict.fromkeys(name for name in table.names if name))
    units = {name: column_unit(name, table.units.get(name, "")) for name in names}
    kinds: dict[str, Kind] = {name: kind_of(name, units[name]) for name in names}
    read, clocks = dict[str, Floats](), set[str]()
    for group in (names, [name for name in names if kinds[name] != "other"], *([name] for name in names)):
        try:
            cells = table.read(group, {name for name in names if kinds[name] == "command"})
        except LogError:
            continue  # text, or different lengths or clocks
        read |= dict(zip(group, cells.values.T, strict=True))
        clocks |= cells.clocks
        if len(group) > 1:
            break
    lengths = [len(values) for values in read.values()]
    usual = max(set(lengths), key=lengths.count, default=0)
    columns = list[_Column]()
    for name, values in read.items():
        if len(values) == usual and np.isfinite(values).any():
            unit = units[name]
            kind = kinds[name]
            why = "by its unit" if unit else "by its name"
            if kind == "" and np.ptp(values[np.isfinite(values)]) > 0:
                kind, why = _kind_by_motion(values), "by how its numbers change"
            columns.append(_Column(name, kind, unit.name if unit else "", values, why, name in clocks))
    return columns


def _kind_by_motion(values: Floats) -> Kind:
    values = values[np.isfinite(values)]
    steps = np.abs(np.diff(values))
    return "command" if steps.max() > JUMP * np.ptp(values) or (steps == 0).mean() > STILL else "angle"


def _time(table: Table, columns: Sequence[_Column]) -> _Column:
    """Return the first column that is named a time and rises steadily, or else is or does one of both."""
    rising = [
        column
        for column in columns
        if len(steps := column.steps) and (steps > 0).all() and np.median(steps) > STEADY * steps.mean()
    ]
    named = [column for column in columns if column.kind == "time"]
    for choice in ([column for column in rising if column in named], named, rising):
        if choice:
            return choice[0]
    hint = f"the columns are: {', '.join(name for name in table.names if name)[:500]}"
    raise LogError("has no column that looks like a time", where=table.source, hint=hint)


def _by_joint(
    columns: Sequence[_Column], joints: Sequence[str], reasons: list[str]
) -> dict[int, list[_Column]]:
    """Give each column a joint: one column, or two for the directions; tell what is uncertain."""
    groups: dict[int, list[_Column]] = {}
    numbers = {column.name: number_in(column.name) for column in columns}
    from_zero = 0 in numbers.values()
    for column in columns:
        number = numbers[column.name]
        joint = joint_of(column.name, joints) or (None if number is None else number + from_zero)
        if joint and joint <= len(joints) and (joint not in groups or _are_pair([*groups[joint], column])):
            groups.setdefault(joint, []).append(column)
    if groups and from_zero:
        reasons.append("the numbers in the names count from 0: joint 1 is number 0")
    if columns and not groups:  # a column without a joint, beside others with one, is something else
        pairs = list[list[_Column]]()
        for column in columns:
            mate = next((pair for pair in pairs if _are_pair([*pair, column])), None)
            pairs.append([column]) if mate is None else mate.append(column)
        names = ", ".join(column.name for column in columns)
        reasons.append(f"the joints of {names} are given by their order: check them")
        groups = dict(enumerate(pairs[: len(joints)], 1))
    return {joint: sorted(pair, key=lambda c: -direction(c.name)[0]) for joint, pair in groups.items()}


def _are_pair(columns: Sequence[_Column]) -> bool:
    """Return whether two columns are the directions of one command."""
    if len(columns) != 2 or any(column.kind != "command" for column in columns):
        return False
    (one, mine), (two, other) = (direction(column.name) for column in columns)
    return one * two == -1 and mine == other


def _command(columns: Sequence[_Column]) -> tuple[dict[str, Any], str]:
    """Return the settings of a command, and its name with what its numbers seem to be."""
    names = [column.name for column in columns]
    parts = [np.nan_to_num(column.values) for column in columns]
    likely = likely_range(*parts) if len(parts) == 1 else likely_pair(*parts)
    entry: dict[str, Any] = {"column": names[0] if len(names) == 1 else names}
    if likely is None or columns[0].unit == "%" or likely.name == "%":
        return entry, f"{' and '.join(names)}: command in %"
    entry |= {"scale": likely.scale} | ({"offset": likely.offset} if likely.offset else {})
    return entry, f"{' and '.join(names)}: command in {likely.name}"
