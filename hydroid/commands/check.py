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
    refuse_overwriting,
)
from hydroid.commands.logs import check_file, plain_findings, undriven_findings
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
    motion_findings,
    open_table,
    write_log,
)
from hydroid.settings.fit import FitSettings
from hydroid.settings.log import LogSettings
from hydroid.units import way
from hydroid.words import listed

if TYPE_CHECKING:
    from hydroid.fitting.agreement import Agreement


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
    names = settings.arm.joint_names
    with Progress() as progress:
        files = list[_File]()
        paths = [Path(log) for log in as_list(logs)]
        for number, path in enumerate(paths, 1):
            progress("reading log", number, len(paths), path.name)
            found = check_file(path, settings, repair=repair, progress=progress)
            files.append(_File(path, *found))
        there = [log for file in files for log in file.parts]
        progress("looking at the motion", len(paths), None)
        motion = [
            *undriven_findings(there, settings),
            *motion_findings(there, settings.arm),
        ]
        agreements = _compared(there, settings, progress)
    motion += odd_logs(agreements, there, settings)
    checks = [one for file in files for one in _checks(file, motion, names)]
    sizes = [_size(one, settings) for one in checks if one.log is not None]
    lines = [
        f"{level}: {line}"
        for level, line in grouped(f for one in checks for f in one.findings)
    ]
    summary = list[str]()
    if agreements and not any(one.odd for one in agreements):
        joints = listed([names[one.joint - 1] for one in agreements])
        summary.append(
            f"No log stands out in speed, dead bands or delay of {joints}; -v shows all logs."
        )
    content = {
        "logs": [_plain(one, names) for one in checks],
        "agreement": plain(agreements, names),
    }
    refused = not all(_is_usable(one) for one in checks)
    shown = tables(agreements, names, every=False)
    details = tables(agreements, names, every=True)
    return Result(
        [*lines, *sizes, *shown, *summary],
        content,
        checks,
        exit_status=2 if refused else 0,
        details=[] if shown == details else details,
    )


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
        own = file.findings if part is file.parts[0] else ()
        findings = by_level(
            [*own, *(one for one in motion if one.source == part.source)]
        )
        moved = {
            names[joint - 1]: one.travel for joint, one in driven_joints(part).items()
        }
        yield LogCheck(file.path, part, findings, moved)


def _is_usable(one: LogCheck) -> bool:
    return all(finding.level != "error" for finding in one.findings)


def _size(one: LogCheck, settings: FitSettings) -> str:
    """Return a line on a log: how long it is, and what moves in it."""
    assert one.log is not None
    slides = {settings.arm.joint_names[joint - 1] for joint in settings.arm.slides}
    ways = [
        f"{name} by {way(travel, slides=name in slides)}"
        for name, travel in one.moved_deg.items()
    ]
    size = f"{len(one.log.time)} samples, {one.log.duration:.2f} s"
    return f"{one.log.source}: {size}; driven and moved: {', '.join(ways) or 'nothing'}"


def _plain(one: LogCheck, names: Sequence[str]) -> Plain:
    """Return a log as JSON holds it."""
    log = one.log
    return {
        "log": str(one.path) if log is None else log.source,
        "usable": _is_usable(one),
        "samples": log and len(log.time),
        "duration_s": log and log.duration,
        "driven_joints": [] if log is None else np.array(names)[log.driven].tolist(),
        "moved_deg": one.moved_deg,
        "findings": plain_findings(one.findings),
    }


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
        config (YAML): Settings that map the columns (`log`): a file, or the name of a
            shipped config [default: the columns are guessed, and each guess is
            printed].
        set (KEY=VALUE): Replace a setting of --config.

    Raises:
        LogError: the log cannot be used.
        SettingsError: `out` would overwrite the log, or a setting that is not allowed.
        RunError: `out` cannot be written.
    """
    path, guess, reasons = Path(log), None, list[str]()
    refuse_overwriting(path, out)
    if config is not None or set:
        settings = load_settings(config or "fit-mech", set)
        layout, ranges, arm = settings.log, settings.arm.ranges, settings.arm
    else:
        arm = None
        # more joints than an arm has
        most = [f"joint {number}" for number in range(1, 13)]
        guess = guess_columns(open_table(path), most)
        layout = LogSettings.model_validate(guess.log)
        ranges = {
            str(number): (-np.inf, np.inf)
            for number in range(1, 1 + max(layout.joints, default=1))
        }
        reasons = [*guess.reasons]
    parts, findings = check_parts(path, layout, ranges, Reading(arm=arm, repair=repair))
    if not parts:
        raise findings[0].error()
    read = _with_gaps(parts)
    write_log(Path(out), read, _plain_layout(read), exact=True)
    said = (f"{finding.level}: {finding}" for finding in findings)
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
        [*reasons, *said, size],
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
        samples = np.ceil((part.begin - first.begin) / first.period - 1e-6)
        times.append(first.period * (samples + np.arange(len(part.time))))
    pressures = [part.pressure for part in parts if part.pressure is not None]
    return replace(
        first,
        time=np.concatenate(times),
        command=np.concatenate([part.command for part in parts]),
        angle=np.concatenate([part.angle for part in parts]),
        pressure=np.concatenate(pressures) if pressures else None,
    )


def _plain_layout(log: Log) -> LogSettings:
    """Return the default columns of what a log holds: commands, angles, pressures of
    both chambers."""
    columns: dict[int, dict[str, None] | None] = {}
    for joint, measured in enumerate(log.measured):
        absent: dict[str, None] = {} if measured else {"angle": None}
        if log.pressure is None or np.isnan(log.pressure[0, joint]).any():
            absent["pressure"] = None
        columns[joint + 1] = absent if measured or log.driven[joint] else None
    return LogSettings.model_validate({"pressure": {}, "joints": columns})
