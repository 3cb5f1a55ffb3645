"""What the name and the unit of a column say about it."""

import re
from collections.abc import Sequence

from hydroid.files import read_table
from hydroid.units import Unit, unit_of

CLUES = read_table("log/clues.yaml")
RAW = ("voltage", "current")
"""quantities in which sensors and amplifiers speak"""


def words(name: str) -> list[str]:
    """Return the words of a column's name in lower case: "valveCmd_2 [V]" gives valve,
    cmd, 2, v."""
    return [
        word.lower()
        for word in re.findall(r"[A-Z]?[a-zäöüß]+|[A-Z]+(?![a-z])|\d+", name)
    ]


def column_unit(name: str, given: str) -> Unit | None:
    """Return the unit that the file gives, or the one in or at the end of the name;
    None: there is none."""
    inside = re.search(r"[\[(<]([^\])>]*)[\])>]\s*$", name)
    units = map(
        unit_of, (given, inside[1] if inside else "", re.split(r"[_ .]", name)[-1])
    )
    return next((unit for unit in units if unit and unit.quantity != "ambiguous"), None)


def kind_of(name: str, unit: Unit | None) -> str:
    """Return time, command, angle or other: what the unit, or else the words of a name
    say of a column."""
    there = words(name)
    if {*there} & {*CLUES["derived"]}:
        return "other"
    if {*there} & {*CLUES["targets"]} and unit and unit.quantity in ("angle", "length"):
        return "target"
    if unit and unit.quantity in RAW and {*there} & {*CLUES["sensors"]}:
        return "angle"
    if unit:
        return CLUES["units"].get(unit.quantity, "other")
    if {*there} & {"cmd", "command", "commands", "joystick", "joy"}:
        return "command"  # also in /joint_commands.position[boom]
    named = (
        kind
        for word in reversed(there)
        for kind, those in CLUES["kinds"].items()
        if word in those
    )
    return next(named, "command" if direction(name)[0] else "other")


def own_part(name: str) -> str:
    """Return what a column has for itself: of `/CalibratedJointVals3.position[Boom]`
    Boom, else its name.

    What stands before the brackets names the topic of a bag, whose columns share it.
    """
    inside = re.fullmatch(r"/.*\[([^\[\]]*)\]", name)
    return inside[1] if inside and unit_of(inside[1]) is None else name


def joint_of(name: str, joints: Sequence[str]) -> int | None:
    """Return the number [from 1] of the only joint whose name a column's name holds;
    None: of none.

    Words of three letters and more may be cut short: `tele1_cmd` is the telescope's.
    """
    if (own := own_part(name)) != name and (hit := joint_of(own, joints)):
        return hit
    there = {*words(name)} - {"joint", "link"}
    exact = [{*words(joint)} - {"joint", "link"} for joint in joints]
    alike = [
        own.union(*(group for group in CLUES["same"] if own & {*group}))
        for own in exact
    ]
    short = [{w[:n] for w in own for n in range(3, len(w))} for own in alike]
    for named in (exact, alike, short):
        hits = [k for k, mine in enumerate(named, 1) if mine & there]
        if len(hits) == 1:
            return hits[0]
    return None


def number_in(name: str) -> int | None:
    """Return the last number in a column's name; None: it has none."""
    numbers = [word for word in words(own_part(name)) if word.isdecimal()]
    # a longer one is no joint's, and Python refuses to convert texts of thousands
    if not numbers or len(numbers[-1].lstrip("0")) > 2:
        return None
    return int(numbers[-1][-2:])


def direction(name: str) -> tuple[int, frozenset[str]]:
    """Return +1, −1 or 0 for the direction that a name tells, and its other words."""
    there = frozenset(words(name))
    for positive, negative in CLUES["opposite"]:
        if word := {positive, negative} & there:
            return (positive in word) - (negative in word), there - word
    return 0, there
