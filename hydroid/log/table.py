"""What every file format is read as: a table of named columns, some of which are read
into a recording."""

import re
from array import array
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import KW_ONLY, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydroid.arrays import Array, Index, Ints, record
from hydroid.errors import LogError
from hydroid.findings import Level
from hydroid.log.log import LogFinding, log_finding
from hydroid.log.rods import Rod
from hydroid.units import NO_UNIT, TURNING, Display, Unit, display

_DAY = 86_400 * 10**9
"""[ns]"""
_NO_TIME = np.iinfo(np.int64).min
"""NaT of numpy [ns]"""
LONGEST_TIME = 50
"""characters of a cell from which it is no date: to look for one would take long"""
LARGEST = 1e100
"""size of a number from which it counts as none: its square would be infinite"""
_TIME = re.compile(
    r"(?:.*[T ])?(\d{1,2}):(\d{2}):(\d{2})(?:[.,](\d{1,9})\d*)? *([AaPp])?\.?[Mm]?\.?(?:Z|[+-][\d:]+)?"
)
"""a time of day, behind a date or without one"""


@record
class Signal:
    """One column in use: value = gain · cell + offset in [s], [%], [rad], [m] or [Pa].

    Attributes:
        name: in the header.
        kind: time, command, angle, pressure, engine speed or oil temperature.
        joint: its number from 1; 0 for the time.
        part: 1 for the column of a command's negative direction and of the pressure in
            chamber B, else 0.
        low, high: limits of the values.
        unit: in which messages state values: %, deg, mm of a joint that slides, or bar.
        owner: the joint's name.
        rest: value of a command before its first message, in a format of messages.
        rod: the cylinder whose length the cells of an angle are.
        setting: key of the settings that name its column.
        setting_unit: in which they state scale and offset.
        reference: of an engine's speed, or an oil's temperature, in SI.
    """

    name: str
    kind: str
    joint: int = 0
    part: int = 0
    gain: float = 1.0
    offset: float = 0.0
    low: float = -np.inf
    high: float = np.inf
    unit: str = ""
    owner: str = ""
    rest: float = 0.0
    rod: Rod | None = None
    setting: str = ""
    setting_unit: Unit = NO_UNIT
    reference: float = 0.0

    @property
    def shown(self) -> Display:
        """How messages write the angle, or the position of a joint that slides, that it
        holds."""
        return display(slides=self.unit not in ("", TURNING.unit))

    @property
    def scale(self) -> float:
        """Factor on the cells that brings them to the unit of the settings."""
        return self.gain / self.setting_unit.factor

    def __str__(self) -> str:
        if self.joint:
            return f"{self.kind} of joint {self.owner}"
        return self.kind


@record
class Table:
    """Named columns of one file, the source.

    Attributes:
        names: of the columns, in order; "" for one without.
        columns: their cells by name, shape (R,): numbers, times or text.
        header: line of the names [1-based], in a format whose rows are lines; None
            elsewhere.
        units: that the file gives to columns, by name.
        remarks: what the reader skipped and what it took parts of the file for.
        lines: of the rows [1-based], shape (R,); None: 1, 2, ...
    """

    _: KW_ONLY
    source: str
    names: tuple[str, ...]
    columns: Mapping[str, NDArray[Any]] = field(default_factory=dict[str, NDArray[Any]])
    header: int | None = None
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    remarks: tuple[str, ...] = ()
    lines: Ints | None = None

    def text(self, name: str, row: int) -> str:
        """Return the text of a cell that holds no number, for a message; empty where it
        is no text."""
        cell = self.columns[name][row]
        if isinstance(cell, str):
            return cell
        return ""

    @property
    def holds_numbers(self) -> bool:
        """Whether any column has a number in every other row: a text has none."""
        for cells in self.columns.values():
            numbers, _ = _as_numbers(cells)
            if len(numbers) and np.mean(np.isfinite(numbers)) >= 0.5:
                return True
        return False

    def read(self, signals: Sequence[Signal]) -> "Recording":
        """Read the columns of signals; a number that is too large counts as none."""
        first = signals[0].name
        values = np.empty((len(self.columns[first]), len(signals)))
        for signal, column in zip(signals, values.T, strict=True):
            cells = self.columns[signal.name]
            if len(cells) != len(column):
                count = len(column)
                what = f"holds {len(cells)} values, but column {first} holds {count}"
                where = f"{self.source}, column {signal.name}"
                hint = "all columns of a log have one clock: resample it"
                raise LogError(what, where, hint)
            numbers, are_times = _as_numbers(cells)
            # dates and times of day are in seconds, whatever unit the settings say
            gain = 1.0 if are_times else signal.gain
            with np.errstate(all="ignore"):
                column[:] = numbers * gain + signal.offset
        values[~(np.abs(values) < LARGEST)] = np.nan
        rows = np.arange(len(values))
        clock = time_of_day(self.columns[first])
        return Recording(self, tuple(signals), values, rows, clock)


