"""A table of unknown columns -> a `log` section that maps them, with a reason for each guess.

The unit of a column, or else the words of its name, tell what it is. Its joint is the one whose name or
number its own name holds. Where no column of a kind has a joint they are given to the joints in order; beside
columns that have one, a column without is left out and named.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from hydroid.errors import LogError
from hydroid.log.clues import column_unit, direction, joint_of, kind_of, likely_range, number_in
from hydroid.log.log import Floats
from hydroid.log.table import Signal, Table
from hydroid.units import UNITS, likely_time_unit
from hydroid.words import listed


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

    @property
    def slides(self) -> bool:
        return bool(self.unit) and UNITS[self.unit].quantity == "length"


def guess_columns(
    table: Table, joints: Sequence[str], *, links: Sequence[str] = (), slides: Sequence[int] = ()
) -> ColumnGuess:
    """Guess which columns are time, commands and angles, of which joints, in which units.

        guess = guess_columns(open_table(Path("log.csv")), ["swing", "boom", "stick", "bucket"])

    Args:
        table: an opened log.
        joints: names of the arm's joints, in order.
        links: names of the links that they move, in order, which columns may have instead.
        slides: joints (numbers, from 1) that slide: their positions are in m.

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
    names = [f"joint {k}" if name == f"joint{k}" else name for k, name in enumerate(joints, 1)]
    known = (joints, links)
    entries, used = dict[int, dict[str, Any]](), {time.name}
    by_kind = {
        kind: _by_joint([c for c in columns if c.kind == kind], known, slides, names, reasons)
        for kind in ("command", "angle")
    }
    angles = [pair[0] for joint, pair in by_kind["angle"].items() if joint not in slides]
    unitless = [float(np.nanmax(np.abs(column.values))) for column in angles if not column.unit]
    default = "rad" if unitless and max(unitless) <= 6.3 else "deg"
    for joint in sorted({*by_kind["angle"], *by_kind["command"]}):
        entry: dict[str, Any] = {"command": None, "angle": None}
        entries[joint], name = entry, names[joint - 1]
        if pair := by_kind["command"].get(joint):
            entry["command"], said = _command(pair)
            reasons.append(f"{said} of {name}, {pair[0].why}")
        for column in by_kind["angle"].get(joint, []):
            slide = joint in slides
            given = column.unit or (_length_unit(column.values) if slide else default)
            entry["angle"] = {"column": column.name, "unit": given}
            reasons.append(
                f"{column.name}: {'position' if slide else 'angle'} in {given} of {name}, {column.why}"
            )
        used |= {column.name for pairs in by_kind.values() for column in pairs.get(joint, ())}
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

    def read(names: Sequence[str]) -> Iterator[_Column]:
        recording = table.read([Signal(n, "command" if kinds[n] == "command" else "angle") for n in names])
        for name, values in zip(names, recording.values.T, strict=True):
            unit = given[name]
            yield _Column(name, kinds[name], unit.name if unit else "", values, name in recording.clocks)

    columns = list[_Column]()
    try:
        columns = [*read([*kinds])] if kinds else []
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
    columns: Sequence[_Column],
    known: tuple[Sequence[str], Sequence[str]],
    slides: Sequence[int],
    names: Sequence[str],
    reasons: list[str],
) -> dict[int, list[_Column]]:
    """Give each joint its column, or two for the directions; say what is uncertain or left out."""
    groups, given = dict[Any, list[_Column]](), dict[int, list[_Column]]()
    for column in columns:
        sign, others = direction(column.name)
        groups.setdefault(others if sign and column.kind == "command" else column.name, []).append(column)
    pairs = [sorted(pair, key=lambda c: -direction(c.name)[0])[:2] for pair in groups.values()]
    from_zero = any(number_in(column.name) == 0 for column in columns)
    left, kind = list[list[_Column]](), columns[0].kind if columns else ""

    def fits(joint: int, column: _Column) -> bool:
        """Return whether a position's unit is one of the joint, and the joint has no column yet."""
        measures = column.kind == "command" or not column.unit or column.slides == (joint in slides)
        return measures and 0 < joint <= len(names) and joint not in given

    for pair in pairs:
        number = number_in(pair[0].name)
        joint = next(filter(None, (joint_of(pair[0].name, of) for of in known)), None)
        joint = joint or (None if number is None else number + from_zero)
        if joint and fits(joint, pair[0]):
            given[joint] = pair
        else:
            left.append(pair)
    if given and from_zero:
        reasons.append("the numbers in the names count from 0: joint 1 is number 0")
    if left and not given:
        for pair in left:
            if joint := next((k for k in range(1, len(names) + 1) if fits(k, pair[0])), 0):
                given[joint] = pair
        said = listed([f"{pair[0].name} of {names[joint - 1]}" for joint, pair in given.items()], 12)
        reasons.append(f"{kind}s by their order: check them: {said}")
        left = [pair for pair in left if pair not in given.values()]
    without = [name for k, name in enumerate(names, 1) if k not in given]
    if left:
        spare = listed([column.name for pair in left for column in pair], 12)
        whose = f"whose {kind} is it: {' or '.join(without)}?" if without else "every joint has one already"
        reasons.append(f"left out, though like a joint's {kind}: {spare}; {whose}")
    return given


def _length_unit(values: Floats) -> str:
    """Return the unit of a slide's position: no telescope is 50 m long."""
    return "mm" if np.nanmax(np.abs(values)) > 50 else "m"


def _command(columns: Sequence[_Column]) -> tuple[dict[str, Any], str]:
    """Return the settings of a command, and its name with what its numbers seem to be."""
    names = [column.name for column in columns]
    likely = likely_range(*(np.nan_to_num(column.values) for column in columns))
    entry: dict[str, Any] = {"column": names[0] if len(names) == 1 else names}
    if likely is None or "%" in (columns[0].unit, likely.name):
        return entry, f"{' and '.join(names)}: command in %"
    entry |= {"scale": likely.scale} | ({"offset": likely.offset} if likely.offset else {})
    return entry, f"{' and '.join(names)}: command in {likely.name}"
