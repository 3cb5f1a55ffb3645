"""A table of unknown columns -> a `log` section that maps them, with a reason for each
guess.

The unit of a column, or else the words of its name, tell what it is; without either,
the bare name of a joint or of what a command moves is its angle's. Its joint is the one
whose name or number its own name holds. Where no column of a kind has a joint they are
given to the joints in order; beside columns that have one, a column without is left out
and named.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hydroid.arrays import Array
from hydroid.errors import LogError
from hydroid.files import Plain
from hydroid.log.clues import column_unit, kind_of
from hydroid.log.columns import Column, Entry, beside, rises, signal_columns
from hydroid.log.joint_columns import JointColumns, Joints, by_joint
from hydroid.log.rods import Rod
from hydroid.log.signals import CommandRange, likely_range, resting_range
from hydroid.log.table import Signal, Table
from hydroid.log.uncalibrated import over_the_joint, over_the_range
from hydroid.settings.log import LENGTHS
from hydroid.units import UNITS, likely_time_unit
from hydroid.words import listed

PERIODS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
"""[s], of which a guess takes the nearest"""
NO_RODS: Mapping[int, Rod] = {}
NO_RANGES: Mapping[int, tuple[float, float]] = {}
NO_ANGLES: Mapping[int, Plain] = {}
LARGEST_ANGLE = np.radians(400.0)
"""of an arm's joint [rad]; larger numbers are lengths or counts"""
LARGEST_RADIANS = 6.3
"""of a log's angles without a unit; larger numbers are degrees"""
SMALL_COMMAND = 5.0
"""of a log's commands, the smallest is below this [%], if one of 0 is none"""
NEVER_AT_REST = (
    "it is never 0, so where it rests is not known: correct scale and offset"
)
COUNTS = "counts"
"""in place of a unit of angles, where columns without one hold what a sensor gives"""
LARGEST_METRES = 50.0
"""of a position without a unit, for no telescope is longer; larger numbers are mm"""


class ColumnGuess(NamedTuple):
    """What the columns of a log seem to hold: the `log` section of a fit's settings,
    and the unused columns.

    A reason stands for each column that it uses, for what is uncertain, and for the
    others. `mirrored`: settings of the angles, by joint, whose sensors have no known
    scale, for sensors that count the other way.
    """

    log: Plain
    reasons: tuple[str, ...]
    unused: tuple[str, ...]
    mirrored: Mapping[int, Plain] = NO_ANGLES


def guess_columns(
    table: Table,
    joints: Sequence[str],
    *,
    links: Sequence[str] = (),
    slides: Sequence[int] = (),
    rods: Mapping[int, Rod] = NO_RODS,
    ranges: Mapping[int, tuple[float, float]] = NO_RANGES,
    further: Sequence[Table] = (),
) -> ColumnGuess:
    """Guess which columns are time, commands and angles, of which joints, in which
    units.

    Columns may have the names of the links that the joints move instead; positions of
    joints (from 1) that slide are in m. Lengths of the cylinders of joints, `rods`,
    stand for their angles. Counts of an encoder or a converter are taken for the
    `ranges` of the joints [rad], from the lowest to the highest of this table and of
    `further` ones.
    """
    arm = Joints(joints, links, slides, rods, ranges)
    columns = beside(signal_columns(table, (*joints, *links)), further)
    time = _time_column(table, columns)
    step = usual_step(time.values)
    unit = time.unit or likely_time_unit(step) or "s"
    step *= UNITS[unit].factor
    reasons = [f"{time.name}: time in {unit}, every {step:.3g} s"]
    if kind_of(time.name, column_unit(time.name, "")) != "time":
        reasons[0] += ", by its values: no column is called a time"
    commands = by_joint(_of_kind(columns, "command"), arm, reasons)
    angles = by_joint(_of_kind(columns, "angle"), arm, reasons)
    mirrored = dict[int, Plain]()
    entries = _joint_entries(table, commands, angles, arm, reasons, mirrored)
    for column in columns:
        if column.kind == "target":
            reasons.append(
                f"{column.name}: a target of a position, no valve's opening; a controller lies between"
            )
    used = {time.name}
    for joint_columns in (*commands.values(), *angles.values()):
        used.update(column.name for column in joint_columns.columns)
    unused = tuple(name for name in table.names if name and name not in used)
    if unused:
        reasons.append(f"not used: {listed(unused)}")
    log: Plain = {
        "time": {"column": time.name, "unit": unit},
        "command": None,
        "angle": None,
        "period_s": nearest_period(step),
        "joints": entries,
    }
    return ColumnGuess(log, tuple(reasons), unused, mirrored)


def usual_step(times: Array) -> float:
    """Return the median of the differences of times, (T,), that are numbers; 0 where
    there is none."""
    steps = np.diff(times)
    known = steps[np.isfinite(steps)]
    return float(np.median(known)) if known.size else 0.0


def nearest_period(step: float) -> float:
    """Return the usual period that is most like a log's [s]."""

    def ratio(period: float) -> float:
        # a step may be 0 where the clock is coarse
        smaller = max(min(period, step), 1e-9)
        return max(period, step) / smaller

    return min(PERIODS, key=ratio)


