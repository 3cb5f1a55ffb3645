"""What a file is read as: the log as the rest of the program sees it, and findings
about it."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hydroid.arrays import Array, Mask, independent_samples, record
from hydroid.errors import LogError
from hydroid.findings import WORDS, Finding, Level
from hydroid.words import listed

LONGEST_REST = 2.0
"""of which the start is the mean [s]"""
LEAST_COMMAND = 2.0
"""below which a command is none, but the noise of a lever [%]"""
STANDS = 2e-3
"""between the halves of a rest in which a joint stands its mean moves less [rad, m]"""
BEGINNING = 0.2
"""in which a joint shows whether it moves already where a log begins [s]; four samples
at least"""
SURELY = 5.0
"""standard deviations of a speed from which a joint moves"""
LATE = 0.03
"""by which a joint may seem to begin to move after the first sample, though it has
moved before [s]"""
MOVES = 0.2
"""part of its fastest speed from which it does"""
LEVELS: tuple[Level, ...] = ("error", "warning", "note")


@record
class FileRows:
    """The rows of a file that a log was made of, before they were resampled.

    Attributes:
        count: their number.
        steps: the shortest, the usual and the longest step between them [s].
        left_out: what of the whole file was left out, filled or split, one statement
            each.
    """

    count: int
    steps: tuple[float, float, float]
    left_out: tuple[str, ...] = ()


@record
class Log:
    """What was commanded and what was measured, T samples of J joints.

    Attributes:
        source: the file it came from.
        time: [s], shape (T,), k · period from 0.
        command: [%], shape (T, J), in [-100, 100], held until the next sample; 0 where
            undriven.
        angle: [rad], shape (T, J); a column of NaN where unmeasured.
        period: [s].
        pressure: of chambers A and B [Pa], shape (T, J, 2), NaN where unmeasured; None:
            the log has none.
        rest: samples before the first command of the recording; None: before the first
            one in `command` (`first_command`).
        recorded: samples that stand in for a row of the file, shape (T,): angles of the
            others lie between two rows, and say nothing new. None: all do.
        pose: in which joints stand that are not measured [rad], shape (J,); None: it is
            not known.
        begin: time of its first sample in the recording, of which it may be a part [s].
        speed: at which joints start [rad/s], shape (J,); None: at rest.
        conditions: engine speed over its reference, and how much warmer the oil is than
            at its own [K], shape (T, 2); 1 and 0 where the log has no such column. None:
            it has neither.
        beside: commands of joints that only follow the log [%], shape (T, J): their
            valves shut a pump's open centre. None: there are none.
        clock: time of day at which the recording begins, HH:MM:SS; empty where the file
            has none.
        rows: of its file; None: it is from no file, or a part of what a file gave.
    """

    source: str
    time: Array
    command: Array
    angle: Array
    period: float
    pressure: Array | None = None
    rest: int | None = None
    recorded: Mask | None = None
    pose: Array | None = None
    begin: float = 0.0
    speed: Array | None = None
    clock: str = ""
    conditions: Array | None = None
    beside: Array | None = None
    rows: FileRows | None = None

    @property
    def joints(self) -> int:
        """Number of joints J."""
        return self.command.shape[1]

    @property
    def driven(self) -> Mask:
        """Joints that are ever commanded, shape (J,)."""
        return np.any(self.command != 0, axis=0)

    @property
    def has_angle(self) -> Mask:
        """Joints whose angle the log holds, shape (J,)."""
        return ~np.isnan(self.angle[0])

    def angle_of(self, joint: int) -> Array:
        """Return the angle of a joint (number, from 1) [rad], shape (T,)."""
        return self.angle[:, joint - 1]

    def command_of(self, joint: int) -> Array:
        """Return the command of a joint (number, from 1) [%], shape (T,)."""
        return self.command[:, joint - 1]

    def drives(self, joint: int) -> bool:
        """Return whether a joint (number, from 1) is ever commanded."""
        return bool(self.driven[joint - 1])

    def measures(self, joint: int) -> bool:
        """Return whether the log holds the angle of a joint (number, from 1)."""
        return bool(self.has_angle[joint - 1])

    @property
    def posed(self) -> Array:
        """Angles of all joints [rad], shape (T, J): of those that are not measured that
        of `pose`."""
        return self._with_pose(self.angle)

    def _with_pose(self, angle: Array) -> Array:
        if self.pose is None:
            return angle
        return np.where(self.has_angle, angle, self.pose)

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.time[-1])

    @cached_property
    def first_command(self) -> int:
        """Index of the first sample with a command; 0 where there is none.

        The noise of a lever is no command while all joints stand.
        """
        first = int(np.argmax(np.any(self.command != 0, axis=1)))
        past_noise = self._first_past_noise(first)
        return past_noise if self._stands_before(past_noise) else first

    def _first_past_noise(self, first: int) -> int:
        """Return the first sample of the commands that exceed the noise of a lever, or
        else `first`."""
        exceeds = np.abs(self.command) >= LEAST_COMMAND
        begins = list[int]()
        for joint in np.flatnonzero(exceeds.any(axis=0)):
            reached = int(exceeds[:, joint].argmax())
            forward = np.sign(self.command[reached, joint])
            sizes = forward * self.command[:reached, joint]
            # a lever that is moved slowly leaves its rest earlier, which may be beside 0
            before = np.flatnonzero(sizes <= sizes[:1].clip(min=0))
            begins.append(int(before[-1]) + 1 if len(before) else 0)
        return min(begins, default=first)

    def _stands_before(self, sample: int) -> bool:
        """Return whether the mean angles of both halves of the samples before one are
        the same."""
        half = sample // 2
        if half == 0:
            return False
        earlier = self.angle[:half].mean(axis=0)
        later = self.angle[half:sample].mean(axis=0)
        # NaN, which is not larger than anything: not measured
        return not np.any(np.abs(later - earlier) > STANDS)

    @cached_property
    def start(self) -> Array:
        """The start pose [rad], shape (J,): the mean of the angles while the arm still
        rests, or `pose`.

        A simulation starts there, and an error of its start stays in the whole
        response. A command moves nothing before the sample after it; of a log that
        begins with a command the first sample must do.
        """
        return self._with_pose(self._mean_at_rest(self.angle))

    @property
    def start_speed(self) -> Array:
        """At which joints start [rad/s], shape (J,)."""
        return np.zeros(self.joints) if self.speed is None else self.speed

    @cached_property
    def speed_at_first(self) -> Array:
        """Speeds of joints that seem to move already where the log begins, under a
        command [rad/s], shape (J,); 0 of the others.

        The straight line that such a joint follows leads back to its first angle at
        the first sample. If the joint only begins to move then, it does so later.
        """
        count = max(round(BEGINNING / self.period), 4) + 1
        if len(self.time) <= count:
            return np.zeros(self.joints)
        begun = self.angle[:count]
        whole = _line(begun)
        ways = np.abs(self.angle[count:] - self.angle[:-count])
        fastest = ways.max(axis=0) / count
        # comparisons with NaN, of joints that are not measured, are false
        least = np.maximum(SURELY * whole.slope_sd, MOVES * fastest)
        moves = np.abs(whole.slope) > least
        half = count // 2
        later = _line(begun[half:])
        moves &= later.slope * whole.slope > 0.0
        with np.errstate(all="ignore"):
            back = (later.mean - begun[0]) / later.slope
            late = self.period * (half + (count - half - 1) / 2 - back)
            chance = self.period * 2 * whole.noise / np.abs(whole.slope)
        moves &= late <= np.maximum(LATE, chance)
        moves &= np.abs(self.command[0]) >= LEAST_COMMAND
        return np.where(moves, whole.slope / self.period, 0.0)

    def in_motion(self) -> "Log":
        """Return the log with joints that start at their speed at first."""
        return replace(self, speed=self.speed_at_first)

    @property
    def start_pressure(self) -> Array:
        """Chamber pressures before the first command, as `start` [Pa], shape (J, 2),
        NaN where unmeasured."""
        if self.pressure is None:
            return np.full((self.joints, 2), np.nan)
        return self._mean_at_rest(self.pressure)

    @property
    def start_samples(self) -> Array:
        """Independent samples whose mean `start` is as precise as, shape (J,): few if
        the rest drifts."""
        resting = self._at_rest(self.angle)
        if len(resting) < 3:
            return np.full(self.joints, float(len(resting)))
        return independent_samples(resting - self.start)

    def driving(self, joint: int) -> "Log":
        """Return the recording in which only this joint (number, from 1) is driven; the
        commands of the others are those `beside` it."""
        is_joint = np.arange(self.joints) == joint - 1
        every = self.command
        if self.beside is not None:
            every = every + self.beside
        return replace(
            self,
            command=self.command * is_joint,
            beside=every * ~is_joint,
            rest=self._rest,
        )

    def first(self, seconds: float) -> "Log":
        """Return the recording from its start to `seconds` after its first command."""
        end = self.first_command + 1 + max(round(seconds / self.period), 1)
        return replace(self.part(0, end), rest=self.rest)

    def part(self, first: int, end: int) -> "Log":
        """Return the samples from `first` to before `end`, which start where they were
        measured."""
        samples = slice(first, end)
        part = replace(
            self,
            time=self.time[samples] - self.time[first],
            begin=self.begin + float(self.time[first]),
            command=self.command[samples],
            angle=self.angle[samples],
            rest=0,
            rows=None,
        )
        if self.pressure is not None:
            part = replace(part, pressure=self.pressure[samples])
        if self.conditions is not None:
            part = replace(part, conditions=self.conditions[samples])
        if self.beside is not None:
            part = replace(part, beside=self.beside[samples])
        if self.recorded is not None:
            part = replace(part, recorded=self.recorded[samples])
        if self.speed is not None and first > 0:
            part = part.in_motion()
        return part

    @property
    def _rest(self) -> int:
        if self.rest is None:
            return self.first_command
        return self.rest

    def _at_rest(self, signal: Array) -> Array:
        # a leaking valve lets an arm sink
        longest = round(LONGEST_REST / self.period)
        return signal[: min(self._rest, longest) + 1]

    def _mean_at_rest(self, signal: Array) -> Array:
        resting = self._at_rest(signal)
        # of equal values to the last bit
        return resting[0] + (resting - resting[0]).mean(axis=0)


class _Line(NamedTuple):
    """A line through samples: slope [rad/sample], mean, standard deviation of what is
    left, and of the slope, (J,) each."""

    slope: Array
    mean: Array
    noise: Array
    slope_sd: Array


def _line(angles: Array) -> _Line:
    """Return the lines through the samples of joints, (n, J)."""
    count = len(angles)
    places = np.arange(count) - (count - 1) / 2
    squares = places @ places
    slope = places @ angles / squares
    mean = angles.mean(axis=0)
    left = angles - mean - np.outer(places, slope)
    noise = np.sqrt(np.sum(left**2, axis=0) / (count - 2))
    return _Line(slope, mean, noise, noise / np.sqrt(squares))


OTHER_UNITS = ("range", "range of one", "unit")
"""kinds of findings that say that a log is in other units than the settings say"""


@dataclass(frozen=True)
class LogFinding(Finding):
    """A finding of one log; its `column` is a name in the header."""

    source: str = ""
    column: str = ""

    def error(self) -> LogError:
        """Return the finding as the error that ends a command."""
        return LogError(self.what, self.where, self.hint)

    def __str__(self) -> str:
        return str(self.error())


def log_finding(
    level: Level,
    kind: str,
    source: str,
    *subjects: object,
    row: str = "",
    column: str = "",
    **numbers: float | str,
) -> LogFinding:
    """Make a finding about a file, at a `row` such as "line 12"; joints are named."""
    where = ", ".join(filter(None, (source, row, column and f"column {column}")))
    return LogFinding(
        kind, level, tuple(map(str, subjects)), numbers, where, source, column
    )


def by_level(findings: Iterable[LogFinding]) -> list[LogFinding]:
    """Return findings, errors first, then warnings, then notes."""
    return sorted(findings, key=lambda finding: LEVELS.index(finding.level))


def grouped(findings: Iterable[LogFinding]) -> list[tuple[Level, str]]:
    """Return findings as lines with their levels: what several joints or logs share
    stands once."""
    groups = dict[tuple[object, ...], list[LogFinding]]()
    for finding in by_level(findings):
        key = (finding.level, finding.kind, _shared(finding))
        groups.setdefault(key, []).append(finding)
    lines = list[tuple[Level, str]]()
    for group in groups.values():
        first = group[0]
        subjects = dict[str, None]()
        for finding in group:
            subjects |= dict.fromkeys(finding.subjects)
        line = str(replace(first, subjects=tuple(subjects)))
        _, *others = dict.fromkeys(finding.source for finding in group)
        if others:
            names = [Path(source).name for source in others]
            line += f" (also in {listed(names, 3)})"
        lines.append((first.level, line))
    return lines


def _shared(finding: LogFinding) -> object:
    """Return what findings of a kind must have in common to be one line."""
    sentence, _ = WORDS[finding.kind]
    if "{names}" in sentence:
        # it has room for several subjects
        return finding.hint
    return finding.subjects, finding.column, finding.numbers.get("what")
