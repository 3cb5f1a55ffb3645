"""`hydroid check`: what is wrong or unusual about logs."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hydroid.commands.inputs import as_list, joint_ranges, load_settings
from hydroid.commands.options import Config, Logs, Repair, Set, command
from hydroid.commands.result import Printed

if TYPE_CHECKING:
    from hydroid.log import Log, LogFinding
    from hydroid.reporting.table import Table


@dataclass(frozen=True, eq=False)
class LogCheck:
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
    moved_deg: dict[int, float] = field(default_factory=dict[int, float])

    @property
    def driven(self) -> list[int]:
        """Numbers of the joints that take commands."""
        return [] if self.log is None else (np.flatnonzero(self.log.driven) + 1).tolist()


@dataclass(frozen=True, eq=False, repr=False)
class Check(Printed):
    """Several files.

    Attributes:
        logs: each file.
        findings: about all usable ones together.
    """

    logs: list[LogCheck]
    findings: "Sequence[LogFinding]"

    @property
    def exit_status(self) -> int:
        """Return 2 if a log is unusable."""
        return 2 if any(log.log is None for log in self.logs) else 0

    def lines(self) -> "list[Table | str]":
        """Return findings by level, then the usable logs, one a line."""
        from hydroid.log import grouped, in_one_line

        every = [*(finding for log in self.logs for finding in log.findings), *self.findings]
        findings = sorted(every, key=lambda f: ("error", "warning", "note").index(f.level))
        lines = [f"{finding.level}: {in_one_line(finding, others)}" for finding, others in grouped(findings)]
        return [*lines, *(_summary(log.path, log.log, log) for log in self.logs if log.log)]

    def plain(self) -> dict[str, Any]:
        """Return each file with its findings."""
        logs = [
            {
                "log": str(log.path),
                "usable": log.log is not None,
                "samples": len(log.log.time) if log.log else None,
                "duration_s": float(log.log.duration) if log.log else None,
                "driven_joints": log.driven,
                "moved_deg": {str(joint): deg for joint, deg in log.moved_deg.items()},
                "findings": plain_findings(log.findings),
            }
            for log in self.logs
        ]
        return {"logs": logs, "findings": plain_findings(self.findings)}


@command
def check(logs: Logs, *, config: Config = "fit-mech", set: Set = None, repair: Repair = False) -> Check:
    """List the faults of logs, anything unusual in them, and the commands that none of them has.

    A finding shared by several logs is listed once. The exit status is 2 if a log is unusable.

    Example: hydroid check LOG.csv

        checked = hydroid.check(["a.csv", "b.csv"])
        print(*checked.logs[0].findings, *checked.findings, sep="\\n")
    """
    settings = load_settings(config, set)
    from hydroid.log import check_log, driven_joints, motion_findings, survey

    results: list[LogCheck] = []
    for path in map(Path, as_list(logs)):
        log, findings = check_log(
            path, settings.log, joint_ranges(settings), outputs=settings.outputs, repair=repair
        )
        if log is None:
            results.append(LogCheck(path, log, findings))
            continue
        motions = {joint: motion.travel for joint, motion in driven_joints(log).items()}
        results.append(LogCheck(path, log, [*findings, *motion_findings(log)], motions))
    return Check(results, survey([result.log for result in results if result.log]))


def plain_findings(findings: "Sequence[LogFinding]") -> list[dict[str, str]]:
    """Return findings as JSON holds them."""
    keys = ("level", "kind", "what", "where", "hint")
    return [{key: getattr(finding, key) for key in keys} for finding in findings]


def _summary(path: Path, log: "Log", check: LogCheck) -> str:
    driven = ", ".join(map(str, check.driven)) or "none"
    moved = ", ".join(f"joint {joint} by {deg:.3g} deg" for joint, deg in check.moved_deg.items())
    text = f"{path}: {len(log.time)} samples, {log.duration:.2f} s, driven joints: {driven}"
    return f"{text}; moved: {moved}" if moved else text