def _time_column(table: Table, columns: Sequence[Column]) -> Column:
    """Return the first column of times that rises, or else the first one.

    Raises LogError: there is none.
    """
    times = [column for column in columns if column.kind == "time"]
    if not times:
        hint = f"it has {listed([*filter(None, table.names)], 6)}"
        raise LogError("has no column that looks like a time", table.source, hint)
    return max(times, key=lambda column: rises(column.values))


def _of_kind(columns: Sequence[Column], kind: str) -> list[Column]:
    """Return the columns of a kind; lengths last, for a joint whose angle is there
    needs none."""
    alike = [column for column in columns if column.kind == kind]
    return sorted(alike, key=lambda column: column.is_length)


def _joint_entries(
    table: Table,
    commands: Mapping[int, JointColumns],
    angles: Mapping[int, JointColumns],
    arm: Joints,
    reasons: list[str],
    mirrored: dict[int, Plain],
) -> dict[int, Plain]:
    """Return the settings of the joints' columns, by joint, and add a reason for
    each, and those of mirrored angles."""
    units = _usual_angle_units(angles, arm)
    cells = dict[int, _Cells]()
    for joint, command in commands.items():
        cells[joint] = _cells(table, command.columns)
    usual = _usual_range([*cells.values()])
    entries = dict[int, Plain]()
    for joint in sorted({*angles, *commands}):
        name = arm.names[joint - 1]
        entry: Plain = {"command": None, "angle": None}
        if joint in commands:
            columns, reason = commands[joint]
            command = _command(columns, cells[joint], usual)
            entry["command"] = command.settings
            reasons.append(command.reason(name, reason))
        if joint in angles:
            (column,), reason = angles[joint]
            angle = _angle(column, joint, units[joint], arm)
            if angle.settings:
                entry["angle"] = angle.settings
            reasons.append(angle.reason(name, reason))
            if angle.mirrored:
                mirrored[joint] = angle.mirrored
        entries[joint] = entry
    return entries


def _usual_angle_units(
    angles: Mapping[int, JointColumns], arm: Joints
) -> dict[int, str]:
    """Return the units of angles whose columns state none, by joint."""
    largest = list[float]()
    for joint, ((column,), _) in angles.items():
        if joint not in arm.slides and not column.unit and not column.is_raw:
            largest.append(np.nanmax(np.abs(column.values)))
    # without any, degrees, in which most loggers write
    unit = "rad" if max(largest, default=np.inf) <= LARGEST_RADIANS else "deg"
    # a sensor's counts may be as small as angles, beside those of others
    sensors_count = any(
        column.is_of_a_sensor and _is_counts(column, joint, unit, arm)
        for joint, ((column,), _) in angles.items()
    )
    units = dict[int, str]()
    for joint, ((column,), _) in angles.items():
        is_count = sensors_count and column.is_of_a_sensor
        units[joint] = COUNTS if is_count else unit
    return units


def _angle(column: Column, joint: int, usual_unit: str, arm: Joints) -> Entry:
    """Return the settings of the column of a joint's angle, and what it is taken
    for.

    `usual_unit`: of columns that state none.
    """
    slides = joint in arm.slides
    rod = arm.rods.get(joint)
    limits = arm.ranges.get(joint)
    if slides and not column.is_raw:
        return _position(column)
    if rod is not None and not column.turns:
        length = _cylinder_length(column, rod, usual_unit)
        if length is not None:
            return length
    if column.is_raw or _are_counts(column, limits, usual_unit):
        return over_the_joint(column, limits, slides=slides)
    unit = usual_unit if usual_unit != COUNTS else "deg"
    if column.unit and not column.is_raw:
        unit = column.unit
    hint = "" if column.unit else "its unit is stated nowhere"
    return Entry(_scaled(column, unit), f"{column.name}: angle in {unit}", hint)


def _is_counts(column: Column, joint: int, angle_unit: str, arm: Joints) -> bool:
    """Return whether the column of a joint's angle holds counts, by its size, and no
    length of its cylinder."""
    if joint in arm.slides or column.is_raw:
        return False
    rod = arm.rods.get(joint)
    if rod and not column.turns and _cylinder_length(column, rod, angle_unit):
        return False
    return _are_counts(column, arm.ranges.get(joint), angle_unit)


def _are_counts(
    column: Column, limits: tuple[float, float] | None, angle_unit: str
) -> bool:
    """Return whether a column without a unit holds counts, by its size; a joint without
    limits may turn far."""
    if column.unit or _may_be_angles(column, angle_unit):
        return False
    return limits is not None or column.is_of_a_sensor


def _scaled(column: Column, unit: str) -> Plain:
    """Return the settings of a column whose cells, times its scale, are in a unit."""
    settings: Plain = {"column": column.name, "unit": unit}
    if column.scale != 1:
        settings["scale"] = column.scale
    return settings


def _position(column: Column) -> Entry:
    """Return the settings of the column of a joint that slides."""
    unit = column.unit
    if not unit:
        largest = float(np.nanmax(np.abs(column.values)))
        unit = "mm" if largest > LARGEST_METRES else "m"
    return Entry(_scaled(column, unit), f"{column.name}: position in {unit}")


