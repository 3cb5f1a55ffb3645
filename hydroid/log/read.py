"""A log file -> `Log`: open, map, repair, check, resample; and back to CSV, which reads
the same."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any, get_args

import numpy as np

from hydroid.errors import LogError
from hydroid.files import csv_text, write_atomic
from hydroid.log.binary import BINARY, first_bytes
from hydroid.log.checks import check_motion, check_recording
from hydroid.log.csv import open_csv
from hydroid.log.log import Log, LogFinding, by_level, log_finding
from hydroid.log.repair import between_gaps, hold, resample, without_bad_rows
from hydroid.log.rods import as_angles, rods_of
from hydroid.log.table import Recording, Signal, Table
from hydroid.progress import Progress, no_progress
from hydroid.settings.arm import Arm
from hydroid.settings.log import Kind, LogSettings
from hydroid.units import UNITS
from hydroid.words import listed

DEFAULT = LogSettings()
SHOWN = {"command": "%", "angle": "deg", "length": "mm", "pressure": "bar"}
"""units in which messages state what is measured"""
LENGTHS = ("m", "cm", "mm")
"""units of positions, and of the lengths of cylinders"""
LONGEST_NAME = 1000
"""letters of a column's name"""


Ranges = Mapping[str, tuple[float, float]]
"""of all joints [rad, m], by their names"""


def open_table(
    path: Path, settings: LogSettings = DEFAULT, progress: Progress = no_progress
) -> Table:
    """Open a log of any format, recognised by its first bytes.

    The settings name the time column, and the period to which the channels of a bag are
    resampled.
    """
    try:
        # a ROS 2 bag is a folder
        data = (
            b"#ROSBAG V" if (path / "metadata.yaml").is_file() else _first_bytes(path)
        )
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise LogError(f"cannot be read ({reason})", path) from None
    for name, (reader, starts) in BINARY.items():
        if data.startswith(starts) or path.suffix.lower() == name:
            return _of_short_names(reader(path, settings, progress))
    return _of_short_names(open_csv(path, progress))


def _of_short_names(table: Table) -> Table:
    """Refuse a table with a name that nobody reads, and that takes long to be searched
    for units and numbers."""
    for k, name in enumerate(table.names, 1):
        if len(name) > LONGEST_NAME:
            what = f"the name of column {k} has {len(name):,} letters"
            hint = f"at most {LONGEST_NAME:,} are read"
            raise LogError(what, table.source, hint)
    return table


def _first_bytes(path: Path) -> bytes:
    """Return the first bytes of a regular file: to open a pipe would wait for its
    writer."""
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise LogError(
            "is no file, but a pipe or a device", path, "write the log to a file first"
        )
    return first_bytes(path)


def check_log(
    path: Path, settings: LogSettings, ranges: Ranges, **how: Any
) -> tuple[Log | None, list[LogFinding]]:
    """Return the longest part of a log between its gaps, None if it cannot be used, and
    all findings.

    The arguments are those of `check_parts`.
    """
    parts, findings = check_parts(path, settings, ranges, **how)
    return max(parts, key=lambda part: part.duration, default=None), findings


def check_parts(
    path: Path,
    settings: LogSettings,
    ranges: Ranges,
    *,
    outputs: Sequence[int] | None = (),
    arm: Arm | None = None,
    repair: bool = False,
    progress: Progress = no_progress,
) -> tuple[list[Log], list[LogFinding]]:
    """Find everything that is wrong with a log: return its parts between gaps, and all
    findings.

    There are no parts if any finding is an error, and one if there is no long gap.

    Args:
        ranges: (-inf, inf) for a continuous joint. Findings call joints by these names.
        outputs: joints (numbers, from 1) whose angles a fit compares; None: a joint
            whose angle column the file lacks is unmeasured, which else is an error.
        arm: whose cylinders have lengths that stand for angles; a positive command
            turns its joints `backward` to negative angles.
        repair: fill holes up to `settings.repair_s`.
        progress: how much of the file is read [MB].
    """
    source, parts, findings, compared = (
        str(path),
        list[Log](),
        list[LogFinding](),
        outputs or (),
    )
    try:
        needed, signals = (
            {*compared, *settings.joints},
            map_signals(settings, ranges, arm),
        )
        if (last := max(needed, default=0)) > len(ranges):
            what = f"no joint {last}; the arm has joints 1 to {len(ranges)}"
            raise LogError(what, source, "correct outputs or log.joints")
        if unmapped := [
            joint for joint in compared if settings.columns("angle", joint) is None
        ]:
            what = f"output joint {[*ranges][unmapped[0] - 1]} has no angle column"
            raise LogError(what, source, "map it in log.joints, or take another")
        table = open_table(path, settings, progress)
        if outputs is None:
            signals = [
                s
                for s in signals
                if s.kind in ("time", "command") or s.name in table.names
            ]
        signals = _match(table, signals, needed, findings)
        recording = table.read(signals)
        del table  # with the columns that are not used
        findings += [
            log_finding("note", "layout", source, what=one)
            for one in recording.table.remarks
        ]
        recording = as_angles(recording, findings)
        recording = without_bad_rows(recording, settings, findings, repair=repair)
        findings += check_recording(recording, settings)
        if all(finding.level != "error" for finding in findings):
            parts = _parts(recording, settings, len(ranges), findings, repair=repair)
            del recording
            backward = arm.backward if arm else ()
            for part in parts:
                findings += check_motion(
                    part, signals, compared, backward, settings.delay_s
                )
    except LogError as error:
        numbers = {"what": error.what, "hint": error.hint}
        findings.append(
            LogFinding("unreadable", "error", (), numbers, error.where, source)
        )
        parts = []
    return parts, by_level(findings)


