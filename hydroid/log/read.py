"""A log file -> `Log`: open, map, repair, check, resample."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from hydroid.arrays import record
from hydroid.errors import LogError
from hydroid.log.bags import open_bag
from hydroid.log.binary import BINARY, TableReader, first_bytes
from hydroid.log.checks import check_recording
from hydroid.log.conditions import only_present
from hydroid.log.csv import open_csv
from hydroid.log.lengths import as_angles
from hydroid.log.log import Log, LogFinding, by_level, log_finding
from hydroid.log.lost_signals import without_lost_signals
from hydroid.log.mapping import Ranges, map_signals, match_columns, measured_signals
from hydroid.log.motion_checks import check_motion
from hydroid.log.repair import between_gaps, resample, without_bad_rows
from hydroid.log.table import Recording, Signal, Table
from hydroid.log.work import with_work, without_work
from hydroid.progress import Progress, no_progress
from hydroid.settings.arm import Arm
from hydroid.settings.log import LogSettings

DEFAULT = LogSettings()
LONGEST_NAME = 1000
"""letters of a column's name"""
LEFT_OUT = frozenset(
    ("cut end", "gap", "lost", "repair", "row left out", "slower channel", "work")
)
"""kinds of findings about what of a file is left out, filled or split"""


@record
class Reading:
    """How a log is read, besides its settings.

    Attributes:
        outputs: joints (numbers, from 1) whose angles a fit compares, so that the file
            must hold them; None: commands count alone: a joint whose angle column the
            file lacks is unmeasured, which else is an error, and what the angles do is
            not judged.
        arm: whose cylinders have lengths that stand for angles; a positive command
            turns its joints `backward` to negative angles.
        repair: whether holes up to `repair_s` of the settings are filled.
    """

    outputs: Sequence[int] | None = ()
    arm: Arm | None = None
    repair: bool = False


PLAIN_READING = Reading()


def open_table(
    path: Path, settings: LogSettings = DEFAULT, progress: Progress = no_progress
) -> Table:
    """Open a log of any format, recognised by its first bytes, or else by its ending.

    The settings name the time column, and the period to which the channels of a bag are
    resampled.
    """
    try:
        is_ros_2_bag = (path / "metadata.yaml").is_file()
        # such a bag is a folder, which has no bytes
        data = b""
        if not is_ros_2_bag:
            data = _first_bytes(path)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise LogError(f"cannot be read ({reason})", path) from None
    if is_ros_2_bag:
        return _of_short_names(open_bag(path, settings, progress))
    reader = _binary_reader(data, path.suffix.lower())
    if reader is None:
        return _of_short_names(open_csv(path, progress))
    return _of_short_names(reader(path, settings, progress))


def _binary_reader(data: bytes, ending: str) -> TableReader | None:
    """Return what reads a file by its first bytes, or where no format begins so by its
    ending; None: it is text."""
    for reader, starts in BINARY.values():
        if data.startswith(starts):
            return reader
    reader, _ = BINARY.get(ending, (None, ()))
    return reader


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
        what = "is no file, but a pipe or a device"
        raise LogError(what, path, "write the log to a file first")
    return first_bytes(path)


def check_log(
    path: Path,
    settings: LogSettings,
    ranges: Ranges,
    reading: Reading = PLAIN_READING,
) -> tuple[Log | None, list[LogFinding]]:
    """Return the longest part of a log between its gaps, None if it cannot be used, and
    all findings, as `check_parts` does."""
    parts, findings = check_parts(path, settings, ranges, reading)
    return max(parts, key=lambda part: part.duration, default=None), findings


