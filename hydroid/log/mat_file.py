"""MATLAB's .mat files (v4 to v7 by scipy, v7.3 by h5py) -> a table.

A vector is a column of the variable's name; column k of a matrix is `name[k]`, counted from 1, and its longer
axis is the time; fields of structs follow after a dot; element k of a struct array is `name[k]`. Two structs
are read by what they mean: Simulink's "structure with time" (`log.time`, signals by label: `log.boom`),
and structs with the fields Name and Data, as ControlDesk writes them: each is a column of its Name.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import LogError
from hydroid.log.table import ArrayTable, optional_package

LEAST = 2  # values of a variable that is a column
MAX_COLUMNS = 2000


def open_mat(path: Path, *, hdf5: bool) -> ArrayTable:
    """Read all variables of a file; `hdf5`: it is of version 7.3.

    Raises:
        LogError: it is damaged, has no arrays, or needs a package that is not installed.
    """
    variables = _read_hdf5(path) if hdf5 else _read_mat(path)
    columns = dict[str, NDArray[Any]]()
    for name, value in variables.items():
        for key, values in _columns(name, value):
            columns.setdefault(key, values)
            if len(columns) > MAX_COLUMNS:
                raise LogError(f"holds more than {MAX_COLUMNS} columns", where=str(path))
    if not columns:
        raise LogError("holds no array of numbers", where=str(path), hint=_objects(variables))
    left = [name for name, value in variables.items() if value is None]
    remarks = (f"{', '.join(left)}: {_objects(variables)}",) if left else ()
    version = "7.3" if hdf5 else "4 to 7"
    return ArrayTable(str(path), f"MATLAB file (v{version})", columns, {}, remarks)


def _objects(variables: Mapping[str, Any]) -> str:
    if any(value is None for value in variables.values()):
        name = next(name for name, value in variables.items() if value is None)
        return (
            "objects such as timeseries can only be read by MATLAB: there, save their arrays with "
            f"time = {name}.Time; data = {name}.Data; save('arrays.mat', 'time', 'data')"
        )
    return "save commands, angles and time as arrays or structs"


def _columns(name: str, value: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the columns of one variable, by name."""
    if isinstance(value, dict):
        if _is_simulink(value):
            yield f"{name}.time", np.ravel(value["time"])
            signals = value["signals"]
            for k, signal in enumerate(signals if isinstance(signals, list) else [signals], 1):
                label = signal.get("label")
                own = label if isinstance(label, str) and label else f"signals[{k}]"
                yield from _columns(f"{name}.{own}", signal["values"])
            return
        if isinstance(value.get("Name"), str) and "Data" in value:
            yield from _columns(value["Name"].strip("'\" ") or f"{name}.Data", value["Data"])
            return
        for field, inner in value.items():
            yield from _columns(f"{name}.{field}", inner)
    elif isinstance(value, list):
        for k, inner in enumerate(value, 1):
            yield from _columns(f"{name}[{k}]", inner)
    elif _is_numbers(value):
        array = value.squeeze()
        array = array.T if array.ndim == 2 and array.shape[0] < array.shape[1] else array
        if array.ndim and len(array) >= LEAST:
            parts = array.reshape(len(array), -1).T[: MAX_COLUMNS + 1]
            for k, values in enumerate(parts, 1):
                yield (name if len(parts) == 1 else f"{name}[{k}]"), values


def _is_simulink(value: Mapping[str, Any]) -> bool:
    signals = value.get("signals")
    parts = signals if isinstance(signals, list) else [signals]
    return _is_numbers(value.get("time")) and all(isinstance(s, dict) and "values" in s for s in parts)


def _is_numbers(value: Any) -> TypeGuard[NDArray[Any]]:
    return isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.ndim > 0


def _read_mat(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat

    try:
        variables = loadmat(str(path), simplify_cells=True)
    except Exception as error:  # damaged bytes make scipy raise errors of any kind
        raise _damaged(path, error) from None
    hidden = {"__header__", "__version__", "__globals__", "__function_workspace__"}
    kept = {name: _plain(value) for name, value in variables.items() if name not in hidden}
    if kept.get("None", 0) is None:  # scipy's name for an object, whose own name is in its first field
        kept |= {entry["s0"].decode(): kept.pop("None", None) for entry in np.ravel(variables["None"])}
    return kept


def _plain(value: Any) -> Any:
    """Return a value of scipy's with lists for struct arrays and cells, and None for MATLAB's objects."""
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if type(value).__name__ in ("MatlabOpaque", "MatlabFunction", "MatlabObject"):
        return None
    if isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object):
        return [_plain(inner) for inner in value]
    return value


def _read_hdf5(path: Path) -> dict[str, Any]:
    h5py = optional_package("h5py", "mat", str(path))
    try:
        with h5py.File(path, "r") as file:
            names = [name for name in file if not name.startswith("#")]
            return {name: _from_hdf5(h5py, file, file[name]) for name in names}
    except Exception as error:  # damaged bytes make h5py raise errors of any kind
        raise _damaged(path, error) from None


def _from_hdf5(h5py: Any, file: Any, item: Any) -> Any:
    """Return a variable as scipy does; arrays are stored transposed, text as numbers, structs as groups."""
    kind = item.attrs.get("MATLAB_class", b"")
    kind = kind.decode() if isinstance(kind, bytes) else str(kind)
    if isinstance(item, h5py.Group):
        fields = {name: _from_hdf5(h5py, file, item[name]) for name in item}
        lists = [value for value in fields.values() if isinstance(value, list)]
        if lists and len(lists) == len(fields) and len({len(value) for value in lists}) == 1:
            return [dict(zip(fields, row, strict=True)) for row in zip(*fields.values(), strict=True)]
        return fields
    if item.attrs.get("MATLAB_empty", 0):
        return "" if kind == "char" else np.zeros(0)
    if kind == "char":
        return "".join(map(chr, np.ravel(item[()])))
    if h5py.check_ref_dtype(item.dtype) is not None:
        return [_from_hdf5(h5py, file, file[reference]) for reference in np.ravel(item[()], order="F")]
    if kind and kind not in _NUMBERS:
        return None
    return np.asarray(item[()]).T.squeeze()


_NUMBERS = {"double", "single", "logical", *(f"{u}int{bits}" for u in ("", "u") for bits in (8, 16, 32, 64))}


def _damaged(path: Path, error: Exception) -> LogError:
    reason = " ".join(str(error).split())[:200] or type(error).__name__
    return LogError(f"cannot be read as a MATLAB file ({reason})", where=str(path), hint="save it again")
