"""`hydroid check` and `hydroid convert`: what is wrong or unusual about logs, and logs
as plain CSV."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hydroid.arrays import Array, record
from hydroid.commands.agreement import odd_logs, plain, tables
from hydroid.commands.console import Result
from hydroid.commands.inputs import (
    ConfigSource,
    LogSources,
    SettingChanges,
    Source,
    as_list,
    command,
    load_settings,
    note_shipped_arm,
    refuse_overwriting,
)
from hydroid.commands.joint_units import in_joint_units
from hydroid.commands.logs import check_file, joint_findings, plain_findings
from hydroid.commands.progress import Progress
from hydroid.files import Plain
from hydroid.log import (
    ColumnGuess,
    Log,
    LogFinding,
    Reading,
    by_level,
    check_parts,
    driven_joints,
    grouped,
    guess_columns,
    lacked_by_all,
    motion_findings,
    open_table,
    write_log,
)
from hydroid.log.conditions import stated, varies, words_of
from hydroid.settings.fit import FitSettings
from hydroid.settings.log import EFFECTS, Input, LogSettings
from hydroid.words import listed

if TYPE_CHECKING:
    from hydroid.fitting.agreement import Agreement


MOST_JOINTS = 12
"""whose columns are sought in a log of an unknown arm: more than an arm has"""


class LogCheck(NamedTuple):
    """One log, or one part of a file with gaps; travel is by the joints' names.

    The log is None if the file cannot be used. Findings are errors first, those of a
    file at its first part.
    """

    path: Path
    log: Log | None
    findings: Sequence[LogFinding]
    moved_deg: Mapping[str, float]


class Converted(NamedTuple):
    """What was written, or its longest part between gaps, and what each column was
    taken for.

    The guess is None where settings say it.
    """

    log: Log
    guess: ColumnGuess | None


@command
def check(
    logs: "LogSources",
    *,
    config: "ConfigSource" = "fit-mech",
    set: "SettingChanges" = None,
    repair: bool = False,
) -> "Result[list[LogCheck]]":
    """List the faults of logs, and anything unusual in them.

    A finding shared by several logs is listed once. With three logs or more it also
    compares them, and names the one whose speed, dead band or delay differs from the
    others. The exit status is 2 if a log is unusable, or if no joint in these logs can
    be fitted with the settings.

    Example: hydroid check LOG.csv

        print(*hydroid.check(["a.csv", "b.csv"]).result[0].findings, sep="\\n")
    """
    settings = load_settings(config, set)
    if config == "fit-mech":
        note_shipped_arm(settings)
    names = settings.arm.joint_names
    with Progress() as progress:
        files = _read_files(as_list(logs), settings, progress, repair=repair)
        parts = list[Log]()
        for file in files:
            parts += file.parts
        progress("looking at the motion", len(files), None)
        motion = [
            *joint_findings(parts, settings),
            *motion_findings(parts, settings.arm),
        ]
        agreements = _compared(parts, settings, progress)
    # what stands out is said of the log, as its other findings are
    motion += odd_logs(agreements, parts, settings)
    checks = list[LogCheck]()
    for file in files:
        checks += _checks(file, motion, names)
    shown = tables(agreements, names, every=False)
    details = tables(agreements, names, every=True)
    content = {
        "logs": [_plain(log_check, settings) for log_check in checks],
        "agreement": plain(agreements, names),
    }
    content = in_joint_units(content, settings.arm)
    return Result(
        [
            *_finding_lines(checks),
            *_sizes(checks, settings),
            *_steady(parts, settings.log),
            *shown,
            *_summary(agreements, names),
        ],
        content,
        checks,
        exit_status=0 if all(map(_is_usable, checks)) else 2,
        details=[] if shown == details else details,
    )


def _read_files(
    logs: Sequence[str | Path],
    settings: FitSettings,
    progress: Progress,
    *,
    repair: bool,
) -> "list[_File]":
    files = list[_File]()
    for number, log in enumerate(logs, 1):
        path = Path(log)
        progress("reading log", number, len(logs), path.name)
        parts, findings = check_file(path, settings, repair=repair, progress=progress)
        files.append(_File(path, parts, findings))
    findings_of_all = lacked_by_all([file.findings for file in files])
    return [
        replace(file, findings=findings)
        for file, findings in zip(files, findings_of_all, strict=True)
    ]


def _finding_lines(checks: Sequence[LogCheck]) -> list[str]:
    """Return a line for each finding, those that logs share once."""
    findings = list[LogFinding]()
    for log_check in checks:
        findings += log_check.findings
    return [f"{level}: {line}" for level, line in grouped(findings)]


def _summary(agreements: "Sequence[Agreement]", names: Sequence[str]) -> Iterator[str]:
    """Yield that logs which were compared are alike, if they are."""
    if agreements and not any(agreement.odd for agreement in agreements):
        joints = listed([names[agreement.joint - 1] for agreement in agreements])
        yield f"No log stands out in speed, dead bands or delay of {joints}; -v shows all logs."


def _compared(
    logs: Sequence[Log], settings: FitSettings, progress: Progress
) -> "list[Agreement]":
    """Compare logs, if there are enough; what compares them takes most of a second to
    be loaded."""
    if len(logs) < 3:
        return []
    from hydroid.fitting.agreement import compare_logs

    return compare_logs(logs, [*settings.arm.ranges.values()], progress)


@record
class _File:
    """The parts of a file between its gaps, none if it cannot be used, and what was
    found in it."""

    path: Path
    parts: Sequence[Log]
    findings: Sequence[LogFinding]


def _checks(
    file: _File, motion: Sequence[LogFinding], names: Sequence[str]
) -> Iterator[LogCheck]:
    """Yield what was found in each part of a file, and in its motion."""
    if not file.parts:
        yield LogCheck(file.path, None, file.findings, {})
    for part in file.parts:
        findings = [finding for finding in motion if finding.source == part.source]
        # those of the file are said once
        if part is file.parts[0]:
            findings = [*file.findings, *findings]
        moved = dict[str, float]()
        for joint, joint_motion in driven_joints(part).items():
            moved[names[joint - 1]] = joint_motion.travel
        yield LogCheck(file.path, part, by_level(findings), moved)


def _is_usable(log_check: LogCheck) -> bool:
    return all(finding.level != "error" for finding in log_check.findings)


def _sizes(checks: Sequence[LogCheck], settings: FitSettings) -> Iterator[str]:
    """Yield a line on each log: how long it is, and what moves in it."""
    shown = {joint.name: joint.shown for joint in settings.arm.joints}
    for log_check in checks:
        log = log_check.log
        if log is None:
            continue
        ways = list[str]()
        for name, travel in log_check.moved_deg.items():
            ways.append(f"{name} by {shown[name].way(travel)}")
        size = f"{len(log.time)} samples, {log.duration:.2f} s"
        moved = ", ".join(ways) or "nothing"
        under = "".join(
            f"; {words_of(name)} {least:.4g} to {most:.4g} {unit}"
            for name, (least, most, unit) in _conditions(log, settings.log).items()
        )
        yield f"{log.source}: {size}; driven and moved: {moved}{under}"


def _conditions(
    log: Log, settings: LogSettings
) -> dict[Input, tuple[float, float, str]]:
    """Return between which values the engine's speed and the oil's temperature lie, and
    the unit of these."""
    ends = dict[Input, tuple[float, float, str]]()
    for name in EFFECTS:
        column = settings.condition(name)
        values = stated(log, settings, name)
        if column is not None and values is not None:
            ends[name] = float(values.min()), float(values.max()), column.unit
    return ends


def _steady(logs: Sequence[Log], settings: LogSettings) -> Iterator[str]:
    """Yield which columns hold too little of a condition to tell its effect."""
    for name in EFFECTS:
        if logs and settings.condition(name) and not varies(logs, name):
            what = f"The {words_of(name)} is nearly the same in all logs"
            yield f"{what}: its effect cannot be told."


def _plain(log_check: LogCheck, settings: FitSettings) -> Plain:
    """Return a log as JSON holds it."""
    log = log_check.log
    names = settings.arm.joint_names
    content: Plain = {
        "log": str(log_check.path),
        "usable": _is_usable(log_check),
        "samples": None,
        "duration_s": None,
        "driven_joints": [],
        "moved_deg": log_check.moved_deg,
        "findings": plain_findings(log_check.findings),
    }
    if log is not None:
        content["log"] = log.source
        content["samples"] = len(log.time)
        content["duration_s"] = log.duration
        content["driven_joints"] = np.array(names)[log.driven].tolist()
        for name, (least, most, unit) in _conditions(log, settings.log).items():
            content[name] = {"from": least, "to": most, "unit": unit}
    return content


@command
def convert(
    log: "Source",
    *,
    out: "Source",
    config: "ConfigSource | None" = None,
    set: "SettingChanges" = None,
    repair: bool = False,
) -> Result[Converted]:
    """Write a log of any format as the CSV that every command reads: time [s], commands
    [%], angles [deg].

    With --config the CSV holds the data as a fit uses them: resampled to log.period_s,
    commands delayed by log.delay_s, signs and units applied. Joints that are measured
    but not commanded have commands of 0 %.

    Example: hydroid convert LOG.mat --out LOG.csv

        hydroid.convert("a.mat", out="a.csv", config="my-fit.yaml")

    Args:
        out (OUT.csv): The CSV to write.
        config (YAML): Settings whose section `log` says what each column is: a file, or
            the name of a config that comes with hydroid [default: the columns are guessed, and each guess is
            printed].
        set (KEY=VALUE): Replace a setting of --config.

    Raises:
        LogError: the log cannot be used.
        SettingsError: `out` would overwrite the log, or a setting that is not allowed.
        RunError: `out` cannot be written.
    """
    path = Path(log)
    refuse_overwriting(path, out)
    arm = None
    guess = None
    reasons = list[str]()
    if config is not None or set:
        settings = load_settings(config or "fit-mech", set)
        layout = settings.log
        arm = settings.arm
        ranges = arm.ranges
    else:
        joints = [f"joint {number}" for number in range(1, MOST_JOINTS + 1)]
        guess = guess_columns([open_table(path)], joints)
        layout = LogSettings.model_validate(guess.log)
        last = max(layout.joints, default=1)
        ranges = {str(number): (-np.inf, np.inf) for number in range(1, last + 1)}
        reasons += guess.reasons
    parts, findings = check_parts(path, layout, ranges, Reading(arm=arm, repair=repair))
    # errors come first
    if not parts:
        raise findings[0].error()
    read = _with_gaps(parts)
    write_log(Path(out), read, _plain_layout(read, layout), exact=True)
    lines = [f"{finding.level}: {finding}" for finding in findings]
    size = f"{out}: {len(read.time)} samples, {read.duration:.2f} s, every {read.period:g} s"
    longest = max(parts, key=lambda part: part.duration)
    content = {
        "out": str(out),
        "samples": len(read.time),
        "duration_s": read.duration,
        "period_s": read.period,
        "findings": plain_findings(findings),
        "log": guess and guess.log,
        "reasons": reasons,
    }
    return Result(
        [*reasons, *lines, size],
        content,
        Converted(replace(longest, source=str(out)), guess),
    )


def _with_gaps(parts: Sequence[Log]) -> Log:
    """Return the parts of a log as one, to be written; its gaps are longer by less than
    a sample."""
    first = parts[0]
    if len(parts) == 1:
        return first
    times = list[Array]()
    for part in parts:
        # on the grid of the first part, so that a reader finds one period
        samples = np.ceil((part.begin - first.begin) / first.period - 1e-6)
        times.append(first.period * (samples + np.arange(len(part.time))))
    pressures = [part.pressure for part in parts if part.pressure is not None]
    conditions = [part.conditions for part in parts if part.conditions is not None]
    return replace(
        first,
        time=np.concatenate(times),
        command=np.concatenate([part.command for part in parts]),
        angle=np.concatenate([part.angle for part in parts]),
        pressure=np.concatenate(pressures) if pressures else None,
        conditions=np.concatenate(conditions) if conditions else None,
    )


def _plain_layout(log: Log, settings: LogSettings) -> LogSettings:
    """Return the columns of what a log holds that was read by settings: commands,
    angles, pressures of both chambers by default, engine speed and oil temperature in
    their units."""
    columns: dict[int, dict[str, None] | None] = {}
    for joint, measured in enumerate(log.has_angle):
        absent: dict[str, None] = {} if measured else {"angle": None}
        if log.pressure is None or np.isnan(log.pressure[0, joint]).any():
            absent["pressure"] = None
        columns[joint + 1] = absent if measured or log.driven[joint] else None
    conditions: Plain = {}
    for name in EFFECTS:
        column = settings.condition(name)
        if column is not None:
            plain = {"column": f"{name}_{column.unit}", "scale": 1.0, "offset": 0.0}
            conditions[name] = column.changed(plain)
    return LogSettings.model_validate({"pressure": {}, "joints": columns, **conditions})
