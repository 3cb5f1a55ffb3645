"""Formats of logs besides CSV -> a table: .mat (v4 to v7 by scipy, v7.3 by h5py), Parquet by pyarrow, bags.

Of a .mat a vector is a column of the variable's name; column k of a matrix is `name[k]`, from 1, and its
longer axis is the time; fields of structs follow after a dot; element k of a cell array is `name[k]`.

ROS 1 and 2 bags and MCAP are read by rosbags: channels with clocks of their own, brought to one.

A column is a topic and a field: `/joint_states.position[boom]`. What stands in brackets is a name in the
message's `name` field (as in sensor_msgs/JointState), or else a number, counted from 1. Each message has the
time of its header's stamp, or else that of its recording. All channels are resampled to the period of the
settings, over the time that all interpolated ones have: angles are interpolated, commands held. The time
column has the name that the settings give it.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydroid.arrays import record
from hydroid.errors import LogError
from hydroid.log.repair import hold
from hydroid.log.table import Recording, Signal, Table, format_library
from hydroid.settings.log import LogSettings
from hydroid.words import listed


@record
class BagTable(Table):
    """The channels of a bag, by name: values by the time of their messages [ns]; rows are at `period` [s]."""

    channels: Mapping[str, Mapping[int, float]]
    period: float

    def read(self, signals: Sequence[Signal]) -> Recording:
        """Read columns; those that share no time are refused."""
        time, *names = self.names
        held = {s.name: s.kind == "command" for s in signals if s.name != time}
        held = held or {max(names, key=lambda name: len(self.channels[name])): False}
        at = {name: np.array(sorted(self.channels[name])) for name in held}
        smooth = [at[name] for name in held if not held[name] and len(at[name]) > 1] or [*at.values()]
        start, end = max(int(times[0]) for times in smooth), min(int(times[-1]) for times in smooth)
        if end - start < self.period * 1e9:
            hint = "record them together, with one clock"
            raise LogError("the channels have no common time", self.source, hint)
        grid = self.period * np.arange(int((end - start) / (1e9 * self.period) + 1e-6) + 1, dtype=np.float64)
        columns = {time: grid}
        for name, times in at.items():
            values = np.array([self.channels[name][key] for key in times.tolist()])
            seconds = (times - start) / 1e9
            if held[name] or len(times) == 1:
                columns[name] = hold(seconds, values[:, None], grid, grid[1])[:, 0]
                continue
            after = np.searchsorted(seconds, grid - 1e-9).clip(1, len(seconds) - 1)
            # a hole is longer than 0.1 s, or than three usual steps of the topic if these are longer
            far = np.diff(seconds)[after - 1] > max(0.1, 3 * np.median(np.diff(seconds)))
            between = (grid > seconds[after - 1] + 1e-9) & (grid < seconds[after] - 1e-9)
            columns[name] = np.where(far & between, np.nan, np.interp(grid, seconds, values))
        topics = ", ".join(sorted({name.partition(".")[0] for name in held}))
        remarks = (f"{topics}: resampled to {self.period:g} s",)
        return Table(source=self.source, names=self.names, columns=columns, remarks=remarks).read(signals)


def open_bag(path: Path, _data: bytes, settings: LogSettings) -> BagTable:
    """Read the channels of a bag."""
    channels = dict[str, dict[int, float]]()
    with format_library("rosbags.highlevel", "ros", path, "a bag") as rosbags:
        from rosbags.typesys import Stores, get_typestore

        latest = get_typestore(Stores.LATEST)  # for bags that do not hold their definitions
        with rosbags.AnyReader([path], default_typestore=latest) as reader:
            for connection, recorded, data in reader.messages():
                if len(data) > 20_000:
                    continue  # an image or a point cloud
                message = reader.deserialize(data, connection.msgtype)
                stamp = getattr(getattr(message, "header", None), "stamp", None)
                at = 0 if stamp is None else int(stamp.sec) * 10**9 + int(stamp.nanosec)
                for name, number in _numbers(message, f"{connection.topic}."):
                    channels.setdefault(name, {}).setdefault(at or recorded, number)
    if not channels:
        raise LogError("holds no channel of numbers", path)
    names = settings.time.column, *channels
    return BagTable(source=str(path), names=names, channels=channels, period=settings.period_s)


def _numbers(message: Any, prefix: str) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message by name, without those of its header; of an array the first 64."""
    labels = getattr(message, "name", None)
    for slot in fields(message):
        value, name = getattr(message, slot.name), prefix + slot.name
        parts = {name: value} if slot.name != "header" else {}
        if isinstance(value, np.ndarray | list):
            named = isinstance(labels, list) and len(labels) == len(value)
            keys: Any = labels if named else range(1, len(value) + 1)
            parts = {f"{name}[{key}]": part for key, part in zip(keys, value[:64], strict=False)}
        for key, part in parts.items():
            if isinstance(part, Real | np.bool_):
                yield key, float(part)
            elif is_dataclass(part):
                yield from _numbers(part, f"{key}.")


def open_mat(path: Path, data: bytes, _settings: LogSettings) -> Table:
    """Read all variables of a file, which is HDF5 from version 7.3 on."""
    hdf5 = HDF5 in data[:520]
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


def open_parquet(path: Path, _data: bytes, _settings: LogSettings) -> Table:
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


HDF5 = b"\x89HDF\r\n\x1a\n"
BINARY = {
    "Parquet": (open_parquet, (b"PAR1",)),
    "ROS bag": (open_bag, (b"#ROSBAG V", b"SQLite format 3")),
    "MCAP": (open_bag, (b"\x89MCAP0",)),
    ".mat": (open_mat, (b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file", HDF5)),
}
"""by a format's name: what reads a file, its bytes and the log's settings, and how such files begin; a name
that is an ending marks a file as well, and comes last: the bytes count first"""
FORMATS = listed(["CSV", *BINARY])
"""all formats that are read, for `--help` and messages"""
