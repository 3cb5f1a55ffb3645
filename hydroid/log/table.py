"""What every file format is read as: a table of named columns, which yields the numbers of some of them."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, Protocol

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


class Table(Protocol):
    """Named columns of one file.

    Attributes:
        source: the file.
        layout: its format in a few words, such as "CSV separated by semicolons".
        place: what its rows are called where a fault is reported: "line" or "row".
        header: line of the names [1-based]; None where the format stores them.
        names: of the columns, in order; "" for one without.
        units: that the file gives to columns, by name.
        remarks: what the reader skipped and what it took parts of the file for.
    """

    @property
    def source(self) -> str: ...  # noqa: D102
    @property
    def layout(self) -> str: ...  # noqa: D102
    @property
    def place(self) -> str: ...  # noqa: D102
    @property
    def header(self) -> int | None: ...  # noqa: D102
    @property
    def names(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def units(self) -> Mapping[str, str]: ...  # noqa: D102
    @property
    def remarks(self) -> tuple[str, ...]: ...  # noqa: D102

    def read(self, columns: Sequence[str], held: Collection[str] = ()) -> Cells:
        """Read columns; `held` names those that keep their value until the next sample, as commands do."""
        ...

    def text(self, row: int, column: str) -> str:
        """Return what stands in a row [1-based] of a column; "" where nothing does."""
        ...


@dataclass(frozen=True, eq=False)
class ArrayTable:
    """Columns that are in memory, all of one length, shape (R,) each; text has the dtype object."""

    source: str
    layout: str
    columns: Mapping[str, NDArray[Any]]
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    remarks: tuple[str, ...] = ()
    clocks: frozenset[str] = frozenset()
    place: str = "row"
    header: int | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns, in order."""
        return tuple(self.columns)

    def read(self, columns: Sequence[str], held: Collection[str] = ()) -> Cells:
        """Read columns, as `Table` says.

        Raises:
            LogError: a column holds text, or the columns have different lengths.
        """
        first = len(self.columns[columns[0]])
        for name in columns:
            values = self.columns[name]
            where = f"{self.source}, column {name}"
            if values.dtype.kind not in "fiub":
                example = str(values[0])[:30] if len(values) else ""
                raise LogError(f"holds text, such as {example!r}", where=where, hint="store it as numbers")
            if len(values) != first:
                what = f"holds {len(values)} values, but column {columns[0]} holds {first}"
                raise LogError(what, where=where, hint="all columns of a log have one clock: resample it")
        values = np.stack([self.columns[name].astype(np.float64) for name in columns], axis=1)
        return Cells(
            values,
            np.arange(1, first + 1),
            np.zeros(first, bool),
            self.clocks.intersection(columns),
        )

    def text(self, row: int, column: str) -> str:
        """Return a value, as `Table` says."""
        value = self.columns[column][row - 1]
        return "" if value != value else str(value)


def optional_package(package: str, extra: str, source: str) -> Any:
    """Import a package that only some file formats need.

    Raises:
        LogError: it is not installed.
    """
    try:
        return import_module(package)
    except ImportError:
        name = package.partition(".")[0]
        what = f"needs the package {name}, which is not installed"
        raise LogError(what, where=source, hint=f"pip install 'hydroid[{extra}]'") from None