def _parts(
    recording: Recording,
    settings: LogSettings,
    joints: int,
    findings: list[LogFinding],
    *,
    repair: bool,
) -> list[Log]:
    """Return the parts of a recording between its gaps as logs."""
    parts = list[Log]()
    for piece in between_gaps(recording, settings, findings, repair=repair):
        begin = float(piece.time[0] - recording.time[0])
        rest = 0 if begin else None  # after a gap the arm may be moving
        log = resample(piece, settings, joints)
        parts.append(replace(log, begin=begin, rest=rest, clock=recording.clock))
    if len(parts) == 1:
        return parts
    return [replace(one, source=f"{one.source}[{k}]") for k, one in enumerate(parts, 1)]


def map_signals(
    settings: LogSettings, ranges: Ranges, arm: Arm | None = None
) -> list[Signal]:
    """Return the signals that the settings ask for, time first.

    Raises LogError: lengths stand for the angles of a joint of the arm that no known
    cylinder turns.
    """
    rods = rods_of(arm) if arm and _has_lengths(settings) else {}
    signals = [
        Signal(settings.time.column, "time", gain=UNITS[settings.time.unit].factor)
    ]
    for kind in get_args(Kind):
        for joint, (owner, (low, high)) in enumerate(ranges.items(), 1):
            if columns := settings.columns(kind, joint):
                margin = angle_margin(low, high)
                limits = {
                    "command": (-100.0 if len(columns.column) == 1 else 0.0, 100.0),
                    "angle": (low - margin, high + margin),
                    "pressure": (-5e5, 2e8),  # sensors have an offset, hoses burst
                }[kind]
                unit = UNITS[columns.unit.lower()]
                scale = columns.scale * unit.factor, columns.offset * unit.factor
                shown, rod = SHOWN[unit.quantity], None
                if unit.quantity == "length" and arm and joint not in arm.slides:
                    shown, rod = "deg", rods.get(joint)
                    if rod is None:
                        what = f"{listed(columns.column)} is a length, but no cylinder of {owner} is known"
                        raise LogError(
                            what,
                            arm.where,
                            f"give {owner} a cylinder with its pivots there",
                        )
                for part, name in enumerate(columns.column):
                    signals.append(
                        Signal(
                            name,
                            kind,
                            joint,
                            part,
                            *scale,
                            *limits,
                            shown,
                            owner,
                            rod=rod,
                        )
                    )
    return signals


def _has_lengths(settings: LogSettings) -> bool:
    every = (settings.angle, *(own and own.angle for own in settings.joints.values()))
    return any(columns and columns.unit in LENGTHS for columns in every)


def angle_margin(low: float, high: float) -> float:
    """Return how far angles may lie outside a range [rad]: sensors are noisy at stops,
    and ranges rough."""
    return max(np.deg2rad(1.0), 0.02 * (high - low))


