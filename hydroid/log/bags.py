"""ROS 1 and 2 bags and MCAP -> a table: by rosbags, channels with clocks of their own,
brought to one.

A column is a topic and a field: `/joint_states.position[boom]`. What stands in brackets
is a name in the message's `name` field (as in sensor_msgs/JointState), or else a
number, counted from 1. Each message has the time of its header's stamp, or else that of
its recording. All channels are resampled to the period of the settings, over the time
that all interpolated ones have: angles are interpolated, commands held. Before its
first message a command is 0 %. The time column has the name that the settings give it.
"""

import sqlite3
from array import array
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import field, fields, is_dataclass
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from hydroid.arrays import Array, Ints, Mask, record
from hydroid.errors import LogError
from hydroid.log.repair import hold
from hydroid.log.table import (
    Recording,
    Signal,
    Table,
    format_library,
    refuse_large,
    time_of_day,
)
from hydroid.progress import Progress, no_progress
from hydroid.settings.log import LogSettings
from hydroid.words import listed

LATE = 0.1
"""how late a message may be recorded [s]: networks reorder messages; a longer step back
is the clock's"""
HOLE = 0.1
"""shortest silence of a topic that counts as a hole [s]"""
WATCHED = 5_000  # messages between two reports of progress
LARGEST_MESSAGE = 20_000
"""[bytes]; larger ones are images and point clouds"""


@record
class Channel:
    """The numbers of a bag under one name, of n messages in the order in which the bag
    gives them.

    Attributes:
        times: of the messages [ns], n.
        values: n.
        messages: their numbers in their topic, from 1, n.
    """

    times: "array[int]" = field(default_factory=lambda: array("q"))
    values: "array[float]" = field(default_factory=lambda: array("d"))
    messages: "array[int]" = field(default_factory=lambda: array("q"))

    def in_order(self, topic: str, source: str) -> tuple[Ints, Array]:
        """Return times [ns], which increase, and values; a message that came twice
        counts once.

        Raises LogError: the clock went back, or one time has two values.
        """
        times, values = (
            np.array(self.times, np.int64),
            np.array(self.values, np.float64),
        )
        latest = np.maximum.accumulate(times)
        order = np.argsort(times, kind="stable")
        again = np.append(False, np.diff(times[order]) == 0)
        differs = again & np.append(False, np.diff(values[order]) != 0)
        wrong = [*np.flatnonzero(times < latest - round(1e9 * LATE)), *order[differs]]
        if wrong:
            first = min(wrong)
            since = (
                (times[first] - times.min()) / 1e9,
                (latest[first] - times.min()) / 1e9,
            )
            raise time_falls(source, topic, self.messages[first], *since)
        return times[order][~again], values[order][~again]


def time_falls(
    source: str, topic: str, message: int, time: float, before: float
) -> LogError:
    """Return the error about a message whose time [s] does not follow those before
    it."""
    what = f"time does not increase: {time:.6g} s follows {before:.6g} s"
    where = f"{source}, topic {topic}, message {message}"
    return LogError(
        what, where, "a clock was set back: record again, or cut the bag there"
    )


@record
class BagTable(Table):
    """The channels of a bag, by name; rows are at `period` [s].

    `set_back`: topics whose recorder's clock went back: at which message, its time and
    the one before [s].
    """

    channels: Mapping[str, Channel]
    period: float
    set_back: Mapping[str, tuple[int, float, float]]

    def read(self, signals: Sequence[Signal]) -> Recording:
        """Read columns; those that share no time are refused.

        Rows in a hole of a channel that is interpolated are left out: there the time
        has a gap.
        """
        clock, *names = self.names
        held = {s.name: s.kind == "command" for s in signals if s.name != clock}
        held = held or {
            max(names, key=lambda name: len(self.channels[name].times)): False
        }
        for topic in map(topic_of, held):
            if topic in self.set_back:
                raise time_falls(self.source, topic, *self.set_back[topic])
        every = {
            name: self.channels[name].in_order(topic_of(name), self.source)
            for name in held
        }
        start, grid = self._grid(
            held, {name: times for name, (times, _) in every.items()}
        )
        refuse_large(self.source, len(grid), len(signals))
        columns, lost = {clock: grid}, np.zeros(len(grid), bool)
        for signal in signals:
            if signal.name == clock:
                continue
            times, raw = every[signal.name]
            seconds, values = (times - start) / 1e9, signal.gain * raw + signal.offset
            if signal.kind == "command" or len(times) == 1:
                columns[signal.name] = _held(seconds, values, grid, signal.rest)
            else:
                columns[signal.name] = np.interp(grid, seconds, values)
                lost |= _in_holes(seconds, grid)
        values = np.stack([columns[signal.name] for signal in signals], axis=1)
        values[~(np.abs(values) < 1e100)] = np.nan
        topics = ", ".join(sorted({topic_of(name) for name in held}))
        remarks = (*self.remarks, f"{topics}: resampled to {self.period:g} s")
        table = Table(
            source=self.source, names=self.names, columns=columns, remarks=remarks
        )
        day = time_of_day(np.array([start], "M8[ns]"))
        return Recording(
            table, tuple(signals), values[~lost], np.flatnonzero(~lost), day
        )

    def _grid(
        self, held: Mapping[str, bool], at: Mapping[str, Ints]
    ) -> tuple[int, Array]:
        """Return the first time that all interpolated channels have [ns], and the rows'
        times from it [s]."""
        smooth = [
            at[name] for name in held if not held[name] and len(at[name]) > 1
        ] or [*at.values()]
        start, end = (
            max(int(times[0]) for times in smooth),
            min(int(times[-1]) for times in smooth),
        )
        if end - start < self.period * 1e9:
            hint = "record them together, with one clock"
            raise LogError("the channels have no common time", self.source, hint)
        rows = int((end - start) / (1e9 * self.period) + 1e-6) + 1
        refuse_large(self.source, rows, 1)
        return start, self.period * np.arange(rows, dtype=np.float64)


