"""What a fit takes from its settings without estimating it."""

from dataclasses import replace

from hydroid.quantity_table import HYDRAULIC
from hydroid.reporting.page import Cell, Given, Table
from hydroid.settings.fit import FitSettings
from hydroid.words import listed

OF_SPRING = ("oil_damping", "oil_damping_share")
"""quantities of a spring of oil: without its frequency they change nothing"""
OTHER_SIDE = {"_a": "_b", "_b": "_a"}
_HEADER = ("joint", "quantity", "value", "unit", "from")
_NOTE = (
    "Not estimated. default: hydroid's own value. Geometry, areas and masses that are no parameters "
    "are those of the arm's file. Left out: values of 0 or without a limit, and ratios of 1."
)


def held_table(settings: FitSettings) -> Table:
    """Return the quantities of the hydraulics that settings hold and that are not off; no
    rows of stage 1.

    Two sides of the same value share a row.
    """
    rows = dict.fromkeys(
        _row(settings, name) for name in HYDRAULIC if _is_held(settings, name)
    )
    table = Table("Held by the settings", _HEADER, tuple(rows), _NOTE)
    if not any(row[0] for row in rows):
        return replace(table, header=_HEADER[1:], rows=tuple(row[1:] for row in rows))
    return table


def _is_held(settings: FitSettings, name: str) -> bool:
    """Return whether settings hold a quantity of the hydraulics that changes
    anything."""
    if getattr(settings.hydraulics, name) is None:
        return False
    return bool(_held_joints(settings, name)) and not _is_off(settings, name)


def _row(settings: FitSettings, name: str) -> tuple[Cell, ...]:
    """Return the row of a quantity that settings hold; its side is left out where the
    other one is held alike."""
    quantity = HYDRAULIC[name]
    value = getattr(settings.hydraulics, name)
    joints = _held_joints(settings, name)
    side = name[-2:] if name[-2:] in OTHER_SIDE else ""
    words = quantity.plain
    if side:
        other = name.removesuffix(side) + OTHER_SIDE[side]
        same_value = value == getattr(settings.hydraulics, other)
        if same_value and joints == _held_joints(settings, other):
            words = words.rpartition(", side")[0]
    of = ""
    if len(joints) < len(settings.outputs):
        of = listed([settings.arm.name_of(joint) for joint in joints])
    source = "default" if value == quantity.default else "settings"
    return of, words, Given(value), quantity.unit, source


def _is_off(settings: FitSettings, name: str) -> bool:
    """Return whether a quantity changes nothing at the value of the settings."""
    value = getattr(settings.hydraulics, name)
    has_spring = settings.hydraulics.oil_frequency is not None
    # a fit may estimate the frequency instead
    has_spring |= _held_joints(settings, "oil_frequency") != [*settings.outputs]
    if not settings.rung.has(name) or (name in OF_SPRING and not has_spring):
        return True
    return value == 0.0 or (value == 1.0 and not HYDRAULIC[name].unit)


def _held_joints(settings: FitSettings, name: str) -> list[int]:
    """Return the compared joints that have a quantity, and of which no parameter states
    it."""
    base = name.removesuffix("_a").removesuffix("_b")
    held = [joint for joint in settings.outputs if not settings.ignores(name, joint)]
    for parameter in settings.parameters.values():
        # an effect of a group of logs adds to the value
        if parameter.per is None and parameter.quantity in (name, base):
            of = parameter.joints or settings.outputs
            held = [joint for joint in held if joint not in of]
    return held
