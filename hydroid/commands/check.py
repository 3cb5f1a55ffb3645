"""`hydroid check`: what is wrong or unusual about logs."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hydroid.commands.inputs import as_list, load_settings
from hydroid.commands.logs import joint_ranges
from hydroid.commands.options import command
from hydroid.commands.result import Result

if TYPE_CHECKING:
    from hydroid.commands.inputs import ConfigSource, SettingChanges
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

    def plain(self) -> dict[str, Any]:
        """Return what JSON holds."""
        log = self.log
        return {
            "log": str(self.path),
            "usable": log is not None,
            "samples": log and len(log.time),
            "duration_s": log and float(log.duration),
            "driven_joints": [] if log is None else (np.flatnonzero(log.driven) + 1).tolist(),
            "moved_deg": {str(joint): deg for joint, deg in self.moved_deg.items()},
            "findings": plain_findings(self.findings),
        }


class Checked(NamedTuple):
    """Several files, and the findings about all usable ones together."""

    logs: "list[LogCheck]"
    findings: "Sequence[LogFinding]"


@command
def check(
    logs: "LogSources",
    *,
    config: "ConfigSource" = "fit-mech",
    set: "SettingChanges" = None,
    repair: bool = False,
) -> Result[Checked]:
    """List the faults of logs, anything unusual in them, and the commands that none of them has.

    A finding shared by several logs is listed once. The exit status is 2 if a log is unusable.

    Example: hydroid check LOG.csv

        checked = hydroid.check(["a.csv", "b.csv"]).result
        print(*checked.logs[0].findings, *checked.findings, sep="\\n")
    """
    settings = load_settings(config, set)
    from hydroid.log import check_log, driven_joints, grouped, motion_findings, survey

    found: list[LogCheck] = []
    for path in map(Path, as_list(logs)):
        log, findings = check_log(
            path, settings.log, joint_ranges(settings), outputs=settings.outputs, repair=repair
        )
        joints = driven_joints(log) if log else {}
        more = motion_findings(log) if log else []
        moved = {joint: motion.travel for joint, motion in joints.items()}
        found.append(LogCheck(path, log, [*findings, *more], moved))
    together = survey([one.log for one in found if one.log])
    every = [*(finding for one in found for finding in one.findings), *together]
    every.sort(key=lambda finding: ("error", "warning", "note").index(finding.level))
    lines = [f"{level}: {line}" for level, line in grouped(every)]
    contents = [one.plain() for one in found]
    for one in contents:
        if one["usable"]:
            driven = ", ".join(map(str, one["driven_joints"])) or "none"
            moved = ", ".join(f"joint {joint} by {deg:.3g} deg" for joint, deg in one["moved_deg"].items())
            size = f"{one['samples']} samples, {one['duration_s']:.2f} s"
            lines.append(f"{one['log']}: {size}, driven joints: {driven}" + (moved and f"; moved: {moved}"))
    content = {"logs": contents, "findings": plain_findings(together)}
    status = 0 if all(one.log for one in found) else 2
    return Result(lines, content, Checked(found, together), exit_status=status)


def plain_findings(findings: "Sequence[LogFinding]") -> list[dict[str, str]]:
    """Return findings as JSON holds them."""
    keys = ("level", "kind", "what", "where", "hint")
    return [{key: getattr(finding, key) for key in keys} for finding in findings]
