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
from hydroid.log.clock import likely_unit
from hydroid.log.column_words import Kind, direction, joint_of, kind_of, number_in, unit_of
from hydroid.log.command_range import likely_pair, likely_range
from hydroid.log.log import Floats
from hydroid.log.table import Table
from hydroid.settings.log import SECONDS

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


def guess_columns(table: Table, joints: Sequence[str]) -> ColumnGuess:
    """Guess which columns are time, commands and angles, of which joints, in which units.

        guess = guess_columns(open_table(Path("log.csv")), ["swing", "boom", "stick", "bucket"])

    Args:
        table: an opened log.
        joints: names of the arm's joints, in order.

    Raises:
        LogError: no column looks like a time.
    """
    columns, clocks = _columns(table)
    time = _time(table, columns)
    rest = [column for column in columns if column is not time]
    clock = time.name in clocks
    unit = "s" if clock else _time_unit(time)
    step = float(np.nanmedian(np.diff(time.values))) * SECONDS[unit]
    log: dict[str, Any] = {"time": {"column": time.name, "unit": unit}, "command": None, "angle": None}
    log["period_s"] = min(PERIODS, key=lambda period: abs(np.log(period / step)))
    reasons = [
        f"{time.name}: time in {'dates or times of day' if clock else unit}, {time.why}, every {step:.3g} s"
    ]
    angles, why = _by_joint([c for c in rest if c.kind == "angle"], joints)
    reasons += why
    commands, why = _by_joint([c for c in rest if c.kind == "command"], joints)
    reasons += why
    rad = _in_radians([column for (column, *_) in angles.values()])
    log["joints"] = {}
    named = {
        k: f"joint {k}" if name == f"joint{k}" else f"joint {k} ({name})" for k, name in enumerate(joints, 1)
    }
    for joint in sorted({*angles, *commands}):
        entry: dict[str, Any] = {"command": None, "angle": None}
        if joint in commands:
            entry["command"], said = _command(commands[joint])
            reasons.append(f"{said} of {named[joint]}, {commands[joint][0].why}")
        if joint in angles:
            column = angles[joint][0]
            is_rad = column.unit == "rad" or (column.unit == "" and rad)
            entry["angle"] = {"column": column.name, "unit": "rad" if is_rad else "deg"}
            said = f"{column.name}: angle in {entry['angle']['unit']}"
            reasons.append(f"{said} of {named[joint]}, {column.why}")
        log["joints"][joint] = entry
    used = {time.name, *(c.name for group in (*angles.values(), *commands.values()) for c in group)}
    return ColumnGuess(log, tuple(reasons), tuple(n for n in table.names if n and n not in used))


def _columns(table: Table) -> tuple[list[_Column], frozenset[str]]:
    """Read every column of numbers, those of the usual length; also returns which hold times of day."""
    names = list(dict.fromkeys(name for name in table.names if name))
    told = {name: kind_of(name, unit_of(name, table.units.get(name, ""))) for name in names}
    held = {name for name in names if told[name] == "command"}
    read: dict[str, Floats] = {}
    clocks = frozenset[str]()
    for group in (names, [name for name in names if told[name] != "other"], *([name] for name in names)):
        try:
            cells = table.read(group, held)
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
            unit = unit_of(name, table.units.get(name, ""))
            kind, why = kind_of(name, unit), "by its unit" if unit else "by its name"
            if kind == "" and np.ptp(values[np.isfinite(values)]) > 0:
                kind, why = _kind_by_motion(values), "by how its numbers change"
            columns.append(_Column(name, kind, unit, values, why))
    return columns, clocks


def _kind_by_motion(values: Floats) -> Kind:
    steps = np.abs(np.diff(values[np.isfinite(values)]))
    jumps = steps.max() > JUMP * np.ptp(values[np.isfinite(values)])
    return "command" if jumps or (steps == 0).mean() > STILL else "angle"


def _time(table: Table, columns: Sequence[_Column]) -> _Column:
    def steady(values: Floats) -> bool:
        steps = np.diff(values[np.isfinite(values)])
        return len(steps) > 0 and bool((steps > 0).all()) and np.median(steps) > STEADY * steps.mean()

    rising = [column for column in columns if steady(column.values)]
    named = [column for column in columns if column.kind == "time"]
    for choice in ([c for c in rising if c.kind == "time"], named, rising):
        if choice:
            return choice[0]
    hint = f"the columns are: {', '.join(name for name in table.names if name)[:500]}"
    raise LogError("has no column that looks like a time", where=table.source, hint=hint)


def _time_unit(time: _Column) -> str:
    """Return the unit that the file gives, or the one in which there are 2 to 1000 samples a second."""
    given = {"sec": "s", "secs": "s", "second": "s", "seconds": "s", "msec": "ms", "µs": "us"}
    unit = given.get(time.unit, time.unit)
    return unit if unit in SECONDS else likely_unit(float(np.nanmedian(np.diff(time.values)))) or "s"


def _by_joint(
    columns: Sequence[_Column], joints: Sequence[str]
) -> tuple[dict[int, list[_Column]], list[str]]:
    """Give each column a joint: one column, or two for the directions; also says what is uncertain."""
    found: dict[int, list[_Column]] = {}
    reasons = list[str]()
    numbers = [number for c in columns if (number := number_in(c.name)) is not None]
    from_zero = 0 in numbers
    free = list[_Column]()
    for column in columns:
        number = number_in(column.name)
        joint = joint_of(column.name, joints) or (number + from_zero if number is not None else None)
        mates = found.get(joint, []) if joint else []
        if joint is None or not 1 <= joint <= len(joints) or (mates and not _are_pair([*mates, column])):
            free.append(column)
        else:
            found.setdefault(joint, []).append(column)
    if from_zero and found:
        reasons.append("the numbers in the names count from 0: joint 1 is number 0")
    if found:  # a column without a joint, beside others with one, is something else
        return {
            joint: sorted(pair, key=lambda c: -direction(c.name)[0]) for joint, pair in found.items()
        }, reasons
    pairs = list[list[_Column]]()
    for column in free:
        mate = next((pair for pair in pairs if len(pair) == 1 and _are_pair([*pair, column])), None)
        pairs.append([column]) if mate is None else mate.append(column)
    if free:
        reasons.append(
            f"the joints of {', '.join(c.name for c in free)} are given by their order: check them"
        )
    ordered = [sorted(pair, key=lambda c: -direction(c.name)[0]) for pair in pairs]
    return dict(enumerate(ordered[: len(joints)], 1)), reasons


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
    likely = likely_range(parts[0]) if len(parts) == 1 else likely_pair(parts[0], parts[1])
    entry: dict[str, Any] = {"column": names[0] if len(names) == 1 else names}
    if likely is None or (columns[0].unit in ("%", "pct", "percent") and likely.name != "%"):
        return entry, f"{' and '.join(names)}: command in %"
    if likely.name != "%":
        entry |= {"scale": likely.scale} | ({"offset": likely.offset} if likely.offset else {})
    return entry, f"{' and '.join(names)}: command in {likely.name}"


def _in_radians(angles: Sequence[_Column]) -> bool:
    """Return whether angles without a unit are small enough to be in rad, all of them."""
    return bool(angles) and all(np.nanmax(np.abs(c.values)) <= RADIANS for c in angles if c.unit == "")
