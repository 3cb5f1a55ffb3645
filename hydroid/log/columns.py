"""The columns of a table that seem to be times, commands, angles or targets."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from hydroid.arrays import Array, Limits
from hydroid.errors import LogError
from hydroid.files import Plain
from hydroid.log.clues import (
    CLUES,
    RAW,
    column_unit,
    is_counter,
    is_of_a_valve,
    joint_of,
    kind_of,
    words,
)
from hydroid.log.signals import CommandRange, likely_range
from hydroid.log.table import Signal, Table
from hydroid.settings.log import ANGLES, LENGTHS
from hydroid.units import UNITS, Unit, likely_time_unit, unit_of

NO_SETTINGS: Plain = {}
EXCEL_DAYS = 30_000
"""days from 1900 that a spreadsheet's dates are, at least"""


class Column(NamedTuple):
    """A column that seems to be a signal.

    Its `kind` is time, command, angle or target; the `unit` is empty where the file
    does not state one; `values` are its cells, shape (R,); `further` are those of the
    same column in other logs.
    """

    name: str
    kind: str
    unit: str
    values: Array
    further: tuple[Array, ...] = ()

    @property
    def ends(self) -> Limits:
        """The least and the largest of its values, in all logs."""
        values = np.concatenate([self.values, *self.further])
        values = values[np.isfinite(values)]
        return float(values.min()), float(values.max())

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
        return not self.turns and self._has_word(CLUES["lengths"])

    @property
    def turns(self) -> bool:
        """Whether it holds an angle, whatever else its name says."""
        return self.unit in ANGLES or self._has_word(CLUES["turns"])

    @property
    def is_of_a_sensor(self) -> bool:
        """Whether its name says what measures it."""
        return self._has_word(CLUES["sensors"])

    def _has_word(self, of: Sequence[str]) -> bool:
        return not {*words(self.name)}.isdisjoint(of)


class Entry(NamedTuple):
    """The settings of a column, what it is taken for, and a hint about what is not
    known.

    `mirrored`: of an angle whose sensor has no known scale, the settings if it counts
    the other way; empty of all others.
    """

    settings: Plain
    meaning: str
    hint: str = ""
    mirrored: Plain = NO_SETTINGS

    def reason(self, joint: str, why: str) -> str:
        """Return why it is taken for a joint's, with the hint."""
        sentence = f"{self.meaning} of {joint}, {why}"
        return f"{sentence}; {self.hint}" if self.hint else sentence


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
    if not any(column.kind == "time" for column in columns):
        columns += _time_by_values(table, kinds)
    return columns


def beside(columns: Sequence[Column], tables: Sequence[Table]) -> list[Column]:
    """Return columns with their values in further tables that have them."""
    wider = list[Column]()
    for column in columns:
        further = list[Array]()
        for table in tables:
            with suppress(LogError, KeyError):
                further.append(table.read([Signal(column.name, column.kind)]).time)
        wider.append(column._replace(further=tuple(further)))
    return wider


def _kinds(units: Mapping[str, Unit | None], names: Sequence[str]) -> dict[str, str]:
    """Return the kinds of the columns that may be signals, by the columns' names.

    A column without unit that is called as a joint is, or as what a command moves,
    holds its angle, and so does one of a sensor that names a joint. Those come last.
    """
    kinds = dict[str, str]()
    bare_names = [{*words(name)} - {"joint"} for name in names]
    for name, unit in units.items():
        kind = kind_of(name, unit)
        if kind != "other":
            kinds[name] = kind
        if kind == "command":
            bare_names.append({*words(name)} - {*CLUES["kinds"]["command"]})
    others = [name for name in units if name not in kinds and not is_of_a_valve(name)]
    for name in others:
        is_bare = {*words(name)} - {"joint"} in bare_names
        if is_bare or _is_of_a_joints_sensor(name, names):
            kinds[name] = "angle"
    return kinds


def _is_of_a_joints_sensor(name: str, joints: Sequence[str]) -> bool:
    """Return whether a column's name says a sensor and a joint."""
    sensors = {*CLUES["sensors"], *CLUES["counts"]}
    if sensors.isdisjoint(words(name)):
        return False
    return any(joint_of(name, [joint]) for joint in joints)


def _time_by_values(table: Table, known: Collection[str]) -> Iterator[Column]:
    """Yield the first column of dates, or else of numbers that rise in even steps, as a
    time; a counter of samples or cycles is none.

    `known`: columns that are something else.
    """
    for name in table.names:
        cells = table.columns.get(name)
        if not name or name in known or cells is None or not len(cells):
            continue
        values = table.read([Signal(name, "time")]).time
        if not rises(values):
            continue
        if is_counter(name, column_unit(name, table.units.get(name, ""))):
            continue
        is_date = cells.dtype.kind == "M" or values[0] > EXCEL_DAYS
        if _has_usual_steps(values, is_date=is_date):
            yield Column(name, "time", "", values)
            return


def _has_usual_steps(values: Array, *, is_date: bool) -> bool:
    """Return whether the steps of numbers that rise are those of a time."""
    steps = np.diff(values[np.isfinite(values)])
    unit = likely_time_unit(float(np.median(steps)))
    if is_date:
        return bool(unit)
    # what takes minutes or days from one sample to the next is rather no time
    return unit in ("s", "ms", "us", "ns") and not (steps == 1).all()


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
    # nobody measures time in µs that does not pass, but for pulses
    if unit == "us" or (likely and _are_pulses(likely)):
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
