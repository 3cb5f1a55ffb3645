"""A log file -> `Log`: open, map, repair, check, resample."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hydroid.errors import LogError
from hydroid.log.checks import check_recording, sample_period
from hydroid.log.delay import delay_findings
from hydroid.log.direction import direction_findings
from hydroid.log.log import Finding, Floats, Log, numbered
from hydroid.log.open_table import open_table
from hydroid.log.resample import fill, is_on_grid, resample, unwrap
from hydroid.log.signals import (
    Recording,
    Signal,
    absent_joints,
    map_signals,
    missing_columns,
    read_recording,
)
from hydroid.settings.log import LogSettings


def read_log(
    path: Path,
    settings: LogSettings,
    ranges: Floats,
    *,
    outputs: Sequence[int] = (),
    angles_required: bool = True,
    repair: bool = False,
) -> tuple[Log, list[Finding]]:
    """Read a log that is to be used.

    Args:
        path: the file.
        settings: its columns, units and tolerances.
        ranges: of the joints [rad], shape (J, 2), (-inf, inf) for a continuous joint.
        outputs: joints (numbers, from 1) whose angles a fit compares.
        angles_required: whether an angle column that the file lacks is an error, or the joint unmeasured.
        repair: fill holes up to `settings.repair_s`.

    Returns:
        The log at `settings.period_s`, and warnings and notes.

    Raises:
        LogError: the first fault that keeps the log from being used.
    """
    log, findings = check_log(
        path, settings, ranges, outputs=outputs, angles_required=angles_required, repair=repair
    )
    if log is None:
        raise next(finding for finding in findings if finding.level == "error").error()
    return log, findings


def check_log(
    path: Path,
    settings: LogSettings,
    ranges: Floats,
    *,
    outputs: Sequence[int] = (),
    angles_required: bool = True,
    repair: bool = False,
) -> tuple[Log | None, list[Finding]]:
    """Find everything that is wrong with a log; the arguments are those of `read_log`.

    Returns:
        The log, None if any finding is an error; and all findings, errors first.
    """
    wanted = map_signals(settings, ranges)
    try:
        file = open_table(path, settings, [signal.name for signal in wanted])
    except LogError as error:
        return None, [_unreadable(error)]
    findings = _mapping_faults(str(path), settings, wanted, len(ranges), outputs)
    if not angles_required:
        wanted = [c for c in wanted if c.kind not in ("angle", "pressure") or c.name in file.names]
    if absent := absent_joints(file, wanted, {*outputs, *settings.joints}):
        findings.append(Finding("note", f"holds nothing of {numbered(absent)}", str(path)))
        wanted = [signal for signal in wanted if signal.joint not in absent]
    findings += missing_columns(file, wanted)
    signals = [signal for signal in wanted if signal.name in file.names]
    log = None
    if signals and signals[0].kind == "time":
        try:
            recording, remarks = read_recording(file, signals)
        except LogError as error:
            return None, [*findings, _unreadable(error)]
        recording, notes = unwrap(recording)
        notes += remarks
        if repair:
            recording, repairs = fill(recording, settings.repair_s)
            notes += repairs
        findings += [*notes, *check_recording(recording, settings, outputs, repaired=repair)]
        if all(finding.level != "error" for finding in findings):
            log, more = _to_log(recording, settings, len(ranges))
            findings += more
    return log, sorted(findings, key=lambda finding: ("error", "warning", "note").index(finding.level))


def _unreadable(error: LogError) -> Finding:
    return Finding("error", error.what, error.where, error.hint, kind="unreadable")


def _mapping_faults(
    source: str, settings: LogSettings, wanted: Sequence[Signal], joints: int, outputs: Sequence[int]
) -> list[Finding]:
    measured = {signal.joint for signal in wanted if signal.kind == "angle"}
    hint = "map it in log.joints, or choose another output"
    return [
        Finding("error", f"log.joints.{joint}: the arm has joints 1 to {joints}", source)
        for joint in settings.joints
        if joint > joints
    ] + [
        Finding("error", f"output joint {joint} has no angle column", source, hint)
        if joint <= joints
        else Finding("error", f"outputs: there is no joint {joint}; the arm has joints 1 to {joints}", source)
        for joint in outputs
        if joint not in measured
    ]


def _to_log(recording: Recording, settings: LogSettings, joints: int) -> tuple[Log, list[Finding]]:
    command, angle = recording.motions(joints)
    pressure, period = recording.pressures(joints), settings.period_s
    measured = angle if pressure is None else np.column_stack([angle, pressure.reshape(len(angle), -1)])
    time, command, measured = resample(
        recording.time, command.clip(-100, 100), measured, period, settings.delay_s
    )
    if pressure is not None:
        pressure = measured[:, joints:].reshape(-1, joints, 2)
    log = Log(recording.file.source, time, command, measured[:, :joints], period, pressure)
    findings = list[Finding]()
    if not is_on_grid(recording.time, period):
        what = f"resampled from {sample_period(recording.time):.6g} s to {period:g} s"
        if abs(sample_period(recording.time) / period - 1) < 1e-3:
            what = f"uneven samples brought to an even period of {period:g} s"
        findings.append(
            recording.finding("note", what, "commands held, angles interpolated", kind="resampled")
        )
    commands = any(signal.kind == "command" for signal in recording.signals)
    if commands and not log.driven.any():
        findings.append(
            recording.finding("warning", "no joint is driven", "check log.command", kind="undriven")
        )

    def column(joint: int) -> str:
        return recording.signal("command", joint).name

    findings += [*delay_findings(log, settings.delay_s, column), *direction_findings(log, column)]
    return log, findings
