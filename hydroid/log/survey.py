"""What the motion in logs says: of the settings, of the log, and of all logs together."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np

from hydroid.findings import Level
from hydroid.log.clues import likely_range
from hydroid.log.finding import LogFinding, found, together
from hydroid.log.log import Floats, Log
from hydroid.log.motion import driven_joints
from hydroid.settings.log import Kind, LogSettings

LEAST = 300.0
"""strong commands before their effect is judged [% s]"""


def contradictions(
    log: Log, settings: LogSettings, outputs: Collection[int], said: Collection[str]
) -> list[LogFinding]:
    """Return what the motion says against the settings, but for units of which the file `said` so."""
    motions = driven_joints(log)

    def about(
        kind: str,
        quantity: Kind,
        joints: Sequence[int],
        numbers: Mapping[str, float | str] = {},
        level: Level = "warning",
    ) -> LogFinding:
        columns = settings.columns(quantity, joints[0])
        place = ("line", None, columns.column[0] if columns else "")
        return found(level, kind, log.source, joints, place, **numbers)

    def constant() -> Iterator[LogFinding]:
        for joint in range(1, log.joints + 1):
            command, angle, compared = log.command[:, joint - 1], log.angle[:, joint - 1], joint in outputs
            if (compared or command.any()) and np.ptp(angle) == 0:
                yield about("angle is constant", "angle", [joint])
            if compared and settings.columns("command", joint) and np.ptp(command) == 0:
                yield about("command is constant", "command", [joint])

    def raised() -> Iterator[LogFinding]:
        """Commands that rest in the middle of a range."""
        for joint in range(1, log.joints + 1):
            columns, likely = settings.columns("command", joint), likely_range(log.command[:, joint - 1])
            if columns and len(columns.column) == 1 and likely and likely.offset:
                yield about("raised range", "command", [joint], likely.remedy(columns.scale, columns.offset))

    def small() -> Iterator[LogFinding]:
        """Commands in a small range, though the joints move well; else they may be small commands in %."""
        joint = max(motions, key=lambda joint: motions[joint].travel)
        columns, likely = settings.columns("command", joint), likely_range(log.command.ravel())
        if columns and likely and likely.name in ("±1", "±10 V") and motions[joint].travel > 3:
            numbers = {"largest": 100 / likely.scale, "travel": motions[joint].travel}
            remedy = likely.remedy(columns.scale, columns.offset)
            yield about("small range", "command", [joint], {**numbers, **remedy})

    def radians() -> Iterator[LogFinding]:
        """Angles that are too small for the commands, 1.5 deg/s at full command, and all below pi."""
        judged = {joint: motion for joint, motion in motions.items() if motion.push > LEAST}
        sluggish = all(0 < motion.path < 0.015 * motion.push for motion in judged.values())
        if judged and sluggish and np.nanmax(np.abs(log.angle)) <= np.deg2rad(3.2):
            yield about("sluggish", "angle", [*judged][:1], {"most": 3.2})

    findings = [*constant()]
    units = [*raised()] or [*small()] if motions and "unit of command" not in said else []
    findings += units or ([] if "unit of angle" in said else [*radians()])
    lags = {
        joint: motion.lag for joint, motion in motions.items() if motion.lag is not None and motion.shifted
    }
    signs: tuple[tuple[str, Level, int], ...] = (("early", "note", 1), ("late", "warning", -1))
    for kind, level, sign in signs:
        if joints := [joint for joint, lag in lags.items() if sign * lag > 0]:
            lag = float(np.median([lags[joint] for joint in joints]))
            numbers = {"lag": abs(lag), "delay": settings.delay_s + lag}
            findings.append(about(kind, "command", joints, numbers, level))
    for joint, motion in motions.items():
        if motion.turned:
            path, against = motion.directed
            findings.append(about("turned", "command", [joint], {"path": path, "against": against}))
    return together(findings)


def motion_findings(log: Log) -> list[LogFinding]:
    """Report joints that hardly move or stand at a stop, and a log that does not begin at rest."""
    findings, rest = list[LogFinding](), log.first_command * log.period
    for joint, motion in driven_joints(log).items():
        if motion.push > LEAST and 0 < motion.travel < 2:  # [deg]
            findings.append(found("warning", "no motion", log.source, [joint], most=motion.travel))
        elif motion.stopped >= 0.5:
            findings.append(found("note", "at a stop", log.source, [joint], seconds=motion.stopped))
    if log.driven.any() and rest < 0.2:
        findings.append(found("note", "no rest", log.source, after=f" after {rest:.2g} s" if rest else ""))
    return findings


def survey(logs: Sequence[Log]) -> list[LogFinding]:
    """Report what all logs together lack or contradict: directions, and commands that none of them has."""
    findings, gaps, missing = list[LogFinding](), list[str](), list[str]()
    motions = [driven_joints(log) for log in logs]
    for joint in sorted({joint for of_log in motions for joint in of_log}):
        own = [of_log[joint] for of_log in motions if joint in of_log]
        turned, straight = [m for m in own if m.turned], [m for m in own if m.straight]
        if turned and straight:
            odd, every = min(turned, straight, key=len)[0].log.source, len(turned + straight)
            some, logs_ = str(len(turned)), str(every)
            findings.append(found("warning", "directions differ", odd, [joint], turned=some, logs=logs_))
        held = _held([motion.log for motion in own], joint)
        open_ = [f"between {a:.0f} and {b:.0f}" for a, b in pairwise(held) if b - a >= 20 and a * b > 0]
        open_ += [f"above {high:.0f}" for high in held[-1:] if 0 < high < 80]
        open_ += [f"below {low:.0f}" for low in held[:1] if -80 < low < 0]
        gaps += [f"joint {joint} {', '.join(open_)}"] if open_ else []
        signs = ((1, "positive"), (-1, "negative"))
        missing += [
            f"joint {joint} {word}" for sign, word in signs if len(held) and not (sign * held > 0).any()
        ]
    source = logs[0].source if len(logs) == 1 else f"{len(logs)} logs"
    if gaps:
        more = f"; and of {len(gaps) - 3} more joints" if len(gaps) > 3 else ""
        findings.append(found("note", "open valve curve", source, gaps="; ".join(gaps[:3]) + more))
    if missing:
        findings.append(found("note", "one direction", source, missing))
    return findings


def _held(logs: Sequence[Log], joint: int) -> Floats:
    """Return the commands [%] that are held for 0.3 s in all, without 0, rounded to 5 % and ascending."""
    levels = [np.rint(log.command[:, joint - 1] / 5) for log in logs]
    seconds = [np.full(len(log.time), log.period) for log in logs]
    held, where = np.unique(np.concatenate(levels), return_inverse=True)
    return 5 * held[(np.bincount(where, np.concatenate(seconds)) >= 0.3 * (1 - 1e-9)) & (held != 0)]
