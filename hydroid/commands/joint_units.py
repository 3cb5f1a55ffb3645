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


def _any(value: Any, sliding: Collection[str], *, in_row: bool) -> Any:
    if isinstance(value, Mapping):
        return _mapping(value, sliding, in_row=in_row)
    if isinstance(value, list | tuple):
        return [_any(one, sliding, in_row=in_row) for one in value]
    return value


def _mapping(
    values: Mapping[str, Any], sliding: Collection[str], *, in_row: bool = False
) -> Plain:
    """Return a mapping with other units; `in_row`: it belongs to a joint that slides."""
    is_sliding = in_row or ("joint" in values and values.get("name") in sliding)
    changed: Plain = {}
    for key, value in values.items():
        if not key.endswith((DEGREES, SQUARED)):
            changed[key] = _any(value, sliding, in_row=is_sliding)
        elif is_sliding:
            changed |= _in_mm(key, value)
        elif isinstance(value, Mapping):
            own = {name: one for name, one in value.items() if name in sliding}
            changed[key] = {name: one for name, one in value.items() if name not in own}
            if own:
                changed |= _in_mm(key, own)
        else:
            changed[key] = value
    return changed


def _in_mm(key: str, value: Any) -> Plain:
    """Return numbers that stand in deg under a key in mm, and the key of that."""
    factor = SLIDING.of_degrees(1.0)
    if key.endswith(SQUARED):
        factor **= 2
    head, _, power = key.rpartition(DEGREES)
    return {f"{head}_{SLIDING.unit}{power}": _times(factor, value)}


def _times(factor: float, value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _times(factor, one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_times(factor, one) for one in value]
    return None if value is None else factor * value
