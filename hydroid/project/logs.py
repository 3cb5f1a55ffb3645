"""The logs of a project, read by the columns of the first: those that cannot be are left
out."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hydroid.arrays import Limits
from hydroid.errors import LogError
from hydroid.log import (
    OTHER_UNITS,
    Log,
    LogFinding,
    Reading,
    Table,
    check_parts,
    motion_of,
    open_table,
)
from hydroid.log.motion_checks import MUCH_PUSH
from hydroid.progress import Progress
from hydroid.settings.arm import Arm
from hydroid.settings.log import LogSettings
from hydroid.units import UNITS

UNUSABLE = "the log cannot be used as it is"
SAID = (
    "row left out",
    "cut end",
    "lost",
    "gap",
    "half a command",
    "unasked",
    "sinks",
    "one sign",
    "target",
)
"""kinds of findings that say which part of a log is not read, or not told by it"""
RECORD_ALIKE = "record it as the first log, or make it a project of its own"
FASTEST = 3.0
"""times its speed in other logs that a joint may have in one"""


class Others(NamedTuple):
    """Logs beside the first: those that are fitted, and one that is validated on, of
    which no more is asked."""

    fitted: Sequence[Path] = ()
    unseen: Path | None = None
    in_range: bool = True
    """whether to leave out logs that exceed the arm's ranges, unless the first one does,
    too; not where the ranges themselves are guesses"""

    def tables(self, progress: Progress) -> Iterator[Table]:
        """Yield the tables of all of them that can be opened."""
        for path in self.paths:
            with suppress(LogError):
                yield open_table(path, progress=progress)

    @property
    def paths(self) -> list[Path]:
        """The files of all of them."""
        return [*self.fitted, *([] if self.unseen is None else [self.unseen])]


def read_first(
    table: Table,
    settings: LogSettings,
    arm: Arm,
    reasons: list[str],
    progress: Progress,
    *,
    strict: bool,
) -> list[Log]:
    """Read the first log, of several parts the longest first; an error is a reason, or
    ends the command if `strict`.

    Of one that cannot be read, what its joints do is not known.
    """
    path = Path(table.source)
    limits = _no_limits(arm)
    reading = Reading(arm=arm)
    parts, findings = check_parts(path, settings, limits, reading, progress)
    if not parts:
        if strict:
            raise findings[0].error()
        reasons.append(f"{UNUSABLE}: {findings[0]}")
        repaired = Reading(arm=arm, repair=True)
        parts, _ = check_parts(path, settings, limits, repaired, progress)
    reasons += _said(findings)
    return _longest_first(parts)


def read_others(
    table: Table,
    settings: LogSettings,
    arm: Arm,
    others: Others,
    reasons: list[str],
    progress: Progress,
) -> tuple[list[Log], list[Log], list[Path]]:
    """Read the other logs; return those that are fitted, the unseen one, and those that
    cannot be read as the first one is, or seem to be in other units."""
    fitted = list[Log]()
    unseen = list[Log]()
    left_out = list[Path]()
    if not others.paths:
        return fitted, unseen, left_out
    reading = Reading(arm=arm)
    limits = arm.ranges
    path = Path(table.source)
    first, of_first = check_parts(path, settings, limits, reading, progress)
    usual = {finding.kind for finding in of_first}
    if not first or not others.in_range:
        limits = _no_limits(arm)
    for path in others.paths:
        parts, findings = check_parts(path, settings, limits, reading, progress)
        why = _unlike(findings, usual, table.source)
        if not parts:
            why = str(findings[0])
        elif not why:
            why = _in_other_units(path, parts, [*first, *fitted], arm)
        if why:
            left_out.append(path)
            reasons.append(f"left out of the commands below: {why}")
        elif path == others.unseen:
            unseen += parts
        else:
            fitted += _longest_first(parts)
            reasons += _said(findings)
    return fitted, unseen, left_out


def _unlike(findings: Sequence[LogFinding], usual: Collection[str], first: str) -> str:
    """Say what makes another log differ in its units from the first one, which has the
    `usual` kinds of findings; "": nothing."""
    for one in findings:
        if one.kind in OTHER_UNITS and one.kind not in usual:
            return f"{one.where}: {one.what}, unlike in {first}: {RECORD_ALIKE}"
    return ""


def _in_other_units(
    path: Path, parts: Sequence[Log], others: Sequence[Log], arm: Arm
) -> str:
    """Say in which unit the angles of a log seem to be, if all its joints move as many
    times slower or faster than in others as that unit is larger or smaller; "": in the
    same."""
    ratios = list[float]()
    for number, joint in enumerate(arm.joints, 1):
        own = _strong_speed(parts, number)
        usual = _strong_speed(others, number)
        # m and mm are another matter
        if own and usual and not joint.slides:
            ratios.append(own / usual)
    factor = UNITS["rad"].factor / UNITS["deg"].factor
    for unit, expected in (("rad", 1 / factor), ("deg", factor)):
        near = [expected / FASTEST < ratio < expected * FASTEST for ratio in ratios]
        if near and all(near):
            times = float(np.median(ratios))
            what = f"joints move at {times:.2g} times their speed in the other logs"
            return f"{path}: {what}, as if its angles were in {unit}: {RECORD_ALIKE}"
    return ""


def _strong_speed(logs: Sequence[Log], joint: int) -> float:
    """Return how fast a joint moves in logs that drive it by strong commands [rad/s]; 0
    without any."""
    motions = [motion_of(log, joint) for log in logs if log.measures(joint)]
    return max(
        (motion.speed for motion in motions if motion.push > MUCH_PUSH), default=0.0
    )


def reach_of(logs: Sequence[Log], joints: Sequence[int]) -> dict[int, Limits]:
    """Return the ends of what joints (numbers, from 1) do in logs [rad, m]."""
    reach = dict[int, Limits]()
    for joint in joints:
        angles = np.concatenate([log.angle_of(joint) for log in logs])
        reach[joint] = float(np.nanmin(angles)), float(np.nanmax(angles))
    return reach


def _longest_first(parts: Sequence[Log]) -> list[Log]:
    return sorted(parts, key=lambda part: part.duration, reverse=True)


def _no_limits(arm: Arm) -> Mapping[str, Limits]:
    return dict.fromkeys(arm.joint_names, (-np.inf, np.inf))


def _said(findings: Sequence[LogFinding]) -> Iterator[str]:
    """Yield the findings that say which part of a log is not read."""
    for finding in findings:
        if finding.level == "warning" and finding.kind in SAID:
            yield str(finding)
