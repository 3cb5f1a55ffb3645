"""The logs of a project, read by the columns of the first: those that cannot be are left
out."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hydroid.arrays import Limits
from hydroid.errors import LogError
from hydroid.log import Log, LogFinding, Reading, Table, check_parts, open_table
from hydroid.progress import Progress
from hydroid.settings.arm import Arm
from hydroid.settings.log import LogSettings

UNUSABLE = "the log cannot be used as it is"
SAID = ("row left out", "cut end", "lost", "gap", "half a command", "unasked", "target")
"""kinds of findings that say which part of a log is not read, or not told by it"""


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
    cannot be read as the first one is: by its columns, units and ranges."""
    fitted = list[Log]()
    unseen = list[Log]()
    left_out = list[Path]()
    if not others.paths:
        return fitted, unseen, left_out
    reading = Reading(arm=arm)
    limits = arm.ranges
    path = Path(table.source)
    first, _ = check_parts(path, settings, limits, reading, progress)
    if not first or not others.in_range:
        limits = _no_limits(arm)
    for path in others.paths:
        parts, findings = check_parts(path, settings, limits, reading, progress)
        if not parts:
            left_out.append(path)
            reasons.append(f"left out of the commands below: {findings[0]}")
        elif path == others.unseen:
            unseen += parts
        else:
            fitted += _longest_first(parts)
            reasons += _said(findings)
    return fitted, unseen, left_out


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