def _match(
    table: Table,
    wanted: Sequence[Signal],
    needed: Collection[int],
    findings: list[LogFinding],
) -> list[Signal]:
    """Return the signals whose columns a file has.

    Joints that are not `needed` may be absent from a file that has columns of others. A
    column of a similar name speaks against it: it is rather misspelt.
    """
    free = {
        name.lower(): name
        for name in sorted({*table.names} - {signal.name for signal in wanted})
    }
    missing = [signal for signal in wanted if signal.name not in table.names]
    close = {
        s.name: free[n]
        for s in missing
        for n in get_close_matches(s.name.lower(), free, 1, 0.75)
    }
    there = {
        signal.joint
        for signal in wanted
        if signal not in missing or signal.name in close
    } - {0}
    absent = (
        {signal.joint for signal in wanted} - there - {0, *needed}
        if there
        else set[int]()
    )
    if absent:
        names = dict(
            sorted(
                (signal.joint, signal.owner)
                for signal in wanted
                if signal.joint in absent
            )
        )
        findings.append(
            log_finding("note", "absent joints", table.source, *names.values())
        )
    wanted = [signal for signal in wanted if signal.joint not in absent]
    for signal in wanted:
        count = table.names.count(signal.name)
        shared = [str(other) for other in wanted if other.name == signal.name]
        if count == len(shared) == 1:
            continue
        what, hint = (
            f"column {signal.name!r} cannot be {listed(shared)}",
            "correct log.joints in the config",
        )
        if count > 1:
            what, hint = f"has {count} columns {signal.name!r}", "rename all but one"
        elif count == 0:
            lacking = sorted(
                (one for one in wanted if one in missing),
                key=lambda one: one.name not in close,
            )
            guess = {
                name: f", did you mean {other!r}?" for name, other in close.items()
            }
            what = listed(
                [f"{one.name!r} ({one}{guess.get(one.name, '')})" for one in lacking], 2
            )
            what = f"lacks {what}; unused: {listed([*filter(None, free.values())] or ['none'], 3)}"
            places = listed([*dict.fromkeys(f"log.{one.kind}" for one in lacking)])
            hint = f"in the config, set {places} to the right column, or to null if the log has none"
        line = f", line {table.header}" if table.header else ""
        raise LogError(what, f"{table.source}{line}", hint)
    return wanted


def write_log(
    path: Path,
    log: Log,
    settings: LogSettings,
    *,
    exact: bool = False,
    arm: Arm | None = None,
) -> None:
    """Write a log, whole or not at all. The `arm` has the cylinders whose lengths stand
    for angles.

    Cells have ten digits, or with `exact` as many as it takes to read the same bits
    back; where no cell does (degrees for a value that was in radians) the last bit may
    differ. The command is written ahead by `settings.delay_s`, so that reading delays
    it to what `log` holds.

    Raises LogError: the settings map no column for a joint that is driven, or one for
    an angle that was not measured.
    """
    write_logs(path, [(log, settings)], exact=exact, arm=arm)


def write_logs(
    path: Path,
    logs: Sequence[tuple[Log, LogSettings]],
    *,
    exact: bool = False,
    arm: Arm | None = None,
) -> None:
    """Write logs of the same time side by side into one file, each with its settings,
    as `write_log` does."""
    columns: dict[str, list[str]] = {}
    for log, settings in logs:
        free = dict.fromkeys(map(str, range(1, 1 + log.joints)), (np.inf, np.inf))
        signals = map_signals(settings, free, arm)
        mapped = {(signal.kind, signal.joint) for signal in signals}
        for joint, (driven, measured) in enumerate(
            zip(log.driven, log.measured, strict=True), 1
        ):
            if driven and ("command", joint) not in mapped:
                what = f"joint {joint} is driven but no column holds its command"
                raise LogError(
                    what, path, f"map a column in log.joints.{joint}.command"
                )
            if not measured and ("angle", joint) in mapped:
                hint = f"set log.joints.{joint}.angle: null"
                raise LogError(f"joint {joint} has no angle to write", path, hint)
        command = hold(log.time, log.command, log.time + settings.delay_s, log.period)
        for signal in signals:
            values, joint = log.time, signal.joint - 1
            if signal.kind == "command":
                values = (-command if signal.part else command)[:, joint].clip(
                    min=signal.low
                )
            elif signal.kind == "angle":
                angle = log.angle[:, joint]
                values = (
                    angle if signal.rod is None else signal.rod.cylinder.length(angle)
                )
            elif signal.kind == "pressure":
                if log.pressure is None:
                    continue
                values = log.pressure[:, joint, signal.part]
            # ten digits, or the shortest of more that are read as these values
            wanted = (values - signal.offset) / signal.gain
            cells = np.array([f"{cell:.10g}" for cell in wanted], dtype=object)
            for digits in (15, 16, 17) if exact else ():
                wrong = np.flatnonzero(
                    cells.astype(float) * signal.gain + signal.offset != values
                )
                cells[wrong] = [f"{cell:.{digits}g}" for cell in wanted[wrong]]
            columns[signal.name] = cells.tolist()
    write_atomic(path, csv_text([columns, *zip(*columns.values(), strict=True)]))