def _may_be_angles(column: Column, unit: str) -> bool:
    """Return whether all cells, in a unit, are angles that a joint can have."""
    if unit == COUNTS:
        return False
    largest = np.nanmax(np.abs(column.values))
    return bool(largest * UNITS[unit].factor <= LARGEST_ANGLE)


def _may_be_length(column: Column, angle_unit: str) -> bool:
    """Return whether a column may hold lengths of a cylinder, by its unit, name and
    size."""
    if column.is_raw or (column.unit and column.unit not in LENGTHS):
        return False
    if column.is_length:
        return True
    # a potentiometer's counts are in some stroke, too
    return not (column.is_of_a_sensor or _may_be_angles(column, angle_unit))


def _cylinder_length(column: Column, rod: Rod, angle_unit: str) -> Entry | None:
    """Return the settings of a column that holds the length of a joint's cylinder;
    None: it does not.

    A column without a unit holds angles if its name does not say otherwise and they are
    in a joint's reach.
    """
    if column.is_raw and column.is_length:
        shortest, longest = rod.ends
        ends = 1e3 * shortest, 1e3 * longest
        return over_the_range(column, ends, "mm", "stroke of the cylinder")
    if not _may_be_length(column, angle_unit):
        return None
    reading = rod.reading(column.values, column.unit)
    if reading is None and not column.is_length:
        return None
    # lengths that its cylinder cannot have: who reads them says which
    in_doubt = column.unit or rod.nearest_unit(column.values), 0.0
    unit, offset = reading or in_doubt
    settings = _scaled(column, unit)
    # without an offset the sensor measures from pin to pin
    if not offset:
        return Entry(settings, f"{column.name}: length of the cylinder in {unit}")
    settings["offset"] = offset
    with_it_in = f"whose cylinder is {offset:.6g} {unit} long with it in,"
    meaning = f"{column.name}: travel of the rod in {unit}, {with_it_in}"
    return Entry(settings, meaning)


class _Cells(NamedTuple):
    """The cells of a command, or of its two directions, and what they are likely in."""

    values: Array
    likely: CommandRange | None

    @property
    def changes(self) -> bool:
        return bool(np.nanmax(self.values) > np.nanmin(self.values))


def _cells(table: Table, columns: Sequence[Column]) -> _Cells:
    # a bag holds 0 for a command before its first message; but the range that the
    # others tell may not even contain 0
    signals = [Signal(column.name, "command", rest=np.nan) for column in columns]
    values = table.read(signals).values.T
    negative = values[1] if len(values) > 1 else None
    return _Cells(values, likely_range(values[0], negative, columns[0].unit))


def _usual_range(commands: Sequence[_Cells]) -> CommandRange | None:
    """Return the range that more than half of a log's commands that change are in, if
    it has a positive middle."""
    ranges = dict[str, CommandRange]()
    names = list[str]()
    # one of a middle of 0 needs no offset, and is recognised anyway
    for cells in commands:
        if cells.likely and cells.likely.offset:
            names.append(cells.likely.name)
            ranges.setdefault(cells.likely.name, cells.likely)
    most = max(names, key=names.count, default="")
    if names.count(most) <= sum(cells.changes for cells in commands) / 2:
        return None
    return ranges[most]


def _command(
    columns: Sequence[Column], cells: _Cells, usual: CommandRange | None
) -> Entry:
    """Return the settings of the columns of a command, and what they are taken for.

    What rests beside the middle is no command: its own rest is 0 %.
    """
    names = [column.name for column in columns]
    likely = cells.likely
    settings: Plain = {"column": names}
    if len(names) == 1:
        settings = {"column": names[0]}
        at_rest = resting_range(cells.values[0], likely, usual)
        if at_rest is not None:
            rest, range_at_rest = at_rest
            command_range = range_at_rest.with_overshoot(cells.values)
            settings |= {"scale": command_range.scale, "offset": command_range.offset}
            meaning = f"command in {command_range.name}, at rest at {rest:.6g}"
            return Entry(settings, f"{names[0]}: {meaning}")
    both = " and ".join(names)
    if likely is None or "%" in (columns[0].unit, likely.name):
        in_percent = likely or CommandRange("%", 1.0, 0.0)
        hint = "" if _rests_at_zero(cells, in_percent) else NEVER_AT_REST
        return Entry(settings, f"{both}: command in %", hint)
    likely = likely.with_overshoot(cells.values)
    settings["scale"] = likely.scale
    if likely.offset:
        settings["offset"] = likely.offset
    hint = "" if _rests_at_zero(cells, likely) else NEVER_AT_REST
    return Entry(settings, f"{both}: command in {likely.name}", hint)


def _rests_at_zero(cells: _Cells, likely: CommandRange) -> bool:
    """Return whether a command is ever none, of a range that has 0 in its middle."""
    if likely.offset or len(cells.values) > 1 or not cells.changes:
        return True
    smallest = float(np.nanmin(np.abs(cells.values)))
    return likely.scale * smallest <= SMALL_COMMAND
