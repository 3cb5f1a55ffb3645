"""ROS 1 and 2 bags and MCAP -> a table, by rosbags: channels with clocks of their own, brought to one.

A column is a topic and a field: `/joint_states.position[boom]`. What stands in brackets is a name in the
message's `name` field (as in sensor_msgs/JointState), or else a number, counted from 1. Each message has the
time of its header's stamp, or else that of its recording. All channels are resampled to the period of the
settings, over the time that all interpolated ones have: angles are interpolated, commands held. The time
column has the name that the settings give it.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from hydroid.errors import LogError
from hydroid.log.log import Floats
from hydroid.log.repair import hold
from hydroid.log.table import Recording, Signal, Table, in_rows, optional_package, readable


@dataclass(frozen=True, eq=False, kw_only=True)
class BagTable(Table):
    """The channels of a bag, by column their topic; its rows are at `period` [s]."""

    topics: Mapping[str, str]
    period: float

    def read(self, signals: Sequence[Signal]) -> Recording:
        """Read columns; those that share no time are refused, and so is a damaged message."""
        time, *names = self.names
        held = {s.name: s.kind == "command" for s in signals if s.name != time} or {names[0]: False}
        topics = sorted({self.topics[name] for name in held})
        samples, unstamped = dict[str, dict[int, float]](), set[str]()
        for topic, stamp, recorded, numbers in _messages(Path(self.source), topics):
            unstamped |= set() if stamp else {topic}
            for name in numbers.keys() & held.keys():
                samples.setdefault(name, {}).setdefault(stamp or recorded, numbers[name])
        if missing := [name for name in held if name not in samples]:
            raise LogError("holds no message", where=f"{self.source}, column {missing[0]}")
        at = {name: np.array(sorted(of_name)) for name, of_name in samples.items()}
        smooth = [at[name] for name in held if not held[name] and len(at[name]) > 1] or [*at.values()]
        start, end = max(int(times[0]) for times in smooth), min(int(times[-1]) for times in smooth)
        if end - start < self.period * 1e9:
            hint = "record them together, with one clock"
            raise LogError("the channels have no common time", where=self.source, hint=hint)
        rows = int((end - start) / (1e9 * self.period) + 1e-6) + 1
        grid = np.arange(rows, dtype=np.float64) * self.period
        series = {time: grid}
        for name, times in at.items():
            values = np.array([samples[name][key] for key in times.tolist()])
            series[name] = _resampled((times - start) / 1e9, values, grid, held=held[name])
        said = (
            (topics, f"resampled to {self.period:g} s"),
            (sorted(unstamped), "no header stamp, so the time of recording counts"),
            ([name for name in held if held[name] and at[name][0] > start], "0 until the first message"),
        )
        remarks = tuple(f"{', '.join(columns)}: {what}" for columns, what in said if columns)
        values = np.stack([series[signal.name] for signal in signals], axis=1)
        return in_rows(self, signals, values, remarks=remarks)


def open_bag(path: Path, time: str, period: float) -> BagTable:
    """Find the channels of a bag; `time` is the name of its time column, `period` that of its rows [s].

    Raises:
        LogError: it is damaged, has no channel of numbers, or rosbags is not installed.
    """
    topics = {name: topic for topic, _, _, numbers in _messages(path, first=20) for name in numbers}
    if not topics:
        raise LogError("holds no channel of numbers", where=str(path))
    layout = {".bag": "ROS 1 bag", ".mcap": "MCAP"}.get(path.suffix, "ROS 2 bag")
    return BagTable(source=str(path), layout=layout, names=(time, *topics), topics=topics, period=period)


def _resampled(at: Floats, values: Floats, grid: Floats, *, held: bool) -> Floats:
    """Return values at other times [s]; NaN between messages that are too far apart."""
    if held or len(at) == 1:
        return hold(at, values[:, None], grid, grid[1])[:, 0]
    after = np.searchsorted(at, grid - 1e-9).clip(1, len(at) - 1)
    # a hole is longer than 0.1 s, or than three usual steps of the topic if these are longer
    far = np.diff(at)[after - 1] > max(0.1, 3 * float(np.median(np.diff(at))))
    between = (grid > at[after - 1] + 1e-9) & (grid < at[after] - 1e-9)
    return np.where(far & between, np.nan, np.interp(grid, at, values))


def _messages(
    path: Path, topics: Collection[str] | None = None, first: int | None = None
) -> Iterator[tuple[str, int, int, dict[str, float]]]:
    """Yield topic, stamp (0: none) and time of recording [ns], and numbers by column, of messages.

    Of all topics or some, of each all messages or the `first` ones.
    """
    highlevel = optional_package("rosbags.highlevel", "ros", str(path))
    typesys = optional_package("rosbags.typesys", "ros", str(path))
    latest = typesys.get_typestore(typesys.Stores.LATEST)  # for bags that do not hold their definitions
    with readable(path, "a bag"), highlevel.AnyReader([path], default_typestore=latest) as reader:
        for connection in reader.connections:
            topic = connection.topic
            if topics is None or topic in topics:
                for _, recorded, data in islice(reader.messages(connections=[connection]), first):
                    if len(data) > 20_000:
                        continue  # an image or a point cloud
                    message = reader.deserialize(data, connection.msgtype)
                    stamp = getattr(getattr(message, "header", None), "stamp", None)
                    stamp = 0 if stamp is None else int(stamp.sec) * 10**9 + int(stamp.nanosec)
                    yield topic, stamp, recorded, dict(_numbers(message, f"{topic}."))


def _numbers(message: Any, prefix: str) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message by name, without those of its header; of an array the first 64."""
    labels = getattr(message, "name", None)
    for slot in fields(message):
        if slot.name == "header" or slot.name.startswith("__"):
            continue
        value, name = getattr(message, slot.name), prefix + slot.name
        parts = {name: value}
        if isinstance(value, np.ndarray | list):
            named = isinstance(labels, list) and len(labels) == len(value)
            keys: Any = labels if named else range(1, len(value) + 1)
            parts = {f"{name}[{key}]": part for key, part in zip(keys, value[:64], strict=False)}
        for key, part in parts.items():
            if isinstance(part, bool | int | float | np.number | np.bool_):
                yield key, float(part)
            elif is_dataclass(part):
                yield from _numbers(part, f"{key}.")
