"""What the motion in logs says: of the settings, of the log, and of all logs together."""

from collections.abc import Collection, Sequence
from itertools import pairwise

import numpy as np

from hydroid.findings import Level
from hydroid.log.finding import LogFinding, Place
from hydroid.log.log import Floats, Log
from hydroid.log.motion import JointMotion, motion_of
from hydroid.log.ranges import likely_range
from hydroid.settings.log import Kind, LogSettings

STRAIGHT_ANGLE = 3.2  # just above pi: few joints turn further, in rad
MOVES = 3.0  # [deg]: more than noise and settling
HARDLY = 2.0  # [deg]: a joint that is driven strongly moves further
LEAST = 300.0  # [% s] of strong commands before their effect is judged
SLUGGISH = 0.015  # [deg/(% s)]: 1.5 deg/s at full command; the rig's slowest joint turns 16 times as fast
SMALL = {"±1": 1, "±10 V": 10}  # ranges that a motion must contradict: they may be small commands in %
REST = 0.2  # [s] of rest before the first command that give a start pose
AT_STOP = 0.5  # [s] at a stop that are worth a line
HELD = 0.3  # [s] for which logs hold a command before it counts
BIN = 5  # [%]
OPEN = 20  # [%]: a wider interval without commands leaves the valve curve open
HIGH = 80  # [%]: above the largest command, if it is lower, the curve is open too
MAX_JOINTS = 3  # in a line


def driven_joints(log: Log) -> dict[int, JointMotion]:
    """Return the motions of the joints that are driven and measured, by number."""
    return {
        joint: motion_of(log, joint) for joint in (np.flatnonzero(log.driven & log.measured) + 1).tolist()
    }


class Contradictions:
    """What the motion in a log says against its settings."""

    def __init__(self, log: Log, settings: LogSettings, outputs: Sequence[int]) -> None:
        self.log, self.settings, self.outputs = log, settings, outputs
        self.motions = driven_joints(log)

    def findings(self, said: Collection[str] = ()) -> list[LogFinding]:
        """Return all of them, but for units of which the file itself `said` that they are wrong."""
        ranges = [] if "unit of command" in said else self._ranges()
        units = ranges or ([] if "unit of angle" in said else self._radians())
        return [*self._constant(), *units, *self._shifts(), *self._turned()]

    def _place(self, kind: Kind, joint: int) -> Place:
        columns = self.settings.columns(kind, joint)
        return Place(self.log.source, column=columns.column[0] if columns else "")

    def _constant(self) -> list[LogFinding]:
        joints, log = range(1, self.log.joints + 1), self.log
        findings = list[LogFinding]()
        compared = [j for j in joints if log.measured[j - 1] and (log.driven[j - 1] or j in self.outputs)]
        if still := [j for j in compared if np.ptp(log.angle[:, j - 1]) == 0]:
            driven = " though it is driven" if len(still) == 1 and log.driven[still[0] - 1] else ""
            place = self._place("angle", still[0])
            findings.append(place.finding("warning", "angle is constant", still, driven=driven))
        mapped = [j for j in self.outputs if j <= log.joints and self.settings.columns("command", j)]
        if held := [j for j in mapped if np.ptp(log.command[:, j - 1]) == 0]:
            findings.append(self._place("command", held[0]).finding("warning", "command is constant", held))
        return findings

    def _ranges(self) -> list[LogFinding]:
        """Commands that look like another range than percent."""
        if not self.motions:
            return []
        maps = {j: self.settings.columns("command", j) for j in range(1, self.log.joints + 1)}
        signed = {j: columns for j, columns in maps.items() if columns and len(columns.column) == 1}
        likely = {j: likely_range(self.log.command[:, j - 1]) for j in signed}
        findings = list[LogFinding]()
        for name in dict.fromkeys(found.name for found in likely.values() if found and found.offset):
            joints = [j for j, found in likely.items() if found and found.name == name]
            found, columns = likely[joints[0]], signed[joints[0]]
            assert found is not None
            numbers = found.remedy(columns.scale, columns.offset)
            findings.append(
                self._place("command", joints[0]).finding("warning", "raised range", joints, **numbers)
            )
        overall = likely_range(self.log.command.ravel())
        joint, motion = max(self.motions.items(), key=lambda pair: pair[1].travel)
        if not findings and overall and overall.name in SMALL and motion.travel > MOVES:
            columns = maps[joint]
            assert columns is not None
            numbers = overall.remedy(columns.scale, columns.offset)
            largest = {"largest": SMALL[overall.name], "travel": motion.travel}
            place = self._place("command", joint)
            findings.append(place.finding("warning", "small range", [joint], **largest, **numbers))
        return findings

    def _radians(self) -> list[LogFinding]:
        judged = {j: m for j, m in self.motions.items() if m.push > LEAST}
        largest = np.rad2deg(np.nanmax(np.abs(self.log.angle), initial=0.0))
        sluggish = all(0 < m.path < SLUGGISH * m.push for m in judged.values())
        if not judged or not sluggish or largest > STRAIGHT_ANGLE:
            return []
        joint = next(iter(judged))
        return [self._place("angle", joint).finding("warning", "sluggish", [joint], most=STRAIGHT_ANGLE)]

    def _shifts(self) -> list[LogFinding]:
        """Commands that look early or late."""
        lags = {j: m.lag for j, m in self.motions.items() if m.lag is not None and m.shifted}
        findings = list[LogFinding]()
        signs: tuple[tuple[str, Level, int], ...] = (("early", "note", 1), ("late", "warning", -1))
        for kind, level, sign in signs:
            if joints := [j for j, lag in lags.items() if sign * lag > 0]:
                lag = float(np.median([lags[j] for j in joints]))
                numbers = {"lag": abs(lag), "delay": self.settings.delay_s + lag}
                findings.append(self._place("command", joints[0]).finding(level, kind, joints, **numbers))
        return findings

    def _turned(self) -> list[LogFinding]:
        turned = {joint: motion.directed for joint, motion in self.motions.items() if motion.turned}
        if not turned:
            return []
        share = ", ".join(f"{against:.0%} of {path:.3g} deg" for path, against in turned.values())
        place = self._place("command", next(iter(turned)))
        return [place.finding("warning", "turned", [*turned], share=share)]


