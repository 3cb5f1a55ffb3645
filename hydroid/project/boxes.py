"""An arm of boxes from the names of its joints and the lengths of its links, for a
machine without CAD."""

import math
from collections.abc import Mapping, Sequence

from hydroid.arrays import Limits
from hydroid.errors import SettingsError
from hydroid.log.clues import words

UPRIGHT = 0.0
"""length that says that a joint turns about the vertical, as a slewing gear does [m]"""
RANGES = {
    "swing": (-180, 180),
    "boom": (-30, 60),
    "stick": (-130, -20),
    "bucket": (-150, 30),
}
"""of joints that are called so [deg]; ours, as excavators have them"""
CALLED = {
    "slew": "swing",
    "azimuth": "swing",
    "arm": "stick",
    "dipper": "stick",
    "tool": "bucket",
}
TELESCOPES = ("telescope", "extension", "slide")
"""words of a joint that slides along its link"""
SLID = 0.9
"""part of its length by which a telescope slides out"""
OTHERS = (-90, 90)
MASS = 45.0
"""of a link over the square of its length [kg/m²]; ours, as of excavators of 1 to 20
t"""
DENSEST = 3000.0
"""of a link's box [kg/m³], where small links would weigh more than steel"""
SLENDER = 7.0
"""length of a link over its width and height"""
LONGEST = 100.0
"""of a link [m]"""


NO_RANGES: Mapping[str, Limits] = {}


def boxes_urdf(
    joints: Sequence[str],
    lengths: Sequence[float],
    ranges: Mapping[str, Limits] = NO_RANGES,
) -> str:
    """Return a URDF of an arm whose links are boxes; a joint of length 0 turns its link
    about the vertical, and one called a telescope slides out of the link before.

    `ranges` of joints [rad, m]; those without have what machines have whose joints are
    called so.

    Raises SettingsError: not a length for each joint, or one that no link has.
    """
    _check(joints, lengths)
    reach = sum(lengths)
    parent = "base"
    at = "0 0 1"
    before = 0.0
    parts = ['<link name="base"/>']
    for joint, length in zip(joints, lengths, strict=True):
        upright = length == UPRIGHT
        size = length
        if upright:
            size = reach / SLENDER
        own = f"{joint}_link"
        if is_telescope(joint):
            # drawn in, it ends where the link does that it slides in
            at = f"{max(before - length, 0):g} 0 0"
        parts.append(_link(own, size, reach if upright else length, cube=upright))
        limits = ranges.get(joint) or _usual_range(joint, length)
        parts.append(_joint(joint, parent, at, length, limits))
        parent = own
        before = length
        at = f"{length:g} 0 0"
    return f'<robot name="boxes">{"".join(parts)}</robot>'


def is_telescope(joint: str) -> bool:
    """Return whether a joint is called as one that slides."""
    return not {*words(joint)}.isdisjoint(TELESCOPES)


def moves_as(joint: str, length: float) -> str:
    """Return how a joint of a length moves, in words."""
    if is_telescope(joint):
        return f"{joint} slides by {SLID * length:g} m"
    if length == UPRIGHT:
        return f"{joint} slews"
    return f"{joint} lifts"


def _check(joints: Sequence[str], lengths: Sequence[float]) -> None:
    """Raise SettingsError as `boxes_urdf` says."""
    if not joints or len(joints) != len(lengths):
        what = f"{len(lengths)} lengths are given for {len(joints)} joints"
        raise SettingsError(
            what,
            "--lengths",
            "as in --joints swing,boom,arm,bucket --lengths 0,3.7,1.6,0.9",
        )
    odd = [joint for joint in joints if not (joint.isascii() and joint.isidentifier())]
    if odd:
        what = f"{odd[0]!r} is no name of a joint"
        raise SettingsError(what, "--joints", "letters from a to z, digits and _")
    if len({*joints}) < len(joints):
        raise SettingsError("holds a name twice", "--joints")
    _check_lengths(joints, lengths)


def _check_lengths(joints: Sequence[str], lengths: Sequence[float]) -> None:
    """Raise SettingsError where joints' links cannot have these lengths [m]."""
    wrong = [length for length in lengths if not 0 <= length <= LONGEST]
    allowed = f"0 to {LONGEST:g} m; 0 for a joint that slews"
    if wrong:
        what = f"{wrong[0]:g} is no length of a link"
        raise SettingsError(what, "--lengths", allowed)
    for joint, length in zip(joints, lengths, strict=True):
        if is_telescope(joint) and length == UPRIGHT:
            raise SettingsError(f"the telescope {joint} has none", "--lengths", allowed)
    if not any(lengths):
        raise SettingsError("no link has a length", "--lengths", allowed)


def _link(name: str, size: float, length: float, *, cube: bool) -> str:
    """Return a box along x, or one around the axis of a link that slews, which weighs
    as the arm does."""
    wide = size
    if not cube:
        wide = size / SLENDER
    mass = min(MASS * length**2, DENSEST * size * wide**2)
    middle = 0.0
    if not cube:
        middle = size / 2
    along = mass * wide**2 / 6
    across = mass * (wide**2 + size**2) / 12
    origin = f'<origin xyz="{middle:g} 0 0"/>'
    return (
        f'<link name="{name}"><inertial>{origin}<mass value="{mass:g}"/>'
        f'<inertia ixx="{along:g}" iyy="{across:g}" izz="{across:g}" ixy="0" ixz="0" iyz="0"/></inertial>'
        f'<visual>{origin}<geometry><box size="{size:g} {wide:g} {wide:g}"/></geometry></visual></link>'
    )


def _usual_range(name: str, length: float) -> Limits:
    """Return the range of a joint that is called so [rad, m]."""
    if is_telescope(name):
        return 0.0, SLID * length
    called = [CALLED.get(word, word) for word in words(name)]
    ends = next((RANGES[word] for word in called if word in RANGES), OTHERS)
    if length == UPRIGHT:
        ends = RANGES["swing"]
    low, high = ends
    return math.radians(low), math.radians(high)


def _joint(name: str, parent: str, at: str, length: float, limits: Limits) -> str:
    kind = "revolute"
    # positive angles lift
    axis = "0 -1 0"
    if is_telescope(name):
        kind = "prismatic"
        axis = "1 0 0"
    elif length == UPRIGHT:
        axis = "0 0 1"
    low, high = limits
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{name}_link"/>'
        f'<origin xyz="{at}"/><axis xyz="{axis}"/>'
        f'<limit lower="{low:.9g}" upper="{high:.9g}" effort="0" velocity="0"/></joint>'
    )