def check_parts(
    path: Path,
    settings: LogSettings,
    ranges: Ranges,
    reading: Reading = PLAIN_READING,
    progress: Progress = no_progress,
) -> tuple[list[Log], list[LogFinding]]:
    """Find everything that is wrong with a log: return its parts between gaps, and all
    findings.

    There are no parts if any finding is an error, and one if there is no long gap.

    Args:
        ranges: (-inf, inf) for a continuous joint. Findings call joints by these names.
        progress: how much of the file is read [MB].
    """
    parts = list[Log]()
    findings = list[LogFinding]()
    try:
        recording = _read(path, settings, ranges, reading, progress, findings)
        signals = recording.signals
        if all(finding.level != "error" for finding in findings):
            parts = _parts(
                recording, settings, len(ranges), findings, repair=reading.repair
            )
        del recording  # a long one is large
        findings += _of_motion(parts, signals, settings, reading)
    except LogError as error:
        numbers = {"what": error.what, "hint": error.hint}
        findings.append(
            LogFinding("unreadable", "error", (), numbers, error.where, str(path))
        )
        parts = []
    return parts, by_level(findings)


def _of_motion(
    parts: Sequence[Log],
    signals: Sequence[Signal],
    settings: LogSettings,
    reading: Reading,
) -> Iterator[LogFinding]:
    """Yield what the motion in the parts of a log says against the settings; nothing
    where commands count alone."""
    if reading.outputs is None:
        return
    backward = reading.arm.backward if reading.arm else ()
    for part in parts:
        yield from check_motion(
            part, signals, reading.outputs, backward, settings.delay_s
        )


def _read(
    path: Path,
    settings: LogSettings,
    ranges: Ranges,
    reading: Reading,
    progress: Progress,
    findings: list[LogFinding],
) -> Recording:
    """Return the rows that can be used, with angles in place of lengths, and add what
    is wrong with them."""
    signals = map_signals(settings, ranges, reading.arm)
    compared = reading.outputs or ()
    needed = {*compared, *settings.joints}
    _refuse_wrong_joints(path, settings, ranges, compared)
    table = open_table(path, settings, progress)
    if reading.outputs is None:
        signals = measured_signals(table, signals)
        signals = only_present(table, signals, findings)
    signals = match_columns(table, signals, needed, findings)
    signals = with_work(table, signals, settings.work, findings)
    recording = table.read(signals)
    del table  # with the columns that are not used
    for remark in recording.table.remarks:
        findings.append(log_finding("note", "layout", str(path), what=remark))
    recording = without_work(recording, settings.work, findings)
    recording = as_angles(without_lost_signals(recording), findings)
    recording = without_bad_rows(recording, settings, findings, repair=reading.repair)
    findings += check_recording(recording, settings)
    return recording


def _refuse_wrong_joints(
    path: Path, settings: LogSettings, ranges: Ranges, compared: Sequence[int]
) -> None:
    """Refuse joints that the arm lacks, and compared ones without an angle."""
    last = max({*compared, *settings.joints}, default=0)
    if last > len(ranges):
        what = f"no joint {last}; the arm has joints 1 to {len(ranges)}"
        raise LogError(what, str(path), "correct outputs or log.joints")
    for joint in compared:
        if settings.columns("angle", joint) is None:
            what = f"output joint {[*ranges][joint - 1]} has no angle column"
            raise LogError(what, str(path), "map it in log.joints, or take another")


def _parts(
    recording: Recording,
    settings: LogSettings,
    joints: int,
    findings: list[LogFinding],
    *,
    repair: bool,
) -> list[Log]:
    """Return the parts of a recording between its gaps as logs."""
    pieces = [*between_gaps(recording, settings, findings, repair=repair)]
    left_out = tuple(_statement(one) for one in findings if one.kind in LEFT_OUT)
    parts = list[Log]()
    for number, piece in enumerate(pieces, 1):
        log = resample(piece, settings, joints)
        begin = float(piece.time[0] - recording.time[0])
        # after a gap the arm may be moving
        rest = 0 if begin else None
        source = log.source if len(pieces) == 1 else f"{log.source}[{number}]"
        rows = log.rows and replace(log.rows, left_out=left_out)
        place = {"source": source, "begin": begin, "rest": rest}
        part = replace(log, **place, clock=recording.clock, rows=rows)
        if begin or settings.begins_in_motion:
            part = part.in_motion()
        parts.append(part)
    return parts


def _statement(finding: LogFinding) -> str:
    """Return what a finding states and where in its file, without the file's name."""
    where = finding.where.removeprefix(finding.source).removeprefix(", ")
    return ": ".join(filter(None, (where, finding.what)))