def motion_findings(log: Log) -> list[LogFinding]:
    """Report joints that hardly move or stand at a stop, and a log that does not begin at rest."""
    findings, place, motions = list[LogFinding](), Place(log.source), driven_joints(log)
    still = {j: m.travel for j, m in motions.items() if m.push > LEAST and 0 < m.travel < HARDLY}
    if still:
        findings.append(place.finding("warning", "no motion", [*still], most=max(still.values())))
    stopped = [(j, m.stopped) for j, m in motions.items() if j not in still and m.stopped >= AT_STOP]
    if stopped:
        joints = ", ".join(f"joint {j} for {seconds:.3g} s" for j, seconds in stopped)
        findings.append(place.finding("note", "at a stop", joints=joints))
    if log.driven.any() and (rest := log.first_command * log.period) < REST:
        after = f" after {rest:.2g} s" if rest else ""
        findings.append(place.finding("note", "no rest", after=after))
    return findings


def survey(logs: Sequence[Log]) -> list[LogFinding]:
    """Report what all logs together lack or contradict: directions, and commands that none of them has."""
    findings, gaps, missing = list[LogFinding](), list[str](), list[str]()
    motions = [driven_joints(log) for log in logs]
    for joint in sorted({joint for of_log in motions for joint in of_log}):
        own = [of_log[joint] for of_log in motions if joint in of_log]
        turned, straight = [m for m in own if m.turned], [m for m in own if m.straight]
        if turned and straight:
            odd = Place(min(turned, straight, key=len)[0].log.source)
            numbers = {"turned": str(len(turned)), "logs": str(len(turned + straight))}
            findings.append(odd.finding("warning", "directions differ", [joint], **numbers))
        held = _held([m.log for m in own], joint)
        if open_ := _gaps(held):
            gaps.append(f"joint {joint} {', '.join(open_)}")
        for sign, word in ((1, "positive"), (-1, "negative")):
            if not (sign * held > 0).any() and len(held):
                missing.append(f"joint {joint} {word}")
    place = Place(logs[0].source if len(logs) == 1 else f"{len(logs)} logs")
    if gaps:
        more = f"; and of {len(gaps) - MAX_JOINTS} more joints" if len(gaps) > MAX_JOINTS else ""
        findings.append(place.finding("note", "open valve curve", gaps="; ".join(gaps[:MAX_JOINTS]) + more))
    if missing:
        findings.append(place.finding("note", "one direction", missing))
    return findings


def _held(logs: Sequence[Log], joint: int) -> Floats:
    """Return the commands that are held long enough, without 0, rounded to 5 % and ascending."""
    seconds = dict[int, float]()
    for log in logs:
        levels, counts = np.unique(np.rint(log.command[:, joint - 1] / BIN), return_counts=True)
        for level, count in zip(levels.astype(int).tolist(), counts.tolist(), strict=True):
            seconds[level] = seconds.get(level, 0.0) + count * log.period
    return BIN * np.array(sorted(level for level, held in seconds.items() if level and held >= HELD))


def _gaps(held: Floats) -> list[str]:
    """Return the intervals [%] without commands, between those of one direction and beyond the largest."""
    pairs = pairwise(held.tolist())
    gaps = [
        f"between {low:.0f} and {high:.0f}" for low, high in pairs if high - low >= OPEN and low * high > 0
    ]
    if len(held) and 0 < held[-1] < HIGH:
        gaps.append(f"above {held[-1]:.0f}")
    return gaps + ([f"below {held[0]:.0f}"] if len(held) and -HIGH < held[0] < 0 else [])
