"""Formats of arrays -> a table: .mat (v4 to v7 by scipy, v7.3 by h5py), and Parquet by pyarrow.

Of a .mat a vector is a column of the variable's name; column k of a matrix is `name[k]`, from 1, and its
longer axis is the time; fields of structs follow after a dot; element k of a cell array is `name[k]`.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import LogError
from hydroid.log.bags import open_bag
from hydroid.log.table import Table, format_library
from hydroid.settings.log import LogSettings
from hydroid.words import listed


def open_mat(path: Path, _settings: LogSettings) -> Table:
    """Read all variables of a file, which is HDF5 from version 7.3 on."""
    hdf5 = HDF5 in first_bytes(path)
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
        raise LogError("holds no array of numbers", path, hint)
    return Table(source=str(path), names=tuple(columns), columns=columns)


def open_parquet(path: Path, _settings: LogSettings) -> Table:
    """Read all columns of a file."""
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


def first_bytes(path: Path) -> bytes:
    """Return as many as tell the format of a file."""
    with path.open("rb") as file:
        return file.read(520)  # MATLAB's HDF5 begins at 512


HDF5 = b"\x89HDF\r\n\x1a\n"
BINARY = {
    "Parquet": (open_parquet, (b"PAR1",)),
    "ROS bag": (open_bag, (b"#ROSBAG V", b"SQLite format 3")),
    "MCAP": (open_bag, (b"\x89MCAP0",)),
    ".mat": (open_mat, (b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file", HDF5)),
}
"""by a format's name: what reads a file with the log's settings, and how such files begin; a name that is an
ending marks a file as well, and comes last: the bytes count first"""
FORMATS = listed(["CSV", *BINARY])
"""all formats that are read, for `--help` and messages"""
