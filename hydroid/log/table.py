"""What every file format is read as: a table of named columns, which yields the numbers of some of them."""

from collections.abc import Collection, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import LogError
from hydroid.log.log import Floats


@dataclass(frozen=True, eq=False)
class Cells:
    """R rows of C columns.

    Attributes:
        values: as the file holds them, shape (R, C), NaN where a cell holds no number.
        rows: line or row of the file [1-based] of each, shape (R,).
        ragged: rows that have more or fewer cells than the table has columns, shape (R,).
        clocks: columns that hold dates or times of day: their values are seconds from the first.
        remarks: what the reader did to get these numbers.
    """

    values: Floats
    rows: NDArray[np.int64]
    ragged: NDArray[np.bool_]
    clocks: frozenset[str] = frozenset()
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False, kw_only=True)
class Table:
    """Named columns of one file; each format has its subclass.

    Attributes:
        source: the file.
        layout: its format in a few words, such as "CSV separated by semicolons".
        names: of the columns, in order; "" for one without.
        place: what its rows are called where a fault is reported: "line" or "row".
        header: line of the names [1-based]; None where the format stores them.
        units: that the file gives to columns, by name.
        remarks: what the reader skipped and what it took parts of the file for.
    """

    source: str
    layout: str
    names: tuple[str, ...]
    place: str = "row"
    header: int | None = None
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    remarks: tuple[str, ...] = ()

    def read(self, columns: Sequence[str], held: Collection[str] = ()) -> Cells:
        """Read columns; `held` names those that keep their value until the next sample, as commands do.

        Raises:
            LogError: columns that cannot be read together.
        """
        raise NotImplementedError

    def text(self, row: int, column: str) -> str:
        """Return what stands in a row [1-based] of a column that holds no number; "" where nothing does."""
        return ""


@dataclass(frozen=True, eq=False, kw_only=True)
class ArrayTable(Table):
    """Columns that are in memory, shape (R,) each; text has the dtype object."""

    columns: Mapping[str, NDArray[Any]]
    clocks: frozenset[str] = frozenset()

    def read(self, columns: Sequence[str], held: Collection[str] = ()) -> Cells:
        """Read columns, which must be numbers of one length."""
        rows = len(self.columns[columns[0]])
        for name in columns:
            values, where = self.columns[name], f"{self.source}, column {name}"
            if values.dtype.kind not in "fiub":
                example = str(values[0])[:30] if len(values) else ""
                raise LogError(f"holds text, such as {example!r}", where=where, hint="store it as numbers")
            if len(values) != rows:
                what = f"holds {len(values)} values, but column {columns[0]} holds {rows}"
                raise LogError(what, where=where, hint="all columns of a log have one clock: resample it")
        values = np.stack([self.columns[name].astype(np.float64) for name in columns], axis=1)
        clocks = self.clocks.intersection(columns)
        return Cells(values, np.arange(1, rows + 1), np.zeros(rows, bool), clocks)


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
