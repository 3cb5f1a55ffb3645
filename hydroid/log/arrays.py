"""Files that hold arrays -> a table: MATLAB's .mat (v4 to v7 by scipy, v7.3 by h5py), Parquet by pyarrow.

A vector is a column of the variable's name; column k of a matrix is `name[k]`, counted from 1, and its longer
axis is the time; fields of structs follow after a dot; element k of a struct array is `name[k]`. Two structs
are read by what they mean: Simulink's "structure with time" (`log.time`, signals by label: `log.boom`),
and structs with the fields Name and Data, as ControlDesk writes them: each is a column of its Name.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import LogError
from hydroid.log.table import ArrayTable, optional_package, readable

Columns = dict[str, NDArray[Any]]
OBJECTS = (
    "objects such as timeseries can only be read by MATLAB: there, save their arrays with "
    "time = {0}.Time; data = {0}.Data; save('arrays.mat', 'time', 'data')"
)


def open_mat(path: Path, *, hdf5: bool) -> ArrayTable:
    """Read all variables of a file; `hdf5`: it is of version 7.3.

    Raises:
        LogError: it is damaged, has no arrays, or needs a package that is not installed.
    """
    variables = (_read_hdf5 if hdf5 else _read_mat)(path)
    columns: Columns = dict(pair for name, value in variables.items() for pair in _columns(name, value))
    objects = [name for name, value in variables.items() if value is None]
    hint = OBJECTS.format(*objects[:1]) if objects else "save commands, angles and time as arrays or structs"
    if not columns:
        raise LogError("holds no array of numbers", where=str(path), hint=hint)
    remarks = (f"{', '.join(objects)}: {hint}",) if objects else ()
    layout = f"MATLAB file (v{'7.3' if hdf5 else '4 to 7'})"
    return ArrayTable(source=str(path), layout=layout, names=tuple(columns), columns=columns, remarks=remarks)


def open_parquet(path: Path) -> ArrayTable:
    """Read all columns of a file; timestamps become seconds from the first.

    Raises:
        LogError: it is damaged, or pyarrow is not installed.
    """
    arrow = optional_package("pyarrow", "parquet", str(path))
    parquet = optional_package("pyarrow.parquet", "parquet", str(path))
    columns, clocks = Columns(), set[str]()
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
    """Yield the columns of one variable, by name."""
    if isinstance(value, list):
        value = {f"[{k}]": inner for k, inner in enumerate(value, 1)}
    if isinstance(value, dict):
        if isinstance(value.get("Name"), str) and "Data" in value:
            name, value = value["Name"].strip("'\" ") or f"{name}.Data", {"": value["Data"]}
        elif _is_numbers(value.get("time")) and (signals := _simulink_signals(value.get("signals"))):
            value = {"time": np.ravel(value["time"])} | signals
        for field, inner in value.items():
            yield from _columns(name + (field if field[:1] in ("", "[") else f".{field}"), inner)
    elif _is_numbers(value) and value.size > 1:
        array = value.squeeze()
        array = array.T if array.ndim == 2 and array.shape[0] < array.shape[1] else array
        parts = array.reshape(len(array), -1).T
        for k, values in enumerate(parts, 1):
            yield (name if len(parts) == 1 else f"{name}[{k}]"), values


def _is_numbers(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind in "fiub"


def _simulink_signals(signals: Any) -> dict[str, Any]:
    """Return the values of the signals of a "structure with time" by label; {}: it is another struct."""
    parts = signals if isinstance(signals, list) else [signals]
    if not all(isinstance(part, dict) and "values" in part for part in parts):
        return {}
    labels = [part.get("label") for part in parts]
    names = [
        label if isinstance(label, str) and label else f"signals[{k}]" for k, label in enumerate(labels, 1)
    ]
    return {name: part["values"] for name, part in zip(names, parts, strict=True)}


def _read_mat(path: Path) -> Mapping[str, Any]:
    from scipy.io import loadmat

    with readable(path, "a MATLAB file"):
        variables = loadmat(str(path), simplify_cells=True)
    kept = {name: _plain(value) for name, value in variables.items() if not name.startswith("__")}
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


def _read_hdf5(path: Path) -> Mapping[str, Any]:
    h5py = optional_package("h5py", "mat", str(path))

    def plain(item: Any) -> Any:
        """Return an item as scipy does: arrays are stored transposed, text as numbers, structs as groups."""
        kind = item.attrs.get("MATLAB_class", b"")
        kind = kind.decode() if isinstance(kind, bytes) else str(kind)
        if isinstance(item, h5py.Group):
            fields = {name: plain(item[name]) for name in item}
            if {*map(type, fields.values())} == {list} and len({*map(len, fields.values())}) == 1:
                return [dict(zip(fields, row, strict=True)) for row in zip(*fields.values(), strict=True)]
            return fields
        if item.attrs.get("MATLAB_empty", 0):
            return "" if kind == "char" else np.zeros(0)
        if kind == "char":
            return "".join(map(chr, np.ravel(item[()])))
        if h5py.check_ref_dtype(item.dtype) is not None:
            return [plain(file[reference]) for reference in np.ravel(item[()], order="F")]
        numbers = kind in ("", "double", "single", "logical") or kind.removeprefix("u").startswith("int")
        return np.asarray(item[()]).T.squeeze() if numbers else None

    with readable(path, "a MATLAB file"), h5py.File(path, "r") as file:
        return {name: plain(file[name]) for name in file if not name.startswith("#")}
