"""A log file -> `Log`: open, map, repair, check, resample."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hydroid.errors import LogError
from hydroid.log.arrays import open_mat, open_parquet
from hydroid.log.bag import open_bag
from hydroid.log.checks import check_recording
from hydroid.log.columns import map_signals, match_signals
from hydroid.log.csv import open_csv
from hydroid.log.finding import LogFinding, log_finding
from hydroid.log.log import Floats, Log
from hydroid.log.repair import fill, resample, sample_period, unwrap
from hydroid.log.survey import contradictions
from hydroid.log.table import Recording, Table
from hydroid.settings.log import LogSettings

DEFAULT = LogSettings()


def open_table(path: Path, settings: LogSettings = DEFAULT) -> Table:
    """Open a log of any format, recognised by its first bytes: CSV, .mat, Parquet, a ROS bag or MCAP.

    Args:
        path: the file, or the folder of a ROS 2 bag.
        settings: name of the time column, and period to which the channels of a bag are resampled.

    Raises:
        LogError: it cannot be read, or needs a package that is not installed.
    """
    try:
        folder = (path / "metadata.yaml").is_file()
        data = b"#ROSBAG V" if folder else path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise LogError(f"cannot be read ({reason})", where=str(path)) from None
    if data.startswith((b"#ROSBAG V", b"\x89MCAP0", b"SQLite format 3")):
        return open_bag(path, settings.time.column, settings.period_s)
    if data.startswith(b"PAR1"):
        return open_parquet(path)
    hdf5 = b"\x89HDF\r\n\x1a\n" in (data[:8], data[512:520])
    if hdf5 or data.startswith(b"MATLAB 5.0 MAT-file") or path.suffix.lower() == ".mat":
        return open_mat(path, hdf5=hdf5)
    return open_csv(path, data)


def read_log(path: Path, settings: LogSettings, ranges: Floats, **how: Any) -> tuple[Log, list[LogFinding]]:
    """Read a log that is to be used; the arguments are those of `check_log`.

    Returns:
        The log at `settings.period_s`, and warnings and notes.

    Raises:
        LogError: the first fault that keeps the log from being used.
    """
    log, findings = check_log(path, settings, ranges, **how)
    if log is None:
        raise findings[0].error()
    return log, findings


def check_log(
    path: Path,
    settings: LogSettings,
    ranges: Floats,
    *,
    outputs: Sequence[int] | None = (),
    backward: Collection[int] = (),
    repair: bool = False,
) -> tuple[Log | None, list[LogFinding]]:
    """Find everything that is wrong with a log.

    Args:
        path: the file.
        settings: its columns, units and tolerances.
        ranges: of the joints [rad], shape (J, 2), (-inf, inf) for a continuous joint.
        outputs: joints (numbers, from 1) whose angles a fit compares; None: a joint whose angle column the
            file lacks is unmeasured, which else is an error.
        backward: joints (from 1) that a positive command turns to negative angles.
        repair: fill holes up to `settings.repair_s`.

    Returns:
        The log, None if any finding is an error; and all findings, errors first.
    """
    source, log, findings, compared = str(path), None, list[LogFinding](), outputs or ()
    try:
        signals = map_signals(settings, ranges)
        table = open_table(path, settings)
        measured = {signal.joint for signal in signals if signal.kind == "angle"}
        for joint in sorted({*compared, *settings.joints}):
            if joint > len(ranges):
                joints = str(len(ranges))
                findings.append(log_finding("error", "no such joint", source, [joint], joints=joints))
            elif joint in compared and joint not in measured:
                findings.append(log_finding("error", "no output angle", source, [joint]))
        if outputs is None:
            signals = [s for s in signals if s.kind in ("time", "command") or s.name in table.names]
        signals = match_signals(table, signals, {*compared, *settings.joints}, findings)
        if signals and signals[0].kind == "time":
            recording = unwrap(_in_si(table.read(signals)), findings)
            findings += [log_finding("note", "layout", source, what=remark) for remark in recording.remarks]
            if repair:
                recording = fill(recording, settings.repair_s, findings)
            findings += check_recording(recording, settings, repaired=repair)
            if all(finding.level != "error" for finding in findings):
                log = _to_log(recording, settings, len(ranges), findings)
                said = {finding.kind for finding in findings}
                findings += contradictions(log, settings, compared, said, backward)
    except LogError as error:
        fault = log_finding("error", "unreadable", source, what=error.what, hint=error.hint)
        findings.append(replace(fault, where=error.where))
    return log, sorted(findings, key=lambda finding: ("error", "warning", "note").index(finding.level))


def _in_si(recording: Recording) -> Recording:
    """Scale the cells to [s], [%], [rad] and [Pa]; a number that is too large counts as none."""
    signals = recording.signals
    gain = np.array([1.0 if signal.name in recording.clocks else signal.gain for signal in signals])
    with np.errstate(all="ignore"):
        values = recording.values * gain + np.array([signal.offset for signal in signals])
        values[~(np.abs(values) < 1e100)] = np.nan
    return replace(recording, values=values)


def _to_log(recording: Recording, settings: LogSettings, joints: int, findings: list[LogFinding]) -> Log:
    """Bring a recording without faults to its period, and add what is worth knowing about that."""
    rows, period, kinds = len(recording.time), settings.period_s, {s.kind for s in recording.signals}
    command, measured = np.zeros((rows, joints)), np.full((rows, joints, 3), np.nan)
    for signal, values in zip(recording.signals[1:], recording.values.T[1:], strict=True):
        if signal.kind == "command":
            command[:, signal.joint - 1] += -values if signal.part else values
        else:
            measured[:, signal.joint - 1, (signal.kind == "pressure") + signal.part] = values
    grid, command, measured = resample(
        recording.time, command.clip(-100, 100), measured.reshape(rows, -1), period, settings.delay_s
    )
    measured = measured.reshape(-1, joints, 3)
    pressure = measured[..., 1:] if "pressure" in kinds else None
    log = Log(recording.table.source, grid, command.clip(-100, 100), measured[..., 0], period, pressure)
    step = sample_period(recording.time)
    if abs(step - period) > 0.01 * period:
        findings.append(recording.finding("note", "resampled", step=step, period=period))
    if "command" in kinds and not log.driven.any():
        findings.append(recording.finding("warning", "undriven"))
    return log
