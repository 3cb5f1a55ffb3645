"""`hydroid check`: what is wrong or unusual about logs."""

from collections.abc import Mapping, Sequence
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from hydroid.commands.inputs import ConfigSource, SettingChanges, as_list, load_settings
from hydroid.commands.logs import check_file, named, plain_findings
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
        moved_deg: range over which each driven joint moved, by its name.
    """

    path: Path
    log: "Log | None"
    findings: "Sequence[LogFinding]"
    moved_deg: Mapping[str, float]


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
    from hydroid.log import driven_joints, grouped, motion_findings

    names, checks = settings.arm.joint_names, list[LogCheck]()
    for path in map(Path, as_list(logs)):
        log, faults = check_file(path, settings, repair=repair)
        moved, found = {}, list(faults)
        if log is not None:
            moved = {names[joint - 1]: motion.travel for joint, motion in driven_joints(log).items()}
            found += named(motion_findings(log), names)
        checks.append(LogCheck(path, log, found, moved))
    findings = [finding for one in checks for finding in one.findings]
    findings.sort(key=lambda finding: ("error", "warning", "note").index(finding.level))
    lines = [f"{level}: {line}" for level, line in grouped(findings)]
    content: dict[str, Any] = {"logs": []}
    for one in checks:
        size = {"samples": one.log and len(one.log.time), "duration_s": one.log and float(one.log.duration)}
        driven = [] if one.log is None else [n for n, d in zip(names, one.log.driven, strict=True) if d]
        content["logs"].append(
            {"log": str(one.path), "usable": one.log is not None, **size, "driven_joints": driven}
            | {"moved_deg": dict(one.moved_deg), "findings": plain_findings(one.findings)}
        )
        if one.log is not None:
            ways = one.moved_deg.items()
            slides = {names[j - 1] for j in settings.arm.slides}
            shown = [f"{n} by {f'{radians(d):.3g} m' if n in slides else f'{d:.3g} deg'}" for n, d in ways]
            moved = ", ".join(shown) or "nothing"
            length = f"{len(one.log.time)} samples, {one.log.duration:.2f} s"
            lines.append(f"{one.path}: {length}; driven and moved: {moved}")
    exit_status = 0 if all(one.log for one in checks) else 2
    return Result(lines, content, checks, exit_status=exit_status)
