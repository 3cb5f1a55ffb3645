"""Formats of arrays -> a table: .mat (v4 to v7 by scipy, v7.3 by h5py), Parquet by
pyarrow; all formats.

Of a .mat a vector is a column of the variable's name; column k of a matrix is
`name[k]`, from 1, and its longer axis is the time; fields of structs follow after a
dot; element k of a cell array is `name[k]`.
"""

from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydroid.arrays import record
from hydroid.errors import LogError
from hydroid.log.bags import open_bag
from hydroid.log.mat5 import large_variables
from hydroid.log.table import (
    MOST_NUMBERS,
    Table,
    TextColumn,
    format_library,
    refuse_large,
)
from hydroid.progress import Progress
from hydroid.settings.log import LogSettings
from hydroid.words import listed

TEXTS = ("string", "large_string", "binary", "large_binary")
"""types of columns of text in a Parquet file; others hold numbers or times"""
TEXTS_AT_ONCE = 1024
"""cells of a column of text that are held at a time"""
NUMBERS = "fiub"
"""numpy's kinds of numbers: floats, integers with and without sign, Booleans"""


def open_mat(path: Path, _settings: LogSettings, _progress: Progress) -> Table:
    """Read all variables of a file, which is HDF5 from version 7.3 on."""
    hdf5 = HDF5 in first_bytes(path)
    package = "h5py" if hdf5 else "scipy.io"
    large = list[str]()
    with format_library(package, "mat", path, "a MATLAB file") as library:
        if hdf5:
            with library.File(path, "r") as file:
                variables = _without_hdf5(file, large)
        else:
            names = [name for name, *_ in library.whosmat(str(path))]
            large += large_variables(path, names, 8 * MOST_NUMBERS)
            wanted = [name for name in names if name not in large]
            variables = library.loadmat(
                str(path), simplify_cells=True, variable_names=wanted
            )
        columns = dict(_columns("", variables))
    too_many = f"holds more than {MOST_NUMBERS:,} numbers and is left out"
    remarks = tuple(f"{name} {too_many}" for name in large)
    if not columns and large:
        raise LogError(remarks[0], path, "save what is needed of it")
    if not columns:
        hint = (
            "save commands, angles and time as arrays or structs; of a timeseries ts in MATLAB: "
            "time = ts.Time; data = ts.Data; save('arrays.mat', 'time', 'data')"
        )
        raise LogError("holds no array of numbers", path, hint)
    return Table(
        source=str(path), names=tuple(columns), columns=columns, remarks=remarks
    )


@record
class ParquetTable(Table):
    """Columns of a Parquet file, each of which is read where it is used."""

    def text(self, name: str, row: int) -> str:
        """Read a cell anew, for a message."""
        assert isinstance(self.columns, ParquetColumns)
        cell = self.columns.cell(name, row)
        return cell if isinstance(cell, str) else ""


class ParquetColumns(Mapping[str, NDArray[Any]]):
    """The columns of a Parquet file by name; the last one that was read is kept."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._last: tuple[str, NDArray[Any]] | None = None
        with self._open() as file:
            refuse_large(str(path), file.metadata.num_rows, 1)
            fields = file.schema_arrow
            nested = set[str]()
            texts = set[str]()
            for field in fields:
                kind = str(field.type)
                if field.type.num_fields:
                    nested.add(field.name)
                # also of dictionaries, which hold equal texts once
                if kind in TEXTS or "dict" in kind:
                    texts.add(field.name)
        self._names = [name for name in fields.names if name not in nested]
        self._texts = texts

    @contextmanager
    def _open(self) -> Generator[Any]:
        library = format_library("pyarrow.parquet", "parquet", self._path, "Parquet")
        with library as parquet, parquet.ParquetFile(str(self._path)) as file:
            yield file

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name not in self._names:
            raise KeyError(name)
        if self._last is None or self._last[0] != name:
            self._last = name, self._read(name)
        return self._last[1]

    def _read(self, name: str) -> NDArray[Any]:
        with self._open() as file:
            if name not in self._texts:
                return file.read(columns=[name])[name].to_numpy()
            column = TextColumn()
            for batch in file.iter_batches(TEXTS_AT_ONCE, columns=[name]):
                cells = batch.column(0).to_pylist()
                column.extend(["" if cell is None else str(cell) for cell in cells])
        return column.values()

    def cell(self, name: str, row: int) -> object:
        """Return one cell of a column of text; None of other columns."""
        if name not in self._texts:
            return None
        with self._open() as file:
            for batch in file.iter_batches(TEXTS_AT_ONCE, columns=[name]):
                if row < len(batch):
                    return batch.column(0)[row].as_py()
                row -= len(batch)
        return None


def open_parquet(path: Path, _settings: LogSettings, _progress: Progress) -> Table:
    """Open a file, whose columns are read where they are used."""
    columns = ParquetColumns(path)
    return ParquetTable(source=str(path), names=tuple(columns), columns=columns)


def _columns(name: str, value: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the columns of one variable, by name; of a file all but MATLAB's own."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if not key.startswith(("__", "#")):
                yield from _columns(f"{name}.{key}" if name else key, inner)
    elif isinstance(value, list) or getattr(value, "dtype", None) == "O":
        for k, inner in enumerate(value, 1):
            yield from _columns(f"{name}[{k}]", inner)
    elif isinstance(value, np.ndarray) and value.dtype.kind in NUMBERS:
        yield from _array_columns(name, value)


def _array_columns(
    name: str, array: NDArray[Any]
) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield a vector, or the columns of a matrix; a single number is a setting."""
    if array.size <= 1:
        return
    array = array.squeeze()
    # the longer axis is the time
    if array.ndim == 2 and array.shape[0] < array.shape[1]:
        array = array.T
    columns = array.reshape(len(array), -1).T
    if len(columns) == 1:
        yield name, columns[0]
        return
    for k, column in enumerate(columns, 1):
        yield f"{name}[{k}]", column


def _without_hdf5(item: Any, large: list[str]) -> Any:
    """Return a group as a dict and an array as MATLAB shows it: a v7.3 file stores
    arrays transposed.

    Names of arrays that are too large go to `large`.
    """
    if hasattr(item, "items"):
        return {name: _without_hdf5(inner, large) for name, inner in item.items()}
    # a link to an object that is not there, an array without a shape
    if item is None or item.size is None:
        return None
    if item.size > MOST_NUMBERS:
        large.append(item.name.lstrip("/"))
        return None
    is_text = item.attrs.get("MATLAB_class") == b"char"
    is_empty = "MATLAB_empty" in item.attrs
    if is_text or is_empty or item.dtype.kind not in NUMBERS:
        return None
    return np.asarray(item[()]).T


def first_bytes(path: Path) -> bytes:
    """Return as many as tell the format of a file."""
    with path.open("rb") as file:
        return file.read(520)  # MATLAB's HDF5 begins at 512


TableReader = Callable[[Path, LogSettings, Progress], Table]
HDF5 = b"\x89HDF\r\n\x1a\n"
BINARY: dict[str, tuple[TableReader, tuple[bytes, ...]]] = {
    "Parquet": (open_parquet, (b"PAR1",)),
    "ROS bag": (open_bag, (b"#ROSBAG V", b"SQLite format 3")),
    "MCAP": (open_bag, (b"\x89MCAP0",)),
    ".mat": (open_mat, (b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file", HDF5)),
}
"""by a format's name: what reads a file with the log's settings, and how such files
begin; a name that is an ending marks a file that begins as none does"""
FORMATS = listed(["CSV", *BINARY])
"""all formats that are read, for `--help` and messages"""
