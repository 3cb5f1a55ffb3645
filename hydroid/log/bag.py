"""ROS 1 and 2 bags and MCAP -> a table, by rosbags: channels with clocks of their own, brought to one.

A column is a topic and a field: `/joint_states.position[boom]`. What stands in brackets is a name in the
message's `name` field (as in sensor_msgs/JointState), or else a number, counted from 1. Each message has the
time of its header's stamp, or else that of its recording. All channels are resampled to the period of the
settings, over the time that all interpolated ones have: angles are interpolated, commands held. The time
column has the name that the settings give it.
"""

from collections.abc import Collection, Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hydroid.errors import LogError
from hydroid.log.log import Floats
from hydroid.log.repair import hold
from hydroid.log.table import Cells, Table, optional_package, readable

FIRST = 20
"""messages of each topic that are searched for its fields"""
LARGEST = 20_000
"""bytes of a message with signals; larger ones are images and point clouds"""
MAX_ARRAY = 64
"""elements of an array that are columns"""
DEPTH = 5
"""of nested messages"""
HOLE = 0.1
"""longest time between messages that is bridged [s], or three usual steps of the topic if that is longer"""


@dataclass(frozen=True, eq=False)
class _Channel:
    """The messages of one column: times [ns], strictly increasing, and values, shape (N,) each."""

    at: Any
    values: Floats
    held: bool

    def resampled(self, start: int, grid: Floats, period: float) -> Floats:
        """Return the values at times after `start` [s]; NaN between messages that are too far apart."""
        at = (self.at - start) / 1e9
        if self.held or len(at) == 1:
            return hold(at, self.values[:, None], grid, period)[:, 0]
        after = np.searchsorted(at, grid - 1e-9).clip(1, len(at) - 1)
        far = np.diff(at)[after - 1] > max(HOLE, 3 * float(np.median(np.diff(at))))
        between = (grid > at[after - 1] + 1e-9) & (grid < at[after] - 1e-9)
        return np.where(far & between, np.nan, np.interp(grid, at, self.values))


@dataclass(frozen=True, eq=False, kw_only=True)
class BagTable(Table):
    """The channels of a bag, by column their topic; its rows are at `period` [s]."""

    topics: Mapping[str, str]
    period: float

    def read(self, columns: Sequence[str], held: Collection[str] = ()) -> Cells:
        """Read columns; those that share no time are refused, and so is a damaged message."""
        time = self.names[0]
        wanted = [name for name in columns if name != time] or [*self.topics][:1]
        channels, unstamped = self._channels(wanted, held)
        smooth = [c.at for c in channels.values() if not c.held and len(c.at) > 1]
        spans = smooth or [c.at for c in channels.values()]
        start, end = max(int(at[0]) for at in spans), min(int(at[-1]) for at in spans)
        if end - start < self.period * 1e9:
            hint = "record them together, with one clock"
            raise LogError("the channels have no common time", where=self.source, hint=hint)
        rows = int((end - start) / (1e9 * self.period) + 1e-6) + 1
        grid = np.arange(rows, dtype=np.float64) * self.period
        series = {name: channel.resampled(start, grid, self.period) for name, channel in channels.items()}
        late = [name for name, c in channels.items() if c.held and c.at[0] > start]
        said = (
            (sorted({self.topics[name] for name in wanted}), f"resampled to {self.period:g} s"),
            (sorted(unstamped), "no header stamp, so the time of recording counts"),
            (late, "0 until the first message"),
        )
        remarks = tuple(f"{', '.join(names)}: {what}" for names, what in said if names)
        values = np.stack([series.get(name, grid) for name in columns], axis=1)
        return Cells(values, np.arange(1, rows + 1), np.zeros(rows, bool), remarks=remarks)

    def _channels(self, wanted: Sequence[str], held: Collection[str]) -> tuple[dict[str, _Channel], set[str]]:
        """Read the messages of columns; also returns the topics whose messages have no stamp."""
        samples: dict[str, list[tuple[int, float]]] = {name: [] for name in wanted}
        unstamped = set[str]()
        topics = {self.topics[name] for name in wanted}
        with _reader(Path(self.source)) as reader:
            used = [connection for connection in reader.connections if connection.topic in topics]
            for connection, recorded, data in reader.messages(connections=used):
                message = reader.deserialize(data, connection.msgtype)
                stamp = _stamp(message)
                unstamped |= set() if stamp else {connection.topic}
                for name, value in _numbers(message):
                    if (column := f"{connection.topic}.{name}") in samples:
                        samples[column].append((stamp or recorded, value))
        channels = dict[str, _Channel]()
        for name, pairs in samples.items():
            if not pairs:
                raise LogError("holds no message", where=f"{self.source}, column {name}")
            at, first = np.unique(np.array([at for at, _ in pairs], np.int64), return_index=True)
            values = np.array([value for _, value in pairs], np.float64)[first]
            channels[name] = _Channel(at, values, name in held)
        return channels, unstamped


def open_bag(path: Path, time: str, period: float) -> BagTable:
    """Find the channels of a bag; `time` is the name of its time column, `period` that of its rows [s].

    Raises:
        LogError: it is damaged, has no channel of numbers, or rosbags is not installed.
    """
    channels: dict[str, dict[str, str]] = {}
    with _reader(path) as reader:
        left = {connection.topic: FIRST for connection in reader.connections}
        for connection, _, data in reader.messages() if left else ():
            topic = connection.topic
            if left[topic] > 0 and len(data) <= LARGEST:
                message = reader.deserialize(data, connection.msgtype)
                names = {f"{topic}.{name}": topic for name, _ in _numbers(message)}
                channels.setdefault(topic, {}).update(names)
            left[topic] -= 1
            if max(left.values()) <= 0:
                break
    topics = {name: topic for names in channels.values() for name, topic in names.items()}
    if not topics:
        raise LogError("holds no channel of numbers", where=str(path))
    layout = {".bag": "ROS 1 bag", ".mcap": "MCAP"}.get(path.suffix, "ROS 2 bag")
    return BagTable(source=str(path), layout=layout, names=(time, *topics), topics=topics, period=period)


@contextmanager
def _reader(path: Path) -> Generator[Any]:
    highlevel = optional_package("rosbags.highlevel", "ros", str(path))
    typesys = optional_package("rosbags.typesys", "ros", str(path))
    latest = typesys.get_typestore(typesys.Stores.LATEST)  # for bags that do not hold their definitions
    with readable(path, "a bag"), highlevel.AnyReader([path], default_typestore=latest) as reader:
        yield reader


def _stamp(message: Any) -> int:
    """Return the time of a message's header [ns]; 0: it has none."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    return 0 if stamp is None else int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _numbers(message: Any, prefix: str = "", depth: int = 0) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message by name, without those of its header."""
    labels = getattr(message, "name", None)
    for slot in fields(message):
        if slot.name == "header" or slot.name.startswith("__"):
            continue
        value, name = getattr(message, slot.name), prefix + slot.name
        parts = {name: value}
        if isinstance(value, np.ndarray | list):
            named = isinstance(labels, list) and len(labels) == len(value)
            keys: Any = labels if named else range(1, len(value) + 1)
            parts = {f"{name}[{key}]": part for key, part in zip(keys, value[:MAX_ARRAY], strict=False)}
        for key, part in parts.items():
            if isinstance(part, bool | int | float | np.number | np.bool_):
                yield key, float(part)
            elif is_dataclass(part) and depth < DEPTH:
                yield from _numbers(part, f"{key}.", depth + 1)
