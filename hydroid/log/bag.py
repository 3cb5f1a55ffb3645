"""ROS 1 and 2 bags and MCAP -> a table, by rosbags: channels with clocks of their own, brought to one.

A column is a topic and a field: `/joint_states.position[boom]`. What stands in brackets is a name in the
message's `name` field (as in sensor_msgs/JointState), or else a number, counted from 1. Each message has the
time of its header's stamp, or else that of its recording. All channels are resampled to the period of the
settings, over the time that all interpolated ones have: angles are interpolated, commands held. The time
column has the name that the settings give it.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from hydroid.arrays import Array
from hydroid.errors import LogError
from hydroid.log.repair import hold
from hydroid.log.table import Recording, Signal, Table, format_library


@dataclass(frozen=True, eq=False, kw_only=True)
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
            raise LogError("the channels have no common time", where=self.source, hint=hint)
        grid = self.period * np.arange(int((end - start) / (1e9 * self.period) + 1e-6) + 1, dtype=np.float64)
        columns = {time: grid}
        for name, times in at.items():
            values = np.array([self.channels[name][key] for key in times.tolist()])
            columns[name] = _resampled((times - start) / 1e9, values, grid, held=held[name])
        topics = ", ".join(sorted({name.partition(".")[0] for name in held}))
        remarks = (f"{topics}: resampled to {self.period:g} s",)
        return Table(source=self.source, names=self.names, columns=columns, remarks=remarks).read(signals)


def open_bag(path: Path, time: str, period: float) -> BagTable:
    """Read the channels of a bag; `time` is the name of its time column, `period` that of its rows [s].

    Raises:
        LogError: it is damaged, has no channel of numbers, or rosbags is not installed.
    """
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
        raise LogError("holds no channel of numbers", where=path)
    return BagTable(source=str(path), names=(time, *channels), channels=channels, period=period)


def _resampled(at: Array, values: Array, grid: Array, *, held: bool) -> Array:
    """Return values at other times [s]; NaN between messages that are too far apart."""
    if held or len(at) == 1:
        return hold(at, values[:, None], grid, grid[1])[:, 0]
    after = np.searchsorted(at, grid - 1e-9).clip(1, len(at) - 1)
    # a hole is longer than 0.1 s, or than three usual steps of the topic if these are longer
    far = np.diff(at)[after - 1] > max(0.1, 3 * np.median(np.diff(at)))
    between = (grid > at[after - 1] + 1e-9) & (grid < at[after] - 1e-9)
    return np.where(far & between, np.nan, np.interp(grid, at, values))


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