@record
class Recording:
    """The used columns of one file, a table: R rows of C signals, the first of which is
    the time.

    Attributes:
        values: in the signals' units, shape (R, C), NaN where the file holds no number.
        rows: of the table [0-based], shape (R,).
        clock: time of day of the table's first row, HH:MM:SS; empty where the file has
            none.
    """

    table: Table
    signals: tuple[Signal, ...]
    values: Array
    rows: Ints
    clock: str = ""

    @property
    def time(self) -> Array:
        """Time [s], shape (R,)."""
        return self.values[:, 0]

    def kept(self, rows: Index | slice) -> "Recording":
        """Return some of its rows."""
        return replace(self, values=self.values[rows], rows=self.rows[rows])

    def finding(
        self,
        level: Level,
        kind: str,
        rows: Sequence[int] | Ints = (),
        signal: Signal | None = None,
        *subjects: object,
        **numbers: Any,
    ) -> LogFinding:
        """Make a finding at the first of `rows`, about a signal or other subjects; it
        counts the others."""
        row = ""
        if len(rows):
            row = self._place(rows[0])
        more = ""
        others = len(rows) - 1
        if others > 0:
            word = "row" if others == 1 else "rows"
            more = f" (and {others} more {word}, up to {self._place(rows[-1])})"
        column = ""
        about = subjects
        if signal is not None:
            column = signal.name
            about = subjects or (signal,)
        source = self.table.source
        return log_finding(
            level, kind, source, *about, row=row, column=column, rows=more, **numbers
        )

    def _place(self, row: int) -> str:
        """Return where one of its rows stands in the file, as messages say it."""
        word = "line" if self.table.header else "row"
        table_row = self.rows[row]
        lines = self.table.lines
        number = table_row + 1 if lines is None else lines[table_row]
        return f"{word} {number}"


TRUTHS = {"true": 1.0, "false": 0.0}
"""cells of switched valves, as programs write them"""


def number(cell: str) -> float | None:
    """Return what float() reads, but for the digit groups of Python's literals (1_000),
    and 1 and 0 of what is true or false; None: no number."""
    try:
        if "_" not in cell:
            return float(cell)
        return None
    except ValueError:
        return TRUTHS.get(cell.strip().lower())


def clock(cell: str) -> int | None:
    """Return the time of day in a cell [ns]; None: there is none."""
    if len(cell) >= LONGEST_TIME:
        return None
    match = _TIME.fullmatch(cell)
    if match is None:
        return None
    hour, minute, second, fraction, half = match.groups()
    hours = int(hour)
    # 12 AM is midnight, 12 PM noon
    if half:
        hours = hours % 12 + 12 * (half in "Pp")
    seconds = (hours * 60 + int(minute)) * 60 + int(second)
    nanoseconds = int((fraction or "0").ljust(9, "0"))
    return seconds * 10**9 + nanoseconds


def time_of_day(cells: NDArray[Any]) -> str:
    """Return the time of day of the first cell, HH:MM:SS; empty where it is none."""
    if cells.dtype.kind != "M" or not len(cells) or np.isnat(cells[0]):
        return ""
    return str(cells[0].astype("M8[s]")).partition("T")[2]


