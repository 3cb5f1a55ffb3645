"""What the motion in a log says: against the settings, and of the log."""

from collections.abc import Collection, Sequence

import numpy as np

from hydroid.findings import Level
from hydroid.log.clues import likely_range
from hydroid.log.finding import LogFinding, log_finding
from hydroid.log.log import Log
from hydroid.log.motion import driven_joints
from hydroid.settings.log import Kind, LogSettings
from hydroid.units import UNITS


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
            measured = settings.columns("angle", joint)
            slides = measured and UNITS[measured.unit].quantity == "length"
            way = f"{np.radians(path):.3g} m" if slides else f"{path:.3g} deg"
            add("warning", "turned", "command", [joint], path=way, against=against)
        if motion.push > 300 and 0 < motion.travel < 2:
            add("warning", "no motion", "angle", [joint], most=motion.travel)
        if motion.ahead:
            delay = settings.delay_s - motion.ahead
            add("warning", "late", "command", [joint], lag=motion.ahead, delay=round(delay, 2))
    return findings


def motion_findings(log: Log) -> list[LogFinding]:
    """Report joints that stand at a stop, and a log that does not begin at rest."""
    findings = [
        log_finding("note", "at a stop", log.source, [joint], seconds=motion.stopped)
        for joint, motion in driven_joints(log).items()
        if motion.stopped >= 0.5
    ]
    rest = log.first_command * log.period
    if log.driven.any() and rest < 0.2:
        after = f" after {rest:.2g} s" if rest else ""
        findings.append(log_finding("note", "no rest", log.source, after=after))
    return findings
