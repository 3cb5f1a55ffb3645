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

DISORDER = 0.1
"""how late a message may be recorded [s]: networks reorder messages; a longer step back
is the clock's"""
HOLE = 0.1
"""shortest silence of a topic that counts as a hole [s]"""
WATCHED = 5_000
"""messages between two reports of progress"""
MOST_ELEMENTS = 64
"""of an array in a message; longer ones are scans"""
LARGEST_MESSAGE = 20_000
"""[bytes]; larger ones are images and point clouds"""


@record
class Channel:
    """The numbers of a bag under one name, of n messages in the order in which the bag
    gives them.

    Attributes:
        times: when each message was sent [ns].
        values: its number.
        messages: the number of each message in its topic, from 1.
    """

    times: "array[int]" = field(default_factory=lambda: array("q"))
    values: "array[float]" = field(default_factory=lambda: array("d"))
    messages: "array[int]" = field(default_factory=lambda: array("q"))

    def in_order(self, topic: str, source: str) -> tuple[Ints, Array]:
        """Return times [ns], which increase, and values; a message that came twice
        counts once.

        Raises LogError: the clock went back, or one time has two values.
        """
        times = np.array(self.times, np.int64)
        values = np.array(self.values, np.float64)
        latest = np.maximum.accumulate(times)
        # networks reorder messages that are sent one soon after the other
        order = np.argsort(times, kind="stable")
        again = np.append(False, np.diff(times[order]) == 0)
        differs = again & np.append(False, np.diff(values[order]) != 0)
        stepped_back = np.flatnonzero(times < latest - round(1e9 * DISORDER))
        wrong = [*stepped_back, *order[differs]]
        if wrong:
            first = min(wrong)
            time = (times[first] - times.min()) / 1e9
            before = (latest[first] - times.min()) / 1e9
            raise time_falls(source, topic, self.messages[first], time, before)
        return times[order][~again], values[order][~again]


def time_falls(
    source: str, topic: str, message: int, time: float, before: float
) -> LogError:
    """Return the error about a message whose time [s] does not follow those before
    it."""
    what = f"time does not increase: {time:.6g} s follows {before:.6g} s"
    where = f"{source}, topic {topic}, message {message}"
    hint = "a clock was set back: record again, or cut the bag there"
    return LogError(what, where, hint)


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
        clock, *channels = self.names
        wanted = [signal for signal in signals if signal.name != clock]
        is_held = {signal.name: signal.kind == "command" for signal in wanted}
        if not is_held:
            # the time alone: the channel with most messages says when there are rows
            longest = max(channels, key=lambda name: len(self.channels[name].times))
            is_held = {longest: False}
        messages = self._messages([*is_held])
        times = {name: at for name, (at, _) in messages.items()}
        start, grid = self._grid(is_held, times)
        refuse_large(self.source, len(grid), len(signals))
        columns = {clock: grid}
        lost = np.zeros(len(grid), bool)
        for signal in wanted:
            at, numbers = messages[signal.name]
            seconds = (at - start) / 1e9
            values = signal.gain * numbers + signal.offset
            # between the samples of a command nothing is sent: a valve holds it
            if signal.kind == "command" or len(at) == 1:
                columns[signal.name] = _held(seconds, values, grid, signal.rest)
            else:
                columns[signal.name] = np.interp(grid, seconds, values)
                lost |= _in_holes(seconds, grid)
        values = np.stack([columns[signal.name] for signal in signals], axis=1)
        values[~(np.abs(values) < 1e100)] = np.nan
        topics = ", ".join(sorted({topic_of(name) for name in is_held}))
        remarks = (*self.remarks, f"{topics}: resampled to {self.period:g} s")
        table = Table(
            source=self.source, names=self.names, columns=columns, remarks=remarks
        )
        day = time_of_day(np.array([start], "M8[ns]"))
        rows = np.flatnonzero(~lost)
        return Recording(table, tuple(signals), values[rows], rows, day)

    def _messages(self, names: Sequence[str]) -> dict[str, tuple[Ints, Array]]:
        """Return times [ns] and values of channels, by name.

        Raises LogError: the clock of one went back.
        """
        for topic in map(topic_of, names):
            if topic in self.set_back:
                raise time_falls(self.source, topic, *self.set_back[topic])
        messages = dict[str, tuple[Ints, Array]]()
        for name in names:
            messages[name] = self.channels[name].in_order(topic_of(name), self.source)
        return messages

    def _grid(
        self, is_held: Mapping[str, bool], times: Mapping[str, Ints]
    ) -> tuple[int, Array]:
        """Return the first time that all interpolated channels have [ns], and the rows'
        times from it [s]."""
        interpolated = list[Ints]()
        for name, at in times.items():
            if len(at) > 1 and not is_held[name]:
                interpolated.append(at)
        # a command may begin later, since it is 0 before its first message
        channels = interpolated or [*times.values()]
        start = max(int(at[0]) for at in channels)
        end = min(int(at[-1]) for at in channels)
        if end - start < self.period * 1e9:
            hint = "record them together, with one clock"
            raise LogError("the channels have no common time", self.source, hint)
        # a last row that is off by rounding counts
        rows = int((end - start) / (1e9 * self.period) + 1e-6) + 1
        refuse_large(self.source, rows, 1)
        return start, self.period * np.arange(rows, dtype=np.float64)


def topic_of(name: str) -> str:
    """Return the topic of a column."""
    return name.partition(".")[0]