class TextColumn:
    """The numbers in a column of text, which comes in pieces; or times, if its first
    cell with text is one.

    Dates do not count, which programs write in many ways: a time of day that falls by
    more than half a day has passed midnight.
    """

    def __init__(self) -> None:
        self._numbers = array("d")
        self._ticks: array[int] | None = None
        self._begun = False

    def extend(self, cells: Sequence[str]) -> None:
        """Take the next cells."""
        if not self._begun and (first := next(filter(None, cells), "")):
            self._begun = True
            if clock(first) is not None:
                self._ticks = array("q", [_NO_TIME] * len(self._numbers))
        if self._ticks is not None:
            clocks = map(clock, cells)
            self._ticks.extend(_NO_TIME if tick is None else tick for tick in clocks)
        else:
            self._numbers.extend(_numbers(cells))

    def values(self) -> NDArray[Any]:
        """Return numbers, NaN where there is none, or times, NaT where there is none;
        shape (R,)."""
        if self._ticks is None:
            # numpy has no view of nothing
            if not self._numbers:
                return np.zeros(0)
            return np.frombuffer(self._numbers, np.float64)
        ticks = np.array(self._ticks, np.int64)
        there = ticks != _NO_TIME
        steps = np.diff(ticks[there], prepend=ticks[there][:1])
        # a smaller step back is a clock that was set, which is a fault
        days = np.cumsum(steps < -_DAY // 2)
        ticks[there] += _DAY * days
        return ticks.view("M8[ns]")


def _numbers(cells: Sequence[str]) -> "array[float]":
    """Return the numbers in cells, NaN where there is none."""
    # nearly all pieces hold numbers alone, which float() reads much faster
    if not any("_" in cell for cell in cells):
        with suppress(ValueError):
            return array("d", map(float, cells))
    values = map(number, cells)
    return array("d", [np.nan if value is None else value for value in values])


def _as_numbers(cells: NDArray[Any]) -> tuple[Array, bool]:
    """Return cells as numbers, NaN where there is none, and whether they are times [s]
    from the first."""
    if cells.dtype.kind in "fiub":
        return cells.astype(np.float64), False
    if cells.dtype.kind == "m":
        return cells / np.timedelta64(1, "s"), True
    if cells.dtype.kind == "M":
        return _seconds(cells), True
    column = TextColumn()
    column.extend([str(cell) for cell in cells])
    return _as_numbers(column.values())


def _seconds(stamps: NDArray[Any]) -> Array:
    """Return times from the first one [s], NaN where there is none."""
    there = ~np.isnat(stamps)
    since_first = stamps[there] - stamps[there][:1]
    # in whole numbers: floats would round nanoseconds before the difference
    ticks = since_first.astype("m8[ns]").astype(np.int64)
    seconds = np.full(len(stamps), np.nan)
    seconds[there] = (ticks - ticks[:1]) / 1e9
    return seconds


MOST_NUMBERS = 30_000_000
"""that are read of one log: hours of it, and about 1 GB of memory until it is
resampled"""


def refuse_large(source: str, rows: int, columns: int) -> None:
    """Raise a LogError where a log is too long for the memory of a usual computer."""
    if rows * columns > MOST_NUMBERS:
        most = MOST_NUMBERS // columns
        can_be = f"at most {most:,} rows of {columns} columns can be read"
        what = f"has {rows:,} rows; {can_be}"
        raise LogError(what, source, "cut it, or record at a lower rate")


BLIND = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    LookupError,
    MemoryError,
    TypeError,
)
"""errors of a library that met bytes which its authors did not expect: their text says
nothing of the file"""


@contextmanager
def format_library(package: str, extra: str, path: Path, kind: str) -> Generator[Any]:
    """Yield a library that reads a format; whatever it raises on damaged bytes becomes
    a `LogError`."""
    try:
        library = import_module(package)
    except ImportError:
        what = f"needs the package {package.partition('.')[0]}, which is not installed"
        raise LogError(what, path, f"pip install 'hydroid[{extra}]'") from None
    try:
        yield library
    except LogError:
        raise
    except Exception as error:
        reason = ""
        if not isinstance(error, BLIND):
            reason = " ".join(str(error).split())
        what = f"cannot be read as {kind} ({reason[:200] or 'damaged'})"
        raise LogError(what, path, "save it again") from None
