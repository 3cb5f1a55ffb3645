"""Sensors that count the other way than the arm's angles, found by a log.

The arm's range tells it of a sensor with a known scale, and of others the commands:
what is taken for the whole range of a joint fits in either way.
"""

from collections.abc import Sequence

from hydroid.arrays import Array
from hydroid.files import Plain
from hydroid.log import ColumnGuess, Log, motion_of
from hydroid.log.mapping import angle_margin
from hydroid.settings.arm import Arm, Joint
from hydroid.settings.log import LENGTHS


def mirror_sensors(
    logs: Sequence[Log], guess: ColumnGuess, arm: Arm, *, in_range: bool
) -> tuple[str, ...]:
    """Replace the settings of angles whose sensors count backwards by the first of the
    logs, and return a sentence about each.

    `in_range`: the arm's ranges are no guesses.
    """
    said = list[str]()
    if not logs:
        return ()
    log = logs[0]
    for number, entry in guess.log["joints"].items():
        joint = arm.joints[number - 1]
        angle = entry["angle"]
        if angle is None:
            continue
        column = angle["column"]
        if number in guess.mirrored:
            motion = motion_of(log, number)
            if motion.contradicts(backward=number in arm.backward):
                entry["angle"] = guess.mirrored[number]
                said.append(
                    f"{column} counts backwards, or {joint.name} would move against its command. "
                    "If the command is wired the other way instead (compare arm.png), turn its "
                    f"sign, and set scale: {angle['scale']:g} and offset: {angle['offset']:g} at "
                    "the angle"
                )
        elif in_range and _range_says_so(log.angle_of(number), angle, joint):
            entry["angle"] = of_other_sign(angle)
            said.append(
                f"{column} counts backwards: only so is it in the range of {joint.name}"
            )
    return tuple(said)


def of_other_sign(columns: Plain) -> Plain:
    """Return the settings of columns whose numbers have the other sign."""
    changes = {"scale": -columns.get("scale", 1.0)}
    if columns.get("offset"):
        changes["offset"] = -columns["offset"]
    return columns | changes


def _range_says_so(angle: Array, columns: Plain, joint: Joint) -> bool:
    """Return whether angles [rad, m], (T,), are in a joint's range with the other sign
    only."""
    is_length_of_cylinder = columns["unit"] in LENGTHS and not joint.slides
    if joint.continuous or is_length_of_cylinder:
        return False
    least, most = joint.limits
    margin = angle_margin(least, most)
    low = angle.min()
    high = angle.max()
    is_inside = low >= least - margin and high <= most + margin
    mirror_is_inside = -high >= least - margin and -low <= most + margin
    return bool(mirror_is_inside and not is_inside)
