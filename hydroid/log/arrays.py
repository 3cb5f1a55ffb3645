"""Files that hold arrays -> a table: MATLAB's .mat (v4 to v7 by scipy, v7.3 by h5py), Parquet by pyarrow.

A vector is a column of the variable's name; column k of a matrix is `name[k]`, counted from 1, and its
longer axis is the time; fields of structs follow after a dot; element k of a cell array is `name[k]`.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import LogError
from hydroid.log.table import Recording, Signal, Table, in_rows, optional_package, readable


@dataclass(frozen=True, eq=False, kw_only=True)
class ArrayTable(Table):
    """Columns that are in memory, shape (R,) each; text has the dtype object."""

    columns: Mapping[str, NDArray[Any]]
    clocks: frozenset[str] = frozenset()

    def read(self, signals: Sequence[Signal]) -> Recording:
        """Read columns, which must be numbers of one length."""
        first, *_ = names = [signal.name for signal in signals]
        rows = len(self.columns[first])
        for name in names:
            values, where = self.columns[name], f"{self.source}, column {name}"
            if values.dtype.kind not in "fiub":
                example = str(values[0])[:30] if len(values) else ""
                raise LogError(f"holds text, such as {example!r}", where=where, hint="store it as numbers")
            if len(values) != rows:
                what = f"holds {len(values)} values, but column {first} holds {rows}"
                raise LogError(what, where=where, hint="all columns of a log have one clock: resample it")
        values = np.stack([self.columns[name].astype(np.float64) for name in names], axis=1)
        return in_rows(self, signals, values, clocks=self.clocks.intersection(names))


def open_mat(path: Path, *, hdf5: bool) -> ArrayTable:
    """Read all variables of a file; `hdf5`: it is of version 7.3.

    Raises:
        LogError: it is damaged, has no arrays, or needs a package that is not installed.
    """
    with readable(path, "a MATLAB file"):
        if hdf5:
            columns = dict(_hdf5_columns(path))
        else:
            from scipy.io import loadmat

            columns = dict(_columns("", loadmat(str(path), simplify_cells=True)))
    if not columns:
        hint = (
            "save commands, angles and time as arrays or structs; of a timeseries ts in MATLAB: "
            "time = ts.Time; data = ts.Data; save('arrays.mat', 'time', 'data')"
        )
        raise LogError("holds no array of numbers", where=str(path), hint=hint)
    layout = f"MATLAB file (v{'7.3' if hdf5 else '4 to 7'})"
    return ArrayTable(source=str(path), layout=layout, names=tuple(columns), columns=columns)


def open_parquet(path: Path) -> ArrayTable:
    """Read all columns of a file; timestamps become seconds from the first.

    Raises:
        LogError: it is damaged, or pyarrow is not installed.
    """
    arrow = optional_package("pyarrow", "parquet", str(path))
    parquet = optional_package("pyarrow.parquet", "parquet", str(path))
    columns, clocks = dict[str, NDArray[Any]](), set[str]()
    with readable(path, "Parquet"):
        table = parquet.read_table(str(path))
        for name, column in zip(table.column_names, table.columns, strict=True):
            kind, is_a = column.type, arrow.types
            if is_a.is_timestamp(kind):
                stamps = column.cast(arrow.timestamp("ns", kind.tz)).to_numpy()
                there = ~np.isnat(stamps)
                since = (stamps - stamps[there][:1]).astype(np.int64) if there.any() else 0
                columns[name] = np.where(there, since / 1e9, np.nan)
                clocks.add(name)
            elif (is_a.is_primitive(kind) and not is_a.is_temporal(kind)) or is_a.is_decimal(kind):
                columns[name] = column.cast("float64", safe=False).to_numpy()
            else:
                columns[name] = np.array([*column.to_pylist(), None], dtype=object)[:-1]
    return ArrayTable(
        source=str(path), layout="Parquet", names=tuple(columns), columns=columns, clocks=frozenset(clocks)
    )


def _columns(name: str, value: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the columns of one variable, by name; of a file all but MATLAB's own."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if not key.startswith("__"):
                yield from _columns(f"{name}.{key}" if name else key, inner)
    elif isinstance(value, list) or getattr(value, "dtype", None) == "O":
        for k, inner in enumerate(value, 1):
            yield from _columns(f"{name}[{k}]", inner)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.size > 1:
        array = value.squeeze()
        array = array.T if array.ndim == 2 and array.shape[0] < array.shape[1] else array
        parts = array.reshape(len(array), -1).T
        for k, values in enumerate(parts, 1):
            yield (name if len(parts) == 1 else f"{name}[{k}]"), values


def _hdf5_columns(path: Path) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the columns of a v7.3 file: its arrays are stored transposed, its structs as groups."""
    h5py = optional_package("h5py", "mat", str(path))
    found = dict[str, Any]()
    with h5py.File(path, "r") as file:
        file.visititems(found.__setitem__)
        for name, item in found.items():
            text = item.attrs.get("MATLAB_class") == b"char" or "MATLAB_empty" in item.attrs
            if isinstance(item, h5py.Dataset) and not text and not name.startswith("#"):
                yield from _columns(name.replace("/", "."), np.asarray(item[()]).T)
