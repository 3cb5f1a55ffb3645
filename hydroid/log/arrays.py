"""Files that hold arrays -> a table: MATLAB's .mat (v4 to v7 by scipy, v7.3 by h5py), Parquet by pyarrow.

A vector is a column of the variable's name; column k of a matrix is `name[k]`, counted from 1, and its
longer axis is the time; fields of structs follow after a dot; element k of a cell array is `name[k]`.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import LogError
from hydroid.log.table import Table, format_library


def open_mat(path: Path, *, hdf5: bool) -> Table:
    """Read all variables of a file; `hdf5`: it is of version 7.3.

    Raises:
        LogError: it is damaged, has no arrays, or needs a package that is not installed.
    """
    package = "h5py" if hdf5 else "scipy.io"
    with format_library(package, "mat", path, "a MATLAB file") as library:
        if hdf5:
            with library.File(path, "r") as file:
                variables = _without_hdf5(file)
        else:
            variables = library.loadmat(str(path), simplify_cells=True)
        columns = dict(_columns("", variables))
    if not columns:
        hint = (
            "save commands, angles and time as arrays or structs; of a timeseries ts in MATLAB: "
            "time = ts.Time; data = ts.Data; save('arrays.mat', 'time', 'data')"
        )
        raise LogError("holds no array of numbers", where=path, hint=hint)
    return Table(source=str(path), names=tuple(columns), columns=columns)


def open_parquet(path: Path) -> Table:
    """Read all columns of a file.

    Raises:
        LogError: it is damaged, or pyarrow is not installed.
    """
    with format_library("pyarrow.parquet", "parquet", path, "Parquet") as parquet:
        table = parquet.read_table(str(path))
        columns = {name: table[name].to_numpy() for name in table.column_names}
    return Table(source=str(path), names=tuple(columns), columns=columns)


def _columns(name: str, value: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the columns of one variable, by name; of a file all but MATLAB's own."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if not key.startswith(("__", "#")):
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


def _without_hdf5(item: Any) -> Any:
    """Return a group as a dict and an array as MATLAB shows it: a v7.3 file stores arrays transposed."""
    if hasattr(item, "items"):
        return {name: _without_hdf5(inner) for name, inner in item.items()}
    text = item.attrs.get("MATLAB_class") == b"char" or "MATLAB_empty" in item.attrs
    return None if text or item.dtype.kind not in "fiub" else np.asarray(item[()]).T