def _held(seconds: Array, values: Array, grid: Array, rest: float) -> Array:
    """Hold each value until the next one; before the first it is `rest`, 0 or NaN."""
    period = grid[1]
    column = hold(seconds, values[:, None], grid, period)[:, 0]
    if rest != 0:
        column[grid < seconds[0] - 1e-9] = rest
    return column


def _in_holes(seconds: Array, grid: Array) -> Mask:
    """Return which rows lie where a channel was silent: for longer than HOLE and than
    three usual steps."""
    steps = np.diff(seconds)
    # a row at the time of a message is in no hole, but for rounding
    after = np.searchsorted(seconds, grid - 1e-9)
    after = after.clip(1, len(seconds) - 1)
    far = steps[after - 1] > max(HOLE, 3 * np.median(steps))
    is_later = grid > seconds[after - 1] + 1e-9
    is_earlier = grid < seconds[after] - 1e-9
    return far & is_later & is_earlier


def open_bag(
    path: Path, settings: LogSettings, progress: Progress = no_progress
) -> BagTable:
    """Read the channels of a bag. Raises LogError: it cannot be read, or holds none."""
    content = _Content()
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
                content.take(reader, connection, recorded, data)
        set_back = _set_back(path)
    remarks = content.remarks()
    if not content.channels:
        what = "holds no channel of numbers"
        if remarks:
            what = listed(remarks)
        raise LogError(what, path)
    return BagTable(
        source=str(path),
        names=(settings.time.column, *content.channels),
        channels=content.channels,
        period=settings.period_s,
        set_back=set_back,
        remarks=tuple(remarks),
    )


class _Content:
    """What the messages of a bag hold, which come one after the other."""

    def __init__(self) -> None:
        self.channels = dict[str, Channel]()
        self._counts = Counter[str]()
        self._unread = Counter[str]()

    def take(self, reader: Any, connection: Any, recorded: int, data: bytes) -> None:
        """Take the numbers of a message that was recorded at a time [ns]."""
        topic = connection.topic
        self._counts[topic] += 1
        # to unpack it would take long, for nothing
        if len(data) > LARGEST_MESSAGE:
            return
        try:
            message = reader.deserialize(data, connection.msgtype)
        except Exception:  # rosbags raises any on damaged bytes
            self._unread[topic] += 1
            return
        time = _stamp(message) or recorded
        for name, number in _numbers(message, f"{topic}."):
            channel = self.channels.setdefault(name, Channel())
            channel.times.append(time)
            channel.values.append(number)
            channel.messages.append(self._counts[topic])

    def remarks(self) -> list[str]:
        """Return a line for each topic with messages that cannot be read."""
        lines = list[str]()
        for topic, lost in self._unread.items():
            sent = self._counts[topic]
            lines.append(f"{topic}: {lost} of {sent} messages cannot be read")
        return lines


def _stamp(message: Any) -> int:
    """Return the time in the header of a message [ns]; 0 where it has none."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    if stamp is None:
        return 0
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _set_back(path: Path) -> dict[str, tuple[int, float, float]]:
    """Return the topics of a ROS 2 bag whose recorder's clock went back, as
    `BagTable.set_back`.

    rosbags sorts messages by their time, which would interleave what was recorded one
    after the other.
    """
    set_back = dict[str, tuple[int, float, float]]()
    files = sorted(path.glob("*.db3")) if path.is_dir() else []
    for file in files:
        read_only = f"{file.resolve().as_uri()}?mode=ro"
        with closing(sqlite3.connect(read_only, uri=True)) as database:
            topics = dict(database.execute("SELECT id, name FROM topics").fetchall())
            for number, topic in topics.items():
                step = _step_back(database, number)
                if step is not None:
                    set_back.setdefault(topic, step)
    return set_back


def _step_back(
    database: sqlite3.Connection, topic: int
) -> tuple[int, float, float] | None:
    """Return the first message of a topic before which the clock went back, its time
    and the latest one before [s]; None: there is none."""
    query = "SELECT timestamp FROM messages WHERE topic_id = ? ORDER BY id"
    rows = database.execute(query, (topic,))
    times = np.fromiter((time for (time,) in rows), np.int64)
    latest = np.maximum.accumulate(times)
    back = np.flatnonzero(times < latest - round(1e9 * DISORDER))
    if not len(back):
        return None
    first = int(back[0])
    time = times[first] - times[0]
    before = latest[first] - times[0]
    return first + 1, time / 1e9, before / 1e9


def _numbers(message: Any, prefix: str) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message by name, without those of its header."""
    labels = getattr(message, "name", None)
    for slot in fields(message):
        value = getattr(message, slot.name)
        name = prefix + slot.name
        parts: dict[str, Any] = {}
        if isinstance(value, np.ndarray | list):
            parts = _elements(name, value, labels)
        elif slot.name != "header":
            parts = {name: value}
        for key, part in parts.items():
            if isinstance(part, Real | np.bool_):
                yield key, float(part)
            elif is_dataclass(part):
                yield from _numbers(part, f"{key}.")


def _elements(name: str, array: Any, labels: Any) -> dict[str, Any]:
    """Return the first elements of an array by their labels, if there are as many, or
    else by number."""
    keys: Any = range(1, len(array) + 1)
    if isinstance(labels, list) and len(labels) == len(array):
        keys = labels
    elements = dict[str, Any]()
    for key, element in zip(keys, array[:MOST_ELEMENTS], strict=False):
        elements[f"{name}[{key}]"] = element
    return elements
