"""`hydroid check`: what is wrong or unusual about logs."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hydroid.commands.inputs import ConfigSource, SettingChanges, as_list, load_settings
from hydroid.commands.options import command
from hydroid.commands.result import Result

if TYPE_CHECKING:
    from hydroid.commands.logs import LogSources
    from hydroid.log import Log, LogFinding


class LogCheck(NamedTuple):
    """One file.

    Attributes:
        path: the file.
        log: None if it is unusable.
        findings: all of them, errors first.
        moved_deg: range over which each driven joint moved, by its number.
    """

    path: Path
    log: "Log | None"
    findings: "Sequence[LogFinding]"
    moved_deg: Mapping[int, float]

    @property
    def driven(self) -> list[int]:
        """Joints with a command, numbered from 1."""
        return [] if self.log is None else (np.flatnonzero(self.log.driven) + 1).tolist()

    def plain(self) -> dict[str, Any]:
        """Return what JSON holds."""
        return {
            "log": str(self.path),
            "usable": self.log is not None,
            "samples": self.log and len(self.log.time),
            "duration_s": self.log and float(self.log.duration),
            "driven_joints": self.driven,
            "moved_deg": {str(joint): deg for joint, deg in self.moved_deg.items()},
            "findings": plain_findings(self.findings),
        }


@command
def check(
    logs: "LogSources",
    *,
    config: "ConfigSource" = "fit-mech",
    set: "SettingChanges" = None,
    repair: bool = False,
) -> "Result[list[LogCheck]]":
    """List the faults of logs, and anything unusual in them.

    A finding shared by several logs is listed once. The exit status is 2 if a log is unusable.

    Example: hydroid check LOG.csv

        print(*hydroid.check(["a.csv", "b.csv"]).result[0].findings, sep="\\n")
    """
    settings = load_settings(config, set)
    from hydroid.log import check_log, driven_joints, grouped, motion_findings

    arm, outputs, checks = settings.arm, settings.outputs, list[LogCheck]()
    for path in map(Path, as_list(logs)):
        log, faults = check_log(
            path, settings.log, arm.ranges, outputs=outputs, backward=arm.backward, repair=repair
        )
        moved = {joint: motion.travel for joint, motion in (driven_joints(log) if log else {}).items()}
        checks.append(LogCheck(path, log, [*faults, *(motion_findings(log) if log else ())], moved))
    usable = [(one, one.log) for one in checks if one.log]
    findings = [finding for one in checks for finding in one.findings]
    findings.sort(key=lambda finding: ("error", "warning", "note").index(finding.level))
    lines = [f"{level}: {line}" for level, line in grouped(findings)]
    for one, log in usable:
        driven = ", ".join(map(str, one.driven)) or "none"
        moved = ", ".join(f"joint {joint} by {deg:.3g} deg" for joint, deg in one.moved_deg.items())
        size = f"{len(log.time)} samples, {log.duration:.2f} s"
        lines.append(f"{one.path}: {size}, driven joints: {driven}" + (moved and f"; moved: {moved}"))
    content = {"logs": [one.plain() for one in checks]}
    return Result(lines, content, checks, exit_status=0 if len(usable) == len(checks) else 2)


def plain_findings(findings: "Sequence[LogFinding]") -> list[dict[str, str]]:
    """Return findings as JSON holds them."""
    keys = ("level", "kind", "what", "where", "hint")
    return [{key: getattr(finding, key) for key in keys} for finding in findings]
