"""What the names and units of columns say about them."""

import re
from collections.abc import Sequence
from typing import Literal

from hydroid.log.csv_layout import bare

Kind = Literal["time", "command", "angle", "other", ""]


def _set(text: str) -> frozenset[str]:
    return frozenset(text.split())


DERIVED = _set(
    """velocity vel speed qd dq qdot acc acceleration torque force load effort temp temperature error fault
    status count index sample date"""
)
"""words of what is neither command nor angle, whatever its unit"""
WORDS: dict[Kind, frozenset[str]] = {
    "time": _set("time t timestamp stamp zeit sec seconds temps"),
    "other": _set("flow pump pressure press p pa pb tank supply current"),
    "command": _set(
        """u cmd command commands valve joystick joy input inputs pwm control ctrl duty lever out output spool
        demand volt voltage stell drive"""
    ),
    "angle": _set(
        "q angle angles ang theta phi pos position positions winkel encoder deg rad pitch yaw roll"
    ),
}
"""words that tell the kind of a column"""
UNITS: dict[Kind, frozenset[str]] = {
    "time": _set("s sec secs second seconds ms msec us µs ns min"),
    "command": _set("% pct percent v volt volts mv ma"),
    "angle": _set("deg ° degree degrees rad"),
    "other": _set("bar mbar pa kpa mpa psi n kn nm mm m/s deg/s rad/s °/s l/min rpm °c kg"),
}
"""units that tell the kind of a column"""
SAME = (
    {"arm", "stick", "dipper"},
    {"swing", "slew", "azimuth", "house", "base", "turret"},
    {"bucket", "tool", "gripper"},
    {"shoulder", "boom"},
    {"elbow", "stick"},
)
"""names that machines have for the same joint"""
OPPOSITE = (
    ("up", "down"),
    ("raise", "lower"),
    ("pos", "neg"),
    ("plus", "minus"),
    ("out", "in"),
    ("extend", "retract"),
    ("left", "right"),
    ("open", "close"),
    ("forward", "backward"),
    ("a", "b"),
)
"""words for the positive and the negative direction"""


def words(name: str) -> list[str]:
    """Return the words of a column's name in lower case: "valveCmd_2 [V]" gives valve, cmd, 2."""
    return [word.lower() for word in re.findall(r"[A-Z]?[a-zäöüß]+|[A-Z]+(?![a-z])|\d+", name)]


def unit_of(name: str, given: str = "") -> str:
    """Return the unit in lower case that the file gives, or the one in or at the end of the name, or ""."""
    inside = re.search(r"[\[(<]([^\])>]*)[\])>]\s*$", name)
    for unit in (given, inside[1] if inside else "", re.split(r"[_ .]", name)[-1]):
        if any(bare(unit).lower() in units for units in UNITS.values()):
            return bare(unit).lower()
    return ""


def kind_of(name: str, unit: str) -> Kind:
    """Return what the unit, or else the words of a name say that a column is; "" where they say nothing."""
    there = words(name)
    if DERIVED.intersection(there):
        return "other"
    for kind, units in UNITS.items():
        if unit in units:
            return kind
    told: list[Kind] = [kind for word in reversed(there) for kind, known in WORDS.items() if word in known]
    return told[0] if told else ""


def joint_of(name: str, joints: Sequence[str]) -> int | None:
    """Return the number [from 1] of the joint that a column's name holds the name of; None: of none."""
    there = set(words(name))
    for known in ([{*words(joint)} for joint in joints], [_same(joint) for joint in joints]):
        hits = [k for k, mine in enumerate(known, 1) if mine & there - {"joint"}]
        if len(hits) == 1:
            return hits[0]
    return None


def number_in(name: str) -> int | None:
    """Return the last number in a column's name; None: it has none."""
    numbers = [int(word) for word in words(name) if word.isdecimal()]
    return numbers[-1] if numbers and numbers[-1] < 100 else None


def direction(name: str) -> tuple[int, frozenset[str]]:
    """Return +1, −1 or 0 for the direction that a name tells, and its other words."""
    there = words(name)
    for pair in OPPOSITE:
        for sign, word in zip((1, -1), pair, strict=True):
            if word in there:
                return sign, frozenset(there) - {word}
    return 0, frozenset(there)


def _same(joint: str) -> set[str]:
    return {*words(joint)}.union(*(group for group in SAME if group & {*words(joint)}))
