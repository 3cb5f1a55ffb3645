"""What the motion in logs says: of the settings, of the log, and of all logs together."""

from collections.abc import Collection, Sequence
from itertools import pairwise

import numpy as np

from hydroid.findings import Level
from hydroid.log.clues import likely_range
from hydroid.log.finding import LogFinding, log_finding, together
from hydroid.log.log import Log
from hydroid.log.motion import driven_joints
from hydroid.settings.log import Kind, LogSettings


def contradictions(
    log: Log,
    settings: LogSettings,
    outputs: Collection[int],
    said: Collection[str],
    backward: Collection[int],
) -> list[LogFinding]:
    """Return what the motion says against the settings, but for commands' range if the file `said` a unit.

    A positive command turns the joints `backward` to negative angles.
    """
    motions, findings = driven_joints(log), list[LogFinding]()

    def add(level: Level, kind: str, of: Kind, joints: Sequence[int], **numbers: float | str) -> None:
        columns = settings.columns(of, joints[0])
        place = ("line", None, columns.column[0] if columns else "")
        findings.append(log_finding(level, kind, log.source, joints, place, **numbers))

    for joint, (command, angle) in enumerate(zip(log.command.T, log.angle.T, strict=True), 1):
        if (joint in outputs or command.any()) and np.ptp(angle) == 0:
            add("warning", "angle is constant", "angle", [joint])
        if joint in outputs and settings.columns("command", joint) and np.ptp(command) == 0:
            add("warning", "command is constant", "command", [joint])
    common = likely_range(log.command.ravel())
    # of commands within 10 %, although joints move well; else they may be small commands in %
    small = common and common.name in ("±1", "±10 V") and any(m.travel > 3 for m in motions.values())
    for joint, motion in motions.items():
        columns, likely = settings.columns("command", joint), likely_range(log.command[:, joint - 1])
        likely = common if small else likely
        fits = likely and columns and (small or (likely.offset and len(columns.column) == 1))
        if likely and columns and fits and "unit of command" not in said:
            numbers = likely.remedy(columns.scale, columns.offset)
            add("warning", "range", "command", [joint], **numbers)
        if motion.turned and joint not in backward:
            path, against = motion.directed
            add("warning", "turned", "command", [joint], path=path, against=against)
    still = {j: m.travel for j, m in motions.items() if m.push > 300 and 0 < m.travel < 2}
    if still:
        add("warning", "no motion", "angle", [*still], most=max(still.values()))
    signs: tuple[tuple[str, Level, int], ...] = (("early", "note", 1), ("late", "warning", -1))
    for kind, level, sign in signs:
        lags = {j: m.lag for j, m in motions.items() if m.lag and m.shifted and sign * m.lag > 0}
        if lags:
            lag = float(np.median([*lags.values()]))
            add(level, kind, "command", [*lags], lag=abs(lag), delay=settings.delay_s + lag)
    return together(findings)


def motion_findings(log: Log) -> list[LogFinding]:
    """Report joints that stand at a stop, and a log that does not begin at rest."""
    stopped = {joint: motion.stopped for joint, motion in driven_joints(log).items()}
    findings = [
        log_finding("note", "at a stop", log.source, [joint], seconds=seconds)
        for joint, seconds in stopped.items()
        if seconds >= 0.5
    ]
    rest = log.first_command * log.period
    if log.driven.any() and rest < 0.2:
        after = f" after {rest:.2g} s" if rest else ""
        findings.append(log_finding("note", "no rest", log.source, after=after))
    return findings


def survey(logs: Sequence[Log]) -> list[LogFinding]:
    """Report what all logs together lack or contradict: directions, and commands that none of them has."""
    findings, gaps = list[LogFinding](), list[str]()
    motions = [driven_joints(log) for log in logs]
    for joint in sorted({joint for of_log in motions for joint in of_log}):
        own = [of_log[joint] for of_log in motions if joint in of_log]
        turned, straight = [m for m in own if m.turned], [m for m in own if m.straight]
        if turned and straight:
            odd = min(turned, straight, key=len)[0].log.source
            some, every = str(len(turned)), str(len(turned + straight))
            findings.append(
                log_finding("warning", "directions differ", odd, [joint], turned=some, logs=every)
            )
        held = _held_levels([motion.log for motion in own], joint)
        open_ = [f"between {a} and {b}" for a, b in pairwise(held) if b - a >= 20 and a * b > 0]
        open_ += [f"above {max(high, 0)}" for high in held[-1:] if high < 80]
        open_ += [f"below {min(low, 0)}" for low in held[:1] if low > -80]
        gaps += [f"joint {joint} {', '.join(open_)}"] if open_ else []
    source = logs[0].source if len(logs) == 1 else f"{len(logs)} logs"
    if gaps:
        more = f"; and of {len(gaps) - 3} more joints" if len(gaps) > 3 else ""
        findings.append(log_finding("note", "open valve curve", source, gaps="; ".join(gaps[:3]) + more))
    return findings


def _held_levels(logs: Sequence[Log], joint: int) -> list[int]:
    """Return the commands [%] that are held for 0.3 s in all, without 0, rounded to 5 % and ascending."""
    levels = np.concatenate([np.rint(log.command[:, joint - 1] / 5) for log in logs])
    seconds = np.concatenate([np.full(len(log.time), log.period) for log in logs])
    held, where = np.unique(levels, return_inverse=True)
    long = np.bincount(where, seconds) >= 0.3 * (1 - 1e-9)
    return (5 * held[long & (held != 0)]).astype(int).tolist()
