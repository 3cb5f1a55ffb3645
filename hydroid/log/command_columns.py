"""What the column of a command, or the two for its directions, holds: its range, and
where it rests."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from hydroid.arrays import Array
from hydroid.errors import LogError
from hydroid.files import Plain
from hydroid.log.columns import Column, Entry
from hydroid.log.joint_columns import Assignment
from hydroid.log.signals import (
    CommandRange,
    comes_near_zero,
    likely_range,
    of_one_scale,
    resting_range,
)
from hydroid.log.table import Signal, Table

SMALL_COMMAND = 5.0
"""of a log's commands, the smallest is below this [%], if one of 0 is none"""
NOISE = 0.02
"""part of the range of a command that a lever at rest may show"""
NEVER_AT_REST = (
    "it is never 0, so where it rests is not known: correct scale and offset"
)


def command_entries(
    tables: Sequence[Table], commands: Mapping[int, Assignment]
) -> dict[int, Entry]:
    """Return the settings of the columns of commands, and what they are taken for, by
    joint: by the first table that gives them."""
    cells = dict[int, _Cells]()
    for joint, command in commands.items():
        cells[joint] = _first_given(tables, command.columns)
    ranges = of_one_scale([of_joint.likely for of_joint in cells.values()])
    for joint, likely in zip(cells, ranges, strict=True):
        cells[joint] = cells[joint]._replace(likely=likely)
    usual = _usual_range([*cells.values()])
    entries = dict[int, Entry]()
    for joint, command in commands.items():
        entries[joint] = _command(command.columns, cells[joint], usual)
    return entries


class _Cells(NamedTuple):
    """The cells of a command, or of its two directions, and what they are likely in."""

    values: Array
    likely: CommandRange | None

    @property
    def spread(self) -> float:
        """From its least to its largest cell; 0 without any."""
        if np.isnan(self.values).all():
            return 0.0
        return float(np.nanmax(self.values) - np.nanmin(self.values))

    @property
    def changes(self) -> bool:
        return self.spread > 0.0

    @property
    def tells(self) -> bool:
        """Whether it tells a range: it changes, and what is around 0 is ever near it."""
        if not self.changes or len(self.values) > 1:
            return self.changes
        is_around_zero = self.likely is not None and not self.likely.offset
        values = self.values[np.isfinite(self.values)]
        return not is_around_zero or comes_near_zero(values)


def _first_given(tables: Sequence[Table], columns: Sequence[Column]) -> _Cells:
    """Return the cells of the first table that gives a command, and not the noise of a
    lever at rest alone; of further tables some may not have it."""
    first, *further = tables
    every = [_cells(first, columns)]
    for table in further:
        with suppress(LogError, KeyError):
            every.append(_cells(table, columns))
    enough = NOISE * max(cells.spread for cells in every)
    return next(cells for cells in every if cells.spread >= enough)


def _cells(table: Table, columns: Sequence[Column]) -> _Cells:
    """Return the cells of one or two columns, NaN where no message has come yet."""
    # a bag holds 0 for a command before its first message; but the range that the
    # others tell may not even contain 0
    signals = [Signal(column.name, "command", rest=np.nan) for column in columns]
    values = table.read(signals).values.T
    negative = values[1] if len(values) > 1 else None
    return _Cells(values, likely_range(values[0], negative, columns[0].unit))


def _usual_range(commands: Sequence[_Cells]) -> CommandRange | None:
    """Return the range that more than half of a log's commands that tell one are in, if
    it has a positive middle."""
    ranges = dict[str, CommandRange]()
    names = list[str]()
    for cells in commands:
        likely = cells.likely
        # one of a middle of 0 needs no offset, and is recognised anyway
        if likely and likely.offset:
            names.append(likely.name)
            ranges.setdefault(likely.name, likely)
    most = max(names, key=names.count, default="")
    telling = sum(cells.tells for cells in commands)
    if names.count(most) <= telling / 2:
        return None
    return ranges[most]


def _command(
    columns: Sequence[Column], cells: _Cells, usual: CommandRange | None
) -> Entry:
    """Return the settings of the columns of a command, and what they are taken for.

    What rests beside the middle is no command: its own rest is 0 %.
    """
    names = [column.name for column in columns]
    if len(names) == 1:
        at_rest = resting_range(cells.values[0], cells.likely, usual)
        if at_rest is not None:
            return _resting(names[0], cells, *at_rest)
    settings: Plain = {"column": names[0] if len(names) == 1 else names}
    both = " and ".join(names)
    likely = cells.likely
    if likely is None or "%" in (columns[0].unit, likely.name):
        likely = likely or CommandRange("%", 1.0, 0.0)
        return Entry(settings, f"{both}: command in %", _rest_hint(cells, likely))
    likely = likely.with_overshoot(cells.values)
    settings["scale"] = likely.scale
    if likely.offset:
        settings["offset"] = likely.offset
    meaning = f"{both}: command in {likely.name}"
    return Entry(settings, meaning, _rest_hint(cells, likely))


def _resting(name: str, cells: _Cells, rest: float, around: CommandRange) -> Entry:
    """Return the settings of the column of a command that rests beside the middle of
    its range; `around` is the range that begins at its rest."""
    around = around.with_overshoot(cells.values)
    settings = {"column": name, "scale": around.scale, "offset": around.offset}
    meaning = f"command in {around.name}, at rest at {rest:.6g}"
    return Entry(settings, f"{name}: {meaning}")


def _rest_hint(cells: _Cells, likely: CommandRange) -> str:
    """Return the hint about a command that is never at rest; empty of any other."""
    return "" if _rests_at_zero(cells, likely) else NEVER_AT_REST


def _rests_at_zero(cells: _Cells, likely: CommandRange) -> bool:
    """Return whether a command is ever none, of a range that has 0 in its middle."""
    if likely.offset or len(cells.values) > 1 or not cells.changes:
        return True
    smallest = float(np.nanmin(np.abs(cells.values)))
    return likely.scale * smallest <= SMALL_COMMAND
