"""JSON of commands in the units of the joints: what is in deg of those that turn is in mm
of those that slide."""

from collections.abc import Collection, Mapping
from typing import Any

from hydroid.files import Plain
from hydroid.settings.arm import Arm
from hydroid.units import SLIDING

DEGREES = "_deg"
"""ending of keys, alone or before a power, of what stands in deg"""
SQUARED = "_deg2"


def in_joint_units(content: Mapping[str, Any], arm: Arm) -> Plain:
    """Return JSON content whose numbers about joints that slide are in mm, under keys
    that say so: `rms_mm` in place of `rms_deg`.

    Inside hydroid 1 m of such a joint counts as 1 rad. These are rows with `joint` and
    `name`, and numbers by the joints' names.
    """
    sliding = {joint.name for joint in arm.joints if joint.slides}
    return _mapping(content, sliding)


def _changed(value: Any, sliding: Collection[str], *, in_row: bool) -> Any:
    """Return a value with what it holds in other units; `in_row`: it belongs to a joint
    that slides."""
    if isinstance(value, Mapping):
        return _mapping(value, sliding, in_row=in_row)
    if isinstance(value, list | tuple):
        return [_changed(entry, sliding, in_row=in_row) for entry in value]
    return value


def _mapping(
    values: Mapping[str, Any], sliding: Collection[str], *, in_row: bool = False
) -> Plain:
    """Return a mapping with other units; `in_row`: it belongs to a joint that slides."""
    is_sliding = in_row or ("joint" in values and values.get("name") in sliding)
    changed: Plain = {}
    for key, value in values.items():
        if not key.endswith((DEGREES, SQUARED)):
            changed[key] = _changed(value, sliding, in_row=is_sliding)
        elif is_sliding:
            changed |= _in_mm(key, value)
        elif isinstance(value, Mapping):
            changed |= _by_joint(key, value, sliding)
        else:
            changed[key] = value
    return changed


def _by_joint(key: str, values: Mapping[str, Any], sliding: Collection[str]) -> Plain:
    """Return numbers by the joints' names under the key, those of joints that slide
    under that of mm."""
    turning: Plain = {}
    of_slides: Plain = {}
    for name, value in values.items():
        if name in sliding:
            of_slides[name] = value
        else:
            turning[name] = value
    changed: Plain = {key: turning}
    if of_slides:
        changed |= _in_mm(key, of_slides)
    return changed


def _in_mm(key: str, value: Any) -> Plain:
    """Return numbers that stand in deg under a key in mm, and the key of that."""
    factor = SLIDING.of_degrees(1.0)
    if key.endswith(SQUARED):
        factor **= 2
    head, _, power = key.rpartition(DEGREES)
    return {f"{head}_{SLIDING.unit}{power}": _times(factor, value)}


def _times(factor: float, value: Any) -> Any:
    """Return numbers, in whatever holds them, times a factor; None stays None."""
    if isinstance(value, Mapping):
        return {name: _times(factor, part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_times(factor, part) for part in value]
    return None if value is None else factor * value
