"""One CSV log -> `Log`: open, map, repair, check, resample."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hydroid.errors import LogError
from hydroid.log.checks import check_recording, sample_period
from hydroid.log.csv_file import open_csv
from hydroid.log.delay import delay_findings
from hydroid.log.finding import Finding
from hydroid.log.log import Floats, Log
from hydroid.log.repair import fill, unwrap
from hydroid.log.resample import is_on_grid, resample
from hydroid.log.signals import Recording, Signal, map_signals, missing_columns, read_recording
from hydroid.log.units import check_units
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
        path: the CSV file.
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
    try:
        file = open_csv(path)
    except LogError as error:
        return None, [Finding("error", error.what, error.where, error.hint)]
    wanted = map_signals(settings, ranges)
    findings = _mapping_faults(str(path), settings, wanted, len(ranges), outputs)
    if not angles_required:
        wanted = [c for c in wanted if c.kind not in ("angle", "pressure") or c.name in file.names]
    findings += missing_columns(file, wanted)
    signals = [signal for signal in wanted if signal.name in file.names]
    log = None
    if signals and signals[0].kind == "time":
        recording, notes = unwrap(read_recording(file, signals))
        if repair:
            recording, repairs = fill(recording, settings.repair_s)
            notes += repairs
        findings += [
            *notes,
            *check_recording(recording, settings, outputs, repaired=repair),
            *check_units(recording),
        ]
        if all(finding.level != "error" for finding in findings):
            log, more = _to_log(recording, settings, len(ranges))
            findings += more
    return log, sorted(findings, key=lambda finding: ("error", "warning", "note").index(finding.level))


def _mapping_faults(
    source: str, settings: LogSettings, wanted: Sequence[Signal], joints: int, outputs: Sequence[int]
) -> list[Finding]:
    strangers = [f"log.joints.{joint}" for joint in settings.joints if joint > joints]
    faults = [Finding("error", f"{name}: the arm has joints 1 to {joints}", source) for name in strangers]
    measured = {signal.joint for signal in wanted if signal.kind == "angle"}
    for joint in outputs:
        if joint not in measured:
            what = f"output joint {joint} has no angle column"
            faults.append(Finding("error", what, source, "map it in log.joints, or choose another output"))
    return faults


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
    columns = {
        signal.joint: signal.name for signal in reversed(recording.signals) if signal.kind == "command"
    }
    return log, findings + delay_findings(log, settings, columns.__getitem__)
