"""The columns of a table that seem to be times, commands, angles or targets."""

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hydroid.arrays import Array
from hydroid.errors import LogError
from hydroid.log.clues import CLUES, RAW, column_unit, kind_of, words
from hydroid.log.mapping import LENGTHS
from hydroid.log.signals import CommandRange, likely_range
from hydroid.log.table import Signal, Table
from hydroid.units import UNITS, Unit, unit_of

ANGLES = ("rad", "deg")


class Column(NamedTuple):
    """A column that seems to be a signal.

    Its `kind` is time, command, angle or target; the `unit` is empty where the file
    does not state one; `values` are its cells as they are, shape (R,).
    """

    name: str
    kind: str
    unit: str
    values: Array

    @property
    def is_raw(self) -> bool:
        """Whether a position is as a sensor gives it: in V, mA or counts."""
        if self.unit:
            return UNITS[self.unit.lower()].quantity in RAW
        return self._has_word(CLUES["counts"])

    @property
    def is_length(self) -> bool:
        """Whether it holds a length, by its unit or its name."""
        if self.unit in LENGTHS:
            return True
        turns = self.unit in ANGLES or self._has_word(CLUES["turns"])
        return not turns and self._has_word(CLUES["lengths"])

    def _has_word(self, of: Sequence[str]) -> bool:
        return not {*words(self.name)}.isdisjoint(of)


def signal_columns(table: Table, names: Sequence[str]) -> list[Column]:
    """Return the columns that seem to be signals; arrays of a rare length are none.

    `names`: of joints, and of the links that they move.
    """
    units = dict[str, Unit | None]()
    for name in table.names:
        if name:
            units[name] = column_unit(name, table.units.get(name, ""))
    kinds = _kinds(units, names)
    # all are 0 in a bag, whose channels have clocks of their own
    lengths = [len(table.columns.get(name, ())) for name in kinds]
    usual_length = max(lengths, key=lengths.count, default=0)
    columns = list[Column]()
    for (name, kind), length in zip(kinds.items(), lengths, strict=True):
        if length == usual_length:
            column = _read_column(table, name, kind, units[name], names)
            if column is not None:
                columns.append(column)
    return columns


def _kinds(units: Mapping[str, Unit | None], names: Sequence[str]) -> dict[str, str]:
    """Return the kinds of the columns that may be signals, by the columns' names.

    A column without unit that is called as a joint is, or as what a command moves,
    holds its angle. Those come last.
    """
    kinds = dict[str, str]()
    bare_names = [{*words(name)} - {"joint"} for name in names]
    for name, unit in units.items():
        kind = kind_of(name, unit)
        if kind != "other":
            kinds[name] = kind
        if kind == "command":
            bare_names.append({*words(name)} - {*CLUES["kinds"]["command"]})
    others = [name for name in units if name not in kinds]
    for name in others:
        if {*words(name)} - {"joint"} in bare_names:
            kinds[name] = "angle"
    return kinds


def _read_column(
    table: Table, name: str, kind: str, unit: Unit | None, names: Collection[str]
) -> Column | None:
    """Return a column with its values; None where it has none."""
    try:
        values = table.read([Signal(name, kind)]).time
    except LogError:
        # a channel of a single message
        return None
    if not np.isfinite(values).any():
        return None
    stated = unit.name if unit else ""
    if kind == "time" and not rises(values):
        kind = _kind_in_seconds(name, values, stated, names)
        if kind == "angle":
            stated = ""
    return Column(name, kind, stated, values)


def _kind_in_seconds(
    name: str, values: Array, unit: str, names: Collection[str]
) -> str:
    """Return the kind of a column that has a unit of time and does not rise."""
    likely = likely_range(values, unit=unit)
    if likely and _are_pulses(likely):
        return "command"
    # "Boom Ms" may be its measured position
    joint_words = set[str]()
    for joint in names:
        joint_words.update(words(joint))
    joint_words -= {"joint", "link"}
    return "time" if joint_words.isdisjoint(words(name)) else "angle"


def _are_pulses(likely: CommandRange) -> bool:
    unit = unit_of(likely.name.split()[-1])
    return unit is not None and unit.quantity == "time"


def rises(values: Array) -> bool:
    """Return whether values rise nearly always, by steps without an outlier."""
    steps = np.diff(values[np.isfinite(values)])
    if not len(steps):
        return False
    rising = np.mean(steps > 0)
    return bool(rising > 0.99 and np.median(steps) > 0.5 * steps.mean())
