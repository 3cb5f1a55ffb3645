"""One log <-> `Log`: open, map, repair, check, resample; and written so that it reads back the same."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hydroid.errors import LogError
from hydroid.files import write_atomic
from hydroid.log.checks import check_recording, sample_period
from hydroid.log.delay import delay_findings
from hydroid.log.log import Finding, Floats, Log, numbered
from hydroid.log.open_table import open_table
from hydroid.log.resample import fill, hold, is_on_grid, resample, unwrap
from hydroid.log.signals import (
    Recording,
    Signal,
    absent_joints,
    map_signals,
    missing_columns,
    read_recording,
)
from hydroid.settings.log import LogSettings

DIGITS = "%.10g"


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
        return None, [Finding("error", error.what, error.where, error.hint)]
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
            return None, [*findings, Finding("error", error.what, error.where, error.hint)]
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
        findings.append(recording.finding("note", what, "commands held, angles interpolated"))
    if not log.driven.any():
        findings.append(recording.finding("warning", "no joint is driven", "check log.command"))
    findings += delay_findings(log, settings.delay_s, lambda joint: recording.signal("command", joint).name)
    return log, findings


def write_log(path: Path, log: Log, settings: LogSettings) -> None:
    """Write a log, whole or not at all.

    The command is written ahead by `settings.delay_s`, so that reading delays it to what `log` holds.

    Raises:
        LogError: the settings map no column for a joint that is driven, or a column for an angle that was not
            measured.
        RunError: the file cannot be written.
    """
    signals = map_signals(settings, np.full((log.joints, 2), np.inf))
    if log.pressure is None:
        signals = [signal for signal in signals if signal.kind != "pressure"]
    commanded = {signal.joint for signal in signals if signal.kind == "command"}
    for joint in np.flatnonzero(log.driven) + 1:
        if joint not in commanded:
            hint = f"map a column in log.joints.{joint}.command"
            what = f"joint {joint} is driven but no column holds its command"
            raise LogError(what, where=str(path), hint=hint)
    for signal in signals:
        if signal.kind == "angle" and not log.measured[signal.joint - 1]:
            hint = f"set log.joints.{signal.joint}.angle: null"
            raise LogError(f"joint {signal.joint} has no angle to write", where=str(path), hint=hint)
    command = hold(log.time, log.command, log.time + settings.delay_s, log.period)
    columns = [_cells(signal, log, command) for signal in signals]
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow([signal.name for signal in signals])
    np.savetxt(text, np.stack(columns, axis=1), fmt=DIGITS, delimiter=",")
    write_atomic(path, text.getvalue())


def _cells(signal: Signal, log: Log, command: Floats) -> Floats:
    """Return the column [file's unit] whose reading gives the log's values, shape (T,)."""
    values = log.time
    if signal.kind == "command":
        values = signal.sign * command[:, signal.joint - 1]
        values = values.clip(min=0.0) if signal.low == 0 else values
    elif signal.kind == "angle":
        values = log.angle[:, signal.joint - 1]
    elif signal.kind == "pressure":
        assert log.pressure is not None
        values = log.pressure[:, signal.joint - 1, signal.chamber]
    return (values - signal.offset) / signal.gain
