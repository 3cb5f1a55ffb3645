"""ROS 1 and 2 bags and MCAP -> a table, by rosbags: channels with clocks of their own, brought to one.

A column is a topic and a field: `/joint_states.position[boom]`. What stands in brackets is a name in the
message's `name` field (as in sensor_msgs/JointState), or else a number, counted from 1. Each message has the
time of its header's stamp, or else that of its recording. All channels are resampled to the period of the
settings, over the time that all interpolated ones have: angles are interpolated, commands held. The time
column has the name that the settings give it.
"""

from collections.abc import Collection, Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hydroid.errors import LogError
from hydroid.log.log import Floats
from hydroid.log.table import Cells, optional_package

FIRST = 20
"""messages of each topic that are looked at for its fields"""
LARGEST = 20_000
"""bytes of a message with signals; larger ones are images and point clouds"""
MAX_ARRAY = 64
"""elements of an array that are columns"""
DEPTH = 5
"""of nested messages"""
HOLE = 0.1
"""longest time between messages that is bridged [s], or three usual steps of the topic if that is longer"""


@dataclass(frozen=True, eq=False)
class BagTable:
    """The channels of a bag; a `Table` whose rows are at `period` [s]."""

    source: str
    layout: str
    path: Path
    time: str
    channels: Mapping[str, tuple[str, ...]]
    period: float
    place: str = "row"
    header: int | None = None
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    remarks: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The time, and all channels of all topics."""
        return (self.time, *(f"{topic}.{name}" for topic in self.channels for name in self.channels[topic]))

    def text(self, row: int, column: str) -> str:
        """Return "": where there is no value there is no message."""
        return ""

    def read(self, columns: Sequence[str], held: Collection[str] = ()) -> Cells:
        """Read columns, as `Table` says.

        Raises:
            LogError: channels without a common time, or a damaged message.
        """
        topics = {f"{topic}.{name}": topic for topic in self.channels for name in self.channels[topic]}
        wanted = [name for name in columns if name != self.time] or [*topics][:1]
        series, unstamped = _series(self.path, {name: topics[name] for name in wanted})
        for name, (at, _) in series.items():
            if not len(at):
                raise LogError("holds no message", where=f"{self.source}, column {name}")
        steps = {name for name, (at, _) in series.items() if name in held or len(at) == 1}
        smooth = [at for name, (at, _) in series.items() if name not in steps]
        smooth = smooth or [at for at, _ in series.values()]
        start, end = max(int(at[0]) for at in smooth), min(int(at[-1]) for at in smooth)
        if end - start < self.period * 1e9:
            hint = "record them together, with one clock"
            raise LogError("the channels have no common time", where=self.source, hint=hint)
        rows = int((end - start) / (1e9 * self.period) + 1e-6) + 1
        grid = np.arange(rows, dtype=np.float64) * self.period
        resampled = {self.time: grid}
        for name, (at, values) in series.items():
            bring = _held if name in steps else _interpolated
            resampled[name] = bring(grid, (at - start) / 1e9, values)
        remarks = [f"{', '.join(sorted({topics[n] for n in wanted}))}: resampled to {self.period:g} s"]
        if unstamped:
            remarks.append(
                f"{', '.join(sorted(unstamped))}: no header stamp, so the time of recording counts"
            )
        late = [name for name in series if name in steps and series[name][0][0] > start]
        if late:
            remarks.append(f"{', '.join(late)}: 0 until the first message")
        values = np.stack([resampled[name] for name in columns], axis=1)
        return Cells(values, np.arange(1, rows + 1), np.zeros(rows, bool), remarks=tuple(remarks))


def open_bag(path: Path, time: str, period: float) -> BagTable:
    """Find the channels of a bag; `time` is the name of its time column, `period` that of its rows [s].

    Raises:
        LogError: it is damaged, has no channel of numbers, or rosbags is not installed.
    """
    channels: dict[str, dict[str, None]] = {}
    with _reader(path) as reader:
        left = {connection.topic: FIRST for connection in reader.connections}
        small = list(reader.connections)
        for connection, _, data in reader.messages(connections=small) if small else ():
            topic = connection.topic
            if left[topic] > 0 and len(data) <= LARGEST:
                message = reader.deserialize(data, connection.msgtype)
                channels.setdefault(topic, {}).update((name, None) for name, _ in _numbers(message))
            left[topic] -= 1
            if all(count <= 0 for count in left.values()):
                break
    if not any(channels.values()):
        raise LogError("holds no channel of numbers", where=str(path))
    layout = "ROS 1 bag" if path.suffix == ".bag" else "MCAP" if path.suffix == ".mcap" else "ROS 2 bag"
    return BagTable(str(path), layout, path, time, {t: tuple(names) for t, names in channels.items()}, period)


@contextmanager
def _reader(path: Path) -> Generator[Any]:
    """Open a bag, whose errors become one line."""
    highlevel = optional_package("rosbags.highlevel", "ros", str(path))
    typesys = optional_package("rosbags.typesys", "ros", str(path))
    known = typesys.get_typestore(typesys.Stores.LATEST)  # for bags that do not hold their definitions
    try:
        with highlevel.AnyReader([path], default_typestore=known) as reader:
            yield reader
    except LogError:
        raise
    except Exception as error:  # damaged bytes make rosbags raise errors of any kind
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise LogError(
            f"cannot be read as a bag ({reason})", where=str(path), hint="record it again"
        ) from None


def _series(path: Path, topics: Mapping[str, str]) -> tuple[dict[str, tuple[Any, Floats]], set[str]]:
    """Read channels: for each the times [ns], shape (N,), strictly increasing, and the values, (N,).

    Also returns the topics whose messages have no stamp.
    """
    times: dict[str, list[int]] = {name: [] for name in topics}
    values: dict[str, list[float]] = {name: [] for name in topics}
    unstamped = set[str]()
    fields_of = {topic: [n for n in topics if topics[n] == topic] for topic in topics.values()}
    with _reader(path) as reader:
        used = [connection for connection in reader.connections if connection.topic in fields_of]
        for connection, recorded, data in reader.messages(connections=used):
            message, topic = reader.deserialize(data, connection.msgtype), connection.topic
            stamp = _stamp(message)
            unstamped |= set() if stamp else {topic}
            numbers = dict(_numbers(message))
            for name in fields_of[topic]:
                value = numbers.get(name.removeprefix(f"{topic}."))
                if value is not None:
                    times[name].append(stamp or recorded)
                    values[name].append(value)
    series: dict[str, tuple[Any, Floats]] = {}
    for name in topics:
        at, first = np.unique(np.array(times[name], np.int64), return_index=True)
        series[name] = at, np.array(values[name], np.float64)[first]
    return series, unstamped


def _stamp(message: Any) -> int:
    """Return the time of a message's header [ns]; 0: it has none."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    return 0 if stamp is None else int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _numbers(message: Any, prefix: str = "", depth: int = 0) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message by name, without those of its header."""
    names = getattr(message, "name", None)
    for slot in fields(message):
        value, name = getattr(message, slot.name), prefix + slot.name
        if slot.name == "header" or slot.name.startswith("__"):
            continue
        if isinstance(value, bool | int | float | np.number | np.bool_):
            yield name, float(value)
        elif isinstance(value, np.ndarray | list):
            labels = (
                names if isinstance(names, list) and len(names) == len(value) else range(1, len(value) + 1)
            )
            for label, element in zip(labels, value[:MAX_ARRAY], strict=False):
                if isinstance(element, int | float | np.number):
                    yield f"{name}[{label}]", float(element)
                elif is_dataclass(element) and depth < DEPTH:
                    yield from _numbers(element, f"{name}[{label}].", depth + 1)
        elif is_dataclass(value) and depth < DEPTH:
            yield from _numbers(value, f"{name}.", depth + 1)


def _held(grid: Floats, at: Floats, values: Floats) -> Floats:
    """Return the last value at or before each time; 0 before the first."""
    index = np.searchsorted(at, grid + 1e-9, side="right") - 1
    return np.where(index >= 0, values[index], 0.0)


def _interpolated(grid: Floats, at: Floats, values: Floats) -> Floats:
    """Return the values between messages, NaN where these are too far apart."""
    after = np.searchsorted(at, grid - 1e-9).clip(1, len(at) - 1)
    far = np.diff(at)[after - 1] > max(HOLE, 3 * float(np.median(np.diff(at))))
    between = (grid > at[after - 1] + 1e-9) & (grid < at[after] - 1e-9)
    return np.where(far & between, np.nan, np.interp(grid, at, values))
