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
from hydroid.log.finding import LogFinding, log_finding
from hydroid.log.log import Floats


@dataclass(frozen=True)
class Signal:
    """One column in use: value = gain · cell + offset in [s], [%], [rad] or [Pa], from `low` to `high`.

    `name` is that in the header, `joint` a number from 1, or 0 for the time. `part` is 0, or 1 for the column
    of a command's negative direction and of the pressure in chamber B. Values that are `slack` outside are
    used with a warning.
    """

    name: str
    kind: Literal["time", "command", "angle", "pressure"]
    joint: int = 0
    part: int = 0
    gain: float = 1.0
    offset: float = 0.0
    low: float = -np.inf
    high: float = np.inf
    slack: float = 0.0

    def __str__(self) -> str:
        return f"{self.kind} of joint {self.joint}" if self.joint else self.kind


@dataclass(frozen=True, eq=False, kw_only=True)
class Table:
    """Named columns of one file; each format has its subclass.

    Attributes:
        source: the file.
        layout: its format in a few words, such as "CSV separated by semicolons".
        names: of the columns, in order; "" for one without.
        header: line of the names [1-based]; None where the format stores them.
        units: that the file gives to columns, by name.
        remarks: what the reader skipped and what it took parts of the file for.
    """

    source: str
    layout: str
    names: tuple[str, ...]
    header: int | None = None
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    remarks: tuple[str, ...] = ()

    def read(self, signals: Sequence[Signal]) -> "Recording":
        """Read the columns of signals, as the file holds them.

        Raises:
            LogError: columns that cannot be read together.
        """
        raise NotImplementedError

    def text(self, row: int, column: str) -> str:
        """Return what stands in a row [1-based] of a column that holds no number; "" where nothing does."""
        return ""


@dataclass(frozen=True, eq=False)
class Recording:
    """The used columns of one file, R rows of C signals.

    Attributes:
        table: the file.
        signals: of its columns; the first is the time.
        values: shape (R, C), NaN where the file holds no number.
        lines: line or row of the file [1-based] of each row, shape (R,).
        ragged: rows that have more or fewer cells than the table has columns, shape (R,).
        clocks: columns that hold dates or times of day: their values are seconds from the first.
        remarks: what the reader did to get these numbers.
    """

    table: Table
    signals: tuple[Signal, ...]
    values: Floats
    lines: NDArray[np.int64]
    ragged: NDArray[np.bool_]
    clocks: frozenset[str] = frozenset()
    remarks: tuple[str, ...] = ()

    @property
    def time(self) -> Floats:
        """Time [s], shape (R,)."""
        return self.values[:, 0]

    def take(self, rows: NDArray[np.int64]) -> "Recording":
        """Return a copy with these rows, in this order."""
        return replace(self, values=self.values[rows], lines=self.lines[rows], ragged=self.ragged[rows])

    def finding(
        self,
        level: Level,
        kind: str,
        rows: Sequence[int] | NDArray[np.int64] = (),
        signal: Signal | None = None,
        subject: object = None,
        **numbers: Any,
    ) -> LogFinding:
        """Make a finding about a signal, or another subject, at the first of `rows`.

        Its number `rows` counts the others.
        """
        more, word = "", "line" if self.table.header else "row"
        if len(rows) > 1:
            more = f" (and {len(rows) - 1} more, to {word} {self.lines[rows[-1]]})"
        place = word, int(self.lines[rows[0]]) if len(rows) else None, signal.name if signal else ""
        subjects = [subject or signal] if signal else []
        return log_finding(level, kind, self.table.source, subjects, place, rows=more, **numbers)


def in_rows(table: Table, signals: Sequence[Signal], values: Floats, **more: Any) -> Recording:
    """Return the recording of a format whose rows are numbered from 1 and whole."""
    rows = len(values)
    return Recording(table, tuple(signals), values, np.arange(1, rows + 1), np.zeros(rows, bool), **more)


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
        raise LogError(
            f"cannot be read as {kind} ({reason})", where=str(path), hint="save it again"
        ) from None