def topic_of(name: str) -> str:
    """Return the topic of a column."""
    return name.partition(".")[0]


def _held(seconds: Array, values: Array, grid: Array, rest: float) -> Array:
    """Hold each value until the next one; before the first it is `rest`, 0 or NaN."""
    column = hold(seconds, values[:, None], grid, grid[1])[:, 0]
    if rest != 0:
        column[grid < seconds[0] - 1e-9] = rest
    return column


def _in_holes(seconds: Array, grid: Array) -> Mask:
    """Return which rows lie where a channel was silent: for longer than HOLE and than
    three usual steps."""
    steps = np.diff(seconds)
    after = np.searchsorted(seconds, grid - 1e-9).clip(1, len(seconds) - 1)
    far = steps[after - 1] > max(HOLE, 3 * np.median(steps))
    return far & (grid > seconds[after - 1] + 1e-9) & (grid < seconds[after] - 1e-9)


def open_bag(
    path: Path, settings: LogSettings, progress: Progress = no_progress
) -> BagTable:
    """Read the channels of a bag. Raises LogError: it cannot be read, or holds none."""
    channels, counts = dict[str, Channel](), dict[str, int]()
    unread = Counter[str]()
    with format_library("rosbags.highlevel", "ros", path, "a bag") as rosbags:
        from rosbags.typesys import Stores, get_typestore

        # for bags that do not hold their definitions
        latest = get_typestore(Stores.LATEST)
        with rosbags.AnyReader([path], default_typestore=latest) as reader:
            for number, (connection, recorded, data) in enumerate(reader.messages()):
                if number % WATCHED == 0:
                    progress(
                        f"reading {path.name}, message", number, reader.message_count
                    )
                topic = connection.topic
                counts[topic] = counts.get(topic, 0) + 1
                if len(data) > LARGEST_MESSAGE:
                    continue
                try:
                    message = reader.deserialize(data, connection.msgtype)
                except Exception:  # rosbags raises any on damaged bytes
                    unread[topic] += 1
                    continue
                stamp = getattr(getattr(message, "header", None), "stamp", None)
                at = 0 if stamp is None else int(stamp.sec) * 10**9 + int(stamp.nanosec)
                for name, number in _numbers(message, f"{topic}."):
                    channel = channels.setdefault(name, Channel())
                    channel.times.append(at or recorded)
                    channel.values.append(number)
                    channel.messages.append(counts[topic])
        set_back = _set_back(path)
    left_out = unread.items()
    remarks = [
        f"{topic}: {lost} of {counts[topic]} messages cannot be read"
        for topic, lost in left_out
    ]
    if not channels:
        raise LogError(
            listed(remarks) if remarks else "holds no channel of numbers", path
        )
    return BagTable(
        source=str(path),
        names=(settings.time.column, *channels),
        channels=channels,
        period=settings.period_s,
        set_back=set_back,
        remarks=tuple(remarks),
    )


def _set_back(path: Path) -> dict[str, tuple[int, float, float]]:
    """Return the topics of a ROS 2 bag whose recorder's clock went back, as
    `BagTable.set_back`.

    rosbags sorts messages by their time, which would interleave what was recorded one
    after the other.
    """
    found = dict[str, tuple[int, float, float]]()
    for file in sorted(path.glob("*.db3")) if path.is_dir() else ():
        with closing(
            sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro", uri=True)
        ) as database:
            topics = dict(database.execute("SELECT id, name FROM topics").fetchall())
            for number, topic in topics.items():
                query = "SELECT timestamp FROM messages WHERE topic_id = ? ORDER BY id"
                rows = database.execute(query, (number,))
                times = np.fromiter((time for (time,) in rows), np.int64)
                latest = np.maximum.accumulate(times)
                back = np.flatnonzero(times < latest - round(1e9 * LATE))
                if len(back):
                    first = int(back[0])
                    time, before = times[first] - times[0], latest[first] - times[0]
                    found.setdefault(topic, (first + 1, time / 1e9, before / 1e9))
    return found


def _numbers(message: Any, prefix: str) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message by name, without those of its header; of an array
    the first 64."""
    labels = getattr(message, "name", None)
    for slot in fields(message):
        value, name = getattr(message, slot.name), prefix + slot.name
        parts = {name: value} if slot.name != "header" else {}
        if isinstance(value, np.ndarray | list):
            named = isinstance(labels, list) and len(labels) == len(value)
            keys: Any = labels if named else range(1, len(value) + 1)
            parts = {
                f"{name}[{key}]": part
                for key, part in zip(keys, value[:64], strict=False)
            }
        for key, part in parts.items():
            if isinstance(part, Real | np.bool_):
                yield key, float(part)
            elif is_dataclass(part):
                yield from _numbers(part, f"{key}.")
