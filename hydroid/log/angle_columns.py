"""What the column of a joint's angle holds: an angle, a position, the length of a
cylinder, or counts of a sensor, and in which unit."""

from collections.abc import Mapping

import numpy as np

from hydroid.arrays import Limits
from hydroid.files import Plain
from hydroid.log.columns import Column, Entry
from hydroid.log.joint_columns import Assignment, Joints
from hydroid.log.likely_units import LARGEST_ANGLE, LARGEST_METRES
from hydroid.log.mapping import angle_margin
from hydroid.log.rods import Rod
from hydroid.log.uncalibrated import over_the_joint, over_the_range
from hydroid.settings.log import LENGTHS
from hydroid.units import UNITS

LARGEST_RADIANS = 6.3
"""of a log's angles without a unit; larger numbers are degrees"""
TURN = 360.0
"""an angle by whole turns of these is the same place [deg]"""
COUNTS = "counts"
"""in place of a unit of angles, where columns without one hold what a sensor gives"""


def angle_entries(angles: Mapping[int, Assignment], arm: Joints) -> dict[int, Entry]:
    """Return the settings of the columns of angles, and what they are taken for, by
    joint."""
    units = _usual_units(angles, arm)
    entries = dict[int, Entry]()
    for joint, ((column,), _) in angles.items():
        entries[joint] = _angle(column, joint, units[joint], arm)
    return entries


def _usual_units(angles: Mapping[int, Assignment], arm: Joints) -> dict[int, str]:
    """Return by joint in which unit its angle is if the column states none: COUNTS, or
    the same for all."""
    largest = list[float]()
    for joint, ((column,), _) in angles.items():
        if joint not in arm.slides and not column.unit and not column.is_raw:
            largest.append(np.nanmax(np.abs(column.values)))
    # degrees are what most loggers write
    unit = "deg"
    if max(largest, default=np.inf) <= LARGEST_RADIANS:
        unit = "rad"
    # a sensor's counts may be as small as angles, beside those of others
    sensors_count = any(
        column.is_of_a_sensor and _can_only_be_counts(column, joint, unit, arm)
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
    if rod is not None and not column.turns:
        length = _cylinder_length(column, rod, usual_unit)
        if length is not None:
            return length
    if column.is_raw or _looks_like_counts(column, joint, usual_unit, arm):
        return over_the_joint(column, arm.ranges.get(joint), slides=slides)
    if slides:
        return _position(column)
    unit = column.unit
    hints = list[str]()
    if not unit:
        unit = usual_unit if usual_unit != COUNTS else "deg"
        hints.append("its unit is stated nowhere")
    settings: Plain = {"column": column.name, "unit": unit}
    turns = _whole_turns(column, unit, arm.ranges.get(joint))
    if turns:
        settings["offset"] = _in_unit(turns * np.radians(TURN), unit)
        hints.append(f"offset {settings['offset']:g} is a whole turn: the same place")
    return Entry(settings, f"{column.name}: angle in {unit}", "; ".join(hints))


def _in_unit(angle: float, unit: str) -> float:
    """Return an angle [rad] in a unit, of few digits."""
    return float(f"{angle / UNITS[unit].factor:.9g}")


def _whole_turns(column: Column, unit: str, limits: Limits | None) -> int:
    """Return by how many turns an angle is moved into the range of its joint [rad].

    A sensor that counts from 0 to 360 deg is beyond the range of a joint with negative
    angles. What fits in no way is moved if it is beyond half a turn, where a joint's
    angles are rarely said to be.
    """
    if limits is None:
        return 0
    # of the first log alone: another one may pass 0
    angles = column.values * UNITS[unit].factor
    ends = float(np.nanmin(angles)), float(np.nanmax(angles))
    turn = np.radians(TURN)
    turns = int(np.rint((sum(limits) - sum(ends)) / 2 / turn))
    moved = ends[0] + turns * turn, ends[1] + turns * turn
    if _is_within(ends, limits):
        return 0
    is_beyond = min(map(abs, ends)) > turn / 2
    return turns if is_beyond or _is_within(moved, limits) else 0


def _is_within(ends: Limits, limits: Limits) -> bool:
    """Return whether angles are in a range, but for its margin [rad]."""
    margin = angle_margin(*limits)
    return limits[0] - margin <= ends[0] and ends[1] <= limits[1] + margin


def _can_only_be_counts(
    column: Column, joint: int, angle_unit: str, arm: Joints
) -> bool:
    """Return whether the column of a joint holds counts, by its size, and no length of
    its cylinder."""
    if column.is_raw:
        return False
    rod = arm.rods.get(joint)
    if rod and not column.turns and _cylinder_length(column, rod, angle_unit):
        return False
    return _looks_like_counts(column, joint, angle_unit, arm)


def _looks_like_counts(
    column: Column, joint: int, angle_unit: str, arm: Joints
) -> bool:
    """Return whether a column without a unit holds counts, by its size; a joint without
    limits may turn far."""
    limits = arm.ranges.get(joint)
    if column.unit:
        return False
    if joint in arm.slides:
        if limits is None or not column.is_of_a_sensor:
            return False
        return not _may_be_position(column, limits, angle_unit)
    if _may_be_angles(column, angle_unit):
        return False
    return limits is not None or column.is_of_a_sensor


def _position(column: Column) -> Entry:
    """Return the settings of the column of a joint that slides."""
    unit = column.unit or _usual_length(column)
    settings: Plain = {"column": column.name, "unit": unit}
    return Entry(settings, f"{column.name}: position in {unit}")


def _usual_length(column: Column) -> str:
    """Return the unit of positions that state none, by their size: mm where no
    telescope is as many m long."""
    largest = float(np.nanmax(np.abs(column.values)))
    return "mm" if largest > LARGEST_METRES else "m"


def _may_be_position(column: Column, limits: Limits, angle_unit: str) -> bool:
    """Return whether a sensor's column without a unit may hold positions of a joint
    that slides, by its range, or by its name where no other sensor counts."""
    unit = _usual_length(column)
    # no sensor gives as few counts
    if unit == "m":
        return True
    least, most = limits
    margin = angle_margin(least, most)
    low, high = (UNITS[unit].factor * end for end in column.ends)
    in_range = least - margin <= low and high <= most + margin
    if angle_unit == COUNTS:
        return in_range and column.is_length
    return in_range or column.is_length


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
        ends = (1e3 * shortest, 1e3 * longest)
        return over_the_range(column, ends, "mm", "stroke of the cylinder")
    if not _may_be_length(column, angle_unit):
        return None
    reading = rod.reading(column.values, column.unit)
    if reading is None and not column.is_length:
        return None
    if reading is None:
        # lengths that its cylinder cannot have: who reads them says which
        reading = (column.unit or rod.nearest_unit(column.values), 0.0)
    unit, offset = reading
    settings: Plain = {"column": column.name, "unit": unit}
    # without an offset the sensor measures from pin to pin
    if not offset:
        return Entry(settings, f"{column.name}: length of the cylinder in {unit}")
    settings["offset"] = offset
    retracted = f"whose cylinder is {offset:.6g} {unit} long with it in,"
    meaning = f"{column.name}: travel of the rod in {unit}, {retracted}"
    return Entry(settings, meaning)
