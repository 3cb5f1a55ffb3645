"""What every file format is read as: a table of named columns, some of which are read into a recording."""

from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import LogError
from hydroid.findings import Level
from hydroid.log.cells import clock, number, seconds
from hydroid.log.finding import LogFinding, log_finding
from hydroid.log.log import Floats


@dataclass(frozen=True)
class Signal:
    """One column in use: value = gain · cell + offset in [s], [%], [rad], [m] or [Pa], from `low` to `high`.

    `name` is that in the header, `joint` a number from 1, or 0 for the time. `part` is 0, or 1 for the column
    of a command's negative direction and of the pressure in chamber B. `unit` is the one to be read: %, deg,
    mm of a joint that slides, or bar.
    """

    name: str
    kind: Literal["time", "command", "angle", "pressure"]
    joint: int = 0
    part: int = 0
    gain: float = 1.0
    offset: float = 0.0
    low: float = -np.inf
    high: float = np.inf
    unit: str = ""

    def __str__(self) -> str:
        return f"{self.kind} of joint {self.joint}" if self.joint else self.kind


@dataclass(frozen=True, eq=False, kw_only=True)
class Table:
    """Named columns of one file.

    Attributes:
        source: the file.
        layout: its format in a few words, such as "CSV in UTF-8 separated by semicolons".
        names: of the columns, in order; "" for one without.
        columns: their cells by name, shape (R,): numbers, times or text.
        header: line of the names [1-based]; None where the format stores them.
        units: that the file gives to columns, by name.
        remarks: what the reader skipped and what it took parts of the file for.
        lines: of the rows [1-based], shape (R,); None: 1, 2, ...
        torn: rows that have more or fewer cells than there are columns, shape (R,); None: no row.
    """

    source: str
    layout: str
    names: tuple[str, ...]
    columns: Mapping[str, NDArray[Any]] = field(default_factory=dict[str, NDArray[Any]])
    header: int | None = None
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    remarks: tuple[str, ...] = ()
    lines: NDArray[np.int64] | None = None
    torn: NDArray[np.bool_] | None = None

    def read(self, signals: Sequence[Signal]) -> "Recording":
        """Read the columns of signals, as the file holds them.

        Raises:
            LogError: columns that cannot be read together.
        """
        first, clocks = signals[0].name, set[str]()
        rows = len(self.columns[first])
        values = np.full((rows, len(signals)), np.nan)
        for k, signal in enumerate(signals):
            cells = self.columns[signal.name]
            if len(cells) != rows:
                what = f"holds {len(cells)} values, but column {first} holds {rows}"
                where = f"{self.source}, column {signal.name}"
                raise LogError(what, where=where, hint="all columns of a log have one clock: resample it")
            values[:, k], timed = _as_numbers(cells)
            if timed:
                clocks.add(signal.name)
        said = f"{', '.join(sorted(clocks))}: dates or times of day, taken as seconds from the first"
        lines = np.arange(1, rows + 1) if self.lines is None else self.lines
        torn = np.zeros(rows, bool) if self.torn is None else self.torn
        remarks = (*self.remarks, *([said] if clocks else []))
        return Recording(self, tuple(signals), values, lines, torn, frozenset(clocks), remarks)


def _as_numbers(cells: NDArray[Any]) -> tuple[Floats, bool]:
    """Return cells as numbers, NaN for those that hold none, and whether they are times from the first."""
    if cells.dtype.kind in "fiub":
        return cells.astype(np.float64), False
    if cells.dtype.kind == "M":
        there = ~np.isnat(cells)
        since = (cells - cells[there][:1]).astype("m8[ns]").astype(np.int64) if there.any() else 0
        return np.where(there, since / 1e9, np.nan), True
    texts = [str(cell) for cell in cells]
    if clock(next(filter(None, texts), "")) is None:
        return np.array([number(text) for text in texts], np.float64), False
    return seconds(texts), True


@dataclass(frozen=True, eq=False)
class Recording:
    """The used columns of one file, R rows of C signals.

    Attributes:
        table: the file.
        signals: of its columns; the first is the time.
        values: shape (R, C), NaN where the file holds no number.
        lines: line or row of the file [1-based] of each row, shape (R,).
        torn: as in the table, shape (R,).
        clocks: columns that hold dates or times of day: their values are seconds from the first.
        remarks: what the reader did to get these numbers.
    """

    table: Table
    signals: tuple[Signal, ...]
    values: Floats
    lines: NDArray[np.int64]
    torn: NDArray[np.bool_]
    clocks: frozenset[str] = frozenset()
    remarks: tuple[str, ...] = ()

    @property
    def time(self) -> Floats:
        """Time [s], shape (R,)."""
        return self.values[:, 0]

    def take(self, rows: NDArray[np.int64]) -> "Recording":
        """Return a copy with these rows, in this order."""
        return replace(self, values=self.values[rows], lines=self.lines[rows], torn=self.torn[rows])

    def text(self, row: int, signal: Signal) -> str:
        """Return the text in a cell that holds no number; "" where it is empty, or the format has none."""
        cells, line = self.table.columns[signal.name], self.lines[row]
        at = line - 1 if self.table.lines is None else np.searchsorted(self.table.lines, line)
        return str(cells[at] or "") if cells.dtype.kind == "O" else ""

    def finding(
        self,
        level: Level,
        kind: str,
        rows: Sequence[int] | NDArray[np.int64] = (),
        signal: Signal | None = None,
        subject: object = None,
        **numbers: Any,
    ) -> LogFinding:
        """Make a finding at the first of `rows`, about a signal or another subject; it counts the others."""
        more, word = "", "line" if self.table.header else "row"
        if len(rows) > 1:
            more = f" (and {len(rows) - 1} more, to {word} {self.lines[rows[-1]]})"
        place = word, int(self.lines[rows[0]]) if len(rows) else None, signal.name if signal else ""
        subjects = [subject or signal] if signal else []
        return log_finding(level, kind, self.table.source, subjects, place, rows=more, **numbers)


def optional_package(package: str, extra: str, source: str) -> Any:
    """Import a package that only some file formats need.

    Raises:
        LogError: it is not installed.
    """
    try:
        return import_module(package)
    except ImportError:
        what = f"needs the package {package.partition('.')[0]}, which is not installed"
        raise LogError(what, where=source, hint=f"pip install 'hydroid[{extra}]'") from None


@contextmanager
def readable(path: Path, kind: str) -> Generator[None]:
    """Turn what a format's library raises on damaged bytes, errors of any kind, into one line."""
    try:
        yield
    except LogError:
        raise
    except Exception as error:
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        what = f"cannot be read as {kind} ({reason})"
        raise LogError(what, where=str(path), hint="save it again") from None
