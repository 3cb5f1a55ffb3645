"""A log file -> `Log`: open, map, repair, check, resample."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hydroid.errors import LogError
from hydroid.log.bag import open_bag
from hydroid.log.checks import check_recording
from hydroid.log.columns import (
    Recording,
    Signal,
    absent_joints,
    column_faults,
    map_signals,
    read_recording,
)
from hydroid.log.csv import open_csv, read_start
from hydroid.log.finding import LogFinding, Place, unreadable
from hydroid.log.log import Floats, Log
from hydroid.log.mat import open_mat
from hydroid.log.parquet import open_parquet
from hydroid.log.repair import fill, is_on_grid, resample, sample_period, unwrap
from hydroid.log.survey import Contradictions
from hydroid.log.table import Table
from hydroid.settings.log import LogSettings

DEFAULT = LogSettings()
HDF5 = b"\x89HDF\r\n\x1a\n"


def open_table(path: Path, settings: LogSettings = DEFAULT, wanted: Sequence[str] = ()) -> Table:
    """Open a log of any format, recognised by its first bytes: CSV, .mat, Parquet, a ROS bag or MCAP.

    Args:
        path: the file, or the folder of a ROS 2 bag.
        settings: name of the time column, and period to which the channels of a bag are resampled.
        wanted: names of columns that the settings ask for; they tell the header of a CSV file.

    Raises:
        LogError: it cannot be read, or needs a package that is not installed.
    """
    folder = "\0" not in str(path) and (path / "metadata.yaml").exists()
    start = b"" if folder else read_start(path, 600)
    if folder or start.startswith((b"#ROSBAG V", b"\x89MCAP0", b"SQLite format 3")):
        return open_bag(path, settings.time.column, settings.period_s)
    if start.startswith(b"PAR1"):
        return open_parquet(path)
    hdf5 = HDF5 in (start[:8], start[512:520])
    if hdf5 or start.startswith(b"MATLAB 5.0 MAT-file") or path.suffix.lower() == ".mat":
        return open_mat(path, hdf5=hdf5)
    return open_csv(path, wanted)


def read_log(
    path: Path,
    settings: LogSettings,
    ranges: Floats,
    *,
    outputs: Sequence[int] = (),
    angles_required: bool = True,
    repair: bool = False,
) -> tuple[Log, list[LogFinding]]:
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
) -> tuple[Log | None, list[LogFinding]]:
    """Find everything that is wrong with a log; the arguments are those of `read_log`.

    Returns:
        The log, None if any finding is an error; and all findings, errors first.
    """
    findings, log = list[LogFinding](), None
    try:
        signals = map_signals(settings, ranges)
        file = open_table(path, settings, [signal.name for signal in signals])
        findings += _mapping_faults(str(path), settings, signals, len(ranges), outputs)
        if not angles_required:
            signals = [s for s in signals if s.kind not in ("angle", "pressure") or s.name in file.names]
        if absent := absent_joints(file, signals, {*outputs, *settings.joints}):
            findings.append(Place(str(path)).finding("note", "absent joints", absent))
            signals = [signal for signal in signals if signal.joint not in absent]
        findings += column_faults(file, signals)
        signals = [signal for signal in signals if signal.name in file.names]
        if signals and signals[0].kind == "time":
            recording, notes = read_recording(file, signals)
            recording, joined = unwrap(recording)
            recording, repairs = fill(recording, settings.repair_s) if repair else (recording, [])
            findings += [*joined, *notes, *repairs, *check_recording(recording, settings)]
            if all(finding.level != "error" for finding in findings):
                log, more = _to_log(recording, settings, len(ranges))
                findings += more + Contradictions(log, settings, outputs).findings({f.kind for f in findings})
    except LogError as error:
        findings.append(unreadable(str(path), error))
    return log, sorted(findings, key=lambda finding: ("error", "warning", "note").index(finding.level))


def _mapping_faults(
    source: str, settings: LogSettings, signals: Sequence[Signal], joints: int, outputs: Sequence[int]
) -> list[LogFinding]:
    place, measured = Place(source), {signal.joint for signal in signals if signal.kind == "angle"}
    kinds = {j: "no such joint" for j in settings.joints if j > joints}
    kinds |= {j: "no output joint" if j > joints else "no output angle" for j in {*outputs} - measured}
    return [place.finding("error", kind, [joint], joints=str(joints)) for joint, kind in kinds.items()]


def _to_log(recording: Recording, settings: LogSettings, joints: int) -> tuple[Log, list[LogFinding]]:
    period, kinds = settings.period_s, {signal.kind for signal in recording.signals}
    command = np.nan_to_num(recording.of("command", joints))
    command = (0.0 + command[..., 0] - command[..., 1]).clip(-100, 100)
    measured = np.concatenate([recording.of("angle", joints), recording.of("pressure", joints)], axis=2)
    flat = measured.reshape(len(measured), -1)
    time, command, flat = resample(recording.time, command, flat, period, settings.delay_s)
    measured = flat.reshape(len(time), joints, 4)
    pressure = measured[..., 2:] if "pressure" in kinds else None
    log = Log(recording.file.source, time, command, measured[..., 0], period, pressure)
    findings = list[LogFinding]()
    if not is_on_grid(recording.time, period):
        step = sample_period(recording.time)
        kind = "evened" if abs(step / period - 1) < 1e-3 else "resampled"
        findings.append(recording.finding("note", kind, step=step, period=period))
    if "command" in kinds and not log.driven.any():
        findings.append(recording.finding("warning", "undriven"))
    return log, findings
