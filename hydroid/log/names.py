"""What the names and units of columns say about them."""

import re
from collections.abc import Sequence
from typing import Literal

from hydroid.units import Unit, unit_of

Kind = Literal["time", "command", "angle", "other", ""]

DERIVED = """velocity vel speed qd dq qdot acc acceleration torque force load effort temp temperature error
fault status count index sample date"""
"""words of what is neither command nor angle, whatever its unit"""
WORDS: dict[str, Kind] = {
    "time t timestamp stamp zeit sec seconds temps": "time",
    "flow pump pressure press p pa pb tank supply current": "other",
    """u cmd command commands valve joystick joy input inputs pwm control ctrl duty lever out output spool
    demand volt voltage stell drive""": "command",
    "q angle angles ang theta phi pos position positions winkel encoder deg rad pitch yaw roll": "angle",
}
"""words that tell the kind of a column"""
KINDS: dict[str, Kind] = {
    "time": "time",
    "angle": "angle",
    "command": "command",
    "voltage": "command",
    "current": "command",
}
"""kind of a column by what its unit measures; of all other units it is "other\""""
SAME = (
    "arm stick dipper",
    "swing slew azimuth house base turret",
    "bucket tool gripper",
    "shoulder boom",
    "elbow stick",
)
"""names that machines have for the same joint"""
OPPOSITE = (
    "up:down raise:lower pos:neg plus:minus out:in extend:retract left:right open:close forward:backward a:b"
)
"""words for the positive and the negative direction"""


def words(name: str) -> list[str]:
    """Return the words of a column's name in lower case: "valveCmd_2 [V]" gives valve, cmd, 2, v."""
    return [word.lower() for word in re.findall(r"[A-Z]?[a-zäöüß]+|[A-Z]+(?![a-z])|\d+", name)]


def column_unit(name: str, given: str = "") -> Unit | None:
    """Return the unit that the file gives, or the one in or at the end of the name; None: there is none."""
    inside = re.search(r"[\[(<]([^\])>]*)[\])>]\s*$", name)
    for text in (given, inside[1] if inside else "", re.split(r"[_ .]", name)[-1]):
        unit = unit_of(text)
        if unit and unit.quantity != "ambiguous":
            return unit
    return None


def kind_of(name: str, unit: Unit | None) -> Kind:
    """Return what the unit, or else the words of a name say that a column is; "" where they say nothing."""
    there = words(name)
    if {*there} & {*DERIVED.split()}:
        return "other"
    if unit:
        return KINDS.get(unit.quantity, "other")
    for word in reversed(there):
        for known, kind in WORDS.items():
            if word in known.split():
                return kind
    return ""


def joint_of(name: str, joints: Sequence[str]) -> int | None:
    """Return the number [from 1] of the joint that a column's name holds the name of; None: of none."""
    there = {*words(name)} - {"joint"}
    exact = [{*words(joint)} for joint in joints]
    alike = [own.union(*(group.split() for group in SAME if own & {*group.split()})) for own in exact]
    for named in (exact, alike):
        hits = [k for k, mine in enumerate(named, 1) if mine & there]
        if len(hits) == 1:
            return hits[0]
    return None


def number_in(name: str) -> int | None:
    """Return the last number in a column's name; None: it has none."""
    numbers = [int(word) for word in words(name) if word.isdecimal()]
    return numbers[-1] if numbers and numbers[-1] < 100 else None


def direction(name: str) -> tuple[int, frozenset[str]]:
    """Return +1, −1 or 0 for the direction that a name tells, and its other words."""
    there = frozenset(words(name))
    for pair in OPPOSITE.split():
        for sign, word in zip((1, -1), pair.split(":"), strict=True):
            if word in there:
                return sign, there - {word}
    return 0, there
