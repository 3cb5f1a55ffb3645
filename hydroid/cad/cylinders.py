"""Cylinders that a robot's file models as links of their own -> where they are pinned.

A tube that turns on one link, a rod that slides in it and is pinned to another: in an
MJCF by an equality constraint, which closes the loop. Between rod and moved link there
may be a rocker and a coupler (a bucket's four-bar linkage). Where one is recognised its
links are held, so that their mass is part of the links that carry them, and the joint
that it moves gets the cylinder. A URDF cannot close loops: its rods end nowhere.
"""

import math
import re
from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any, NamedTuple

import mujoco
import numpy as np

from hydroid.arrays import Array, record
from hydroid.cad.repair import bare_model
from hydroid.cad.source import Notes, word
from hydroid.files import Plain
from hydroid.settings.linkage import FourBar, four_bar

PARTS = {
    "rod",
    "piston",
    "cylinder",
    "cyl",
    "ram",
    "tube",
    "barrel",
    "anchor",
    "clevis",
    "trunnion",
}
"""words in the names of a cylinder's links and joints"""
ENDS = "parent", "child"  # of the sites that show where a cylinder is pinned


@record
class _Pin:
    """Where two bodies turn on each other [m], shape (3,), in the file's pose; `joint`
    None: an equality."""

    bodies: tuple[str, str]
    at: Array
    joint: Any = None

    def other(self, body: str) -> str:
        return self.bodies[self.bodies[0] == body]


def take_cylinders(spec: mujoco.MjSpec, notes: Notes) -> dict[str, Plain]:
    """Hold the links of cylinders and return what an arm's file says of them,
    by the joint that they move.

    Pivots become sites of the links. A joint needs limits, or its cylinder might pass a
    dead centre. The constraints that close the loops of what is held are deleted;
    others stay.
    """
    if not any(
        equality.type == mujoco.mjtEq.mjEQ_CONNECT for equality in spec.equalities
    ):
        return {}
    _, data = bare_model(spec, notes.path)
    pins = _pins(spec, data)
    held = set[str]()
    cylinders = dict[str, Plain]()
    for made in _linkages(spec, pins, data):
        held |= {made.tube, made.rod, *made.bars}
        joint = made.joint
        low, high = joint.range
        if not low < high:
            notes.add(
                "without limits: the file's cylinder that moves it is not taken",
                joint.name,
            )
            continue
        cylinders[joint.name] = made.settings
        if not made.bars:
            _show_pivots(spec, made, data)
        notes.add("cylinders of the file give these joints' pivots", joint.name)
    # with them all that hangs on them
    for name in held:
        for joint in spec.body(name).find_all("joint"):
            spec.delete(joint)
    for equality in list(spec.equalities):
        if held.intersection(ends_of(spec, equality)):
            spec.delete(equality)
    return cylinders


def _linkages(
    spec: mujoco.MjSpec, pins: Sequence[_Pin], data: mujoco.MjData
) -> Iterator["_Linkage"]:
    """Yield every cylinder: a rod that slides in a tube,
    both pinned to links that a joint connects."""
    for slide in spec.joints:
        if slide.type != mujoco.mjtJoint.mjJNT_SLIDE:
            continue
        rod = slide.parent.name
        tube = slide.parent.parent.name
        for foot, eye in product(_at(pins, tube, rod), _at(pins, rod, tube)):
            made = _linkage(pins, foot, eye, (tube, rod), data)
            if made is not None:
                yield made


def _show_pivots(spec: mujoco.MjSpec, made: "_Linkage", data: mujoco.MjData) -> None:
    """Add the two sites by which an arm's file finds the pivots of a cylinder."""
    carrier = made.joint.parent.parent.name
    moved = made.joint.parent.name
    pins = [made.foot, made.eye]
    # the cylinder stands on its head
    if made.foot.other(made.tube) != carrier:
        pins.reverse()
    for end, pin, body in zip(ENDS, pins, (carrier, moved), strict=True):
        frame = data.body(body)
        place = frame.xmat.reshape(3, 3).T @ (pin.at - frame.xpos)
        spec.body(body).add_site(name=f"{made.joint.name}_pivot_{end}", pos=place)


def take_sites(spec: mujoco.MjSpec, notes: Notes) -> dict[str, Plain]:
    """Return what an arm's file says of the cylinders that pairs of sites show, by
    joint.

    The sites are called JOINT_pivot_parent and JOINT_pivot_child; the name of the joint
    may lack its ending `_joint`, or be that of the link, and is completed.
    """
    cylinders = dict[str, Plain]()
    sites = {word(site.name): site for site in spec.sites}
    for joint in spec.joints:
        for name in (joint.name, joint.name.removesuffix("_joint"), joint.parent.name):
            site_names = [f"{name}_pivot_{end}" for end in ENDS]
            if not sites.keys() >= {*site_names}:
                continue
            for site_name, end in zip(site_names, ENDS, strict=True):
                sites[site_name].name = f"{joint.name}_pivot_{end}"
            cylinders[joint.name] = {"kind": "linear"}
            notes.add("sites of the file give these joints' pivots", joint.name)
            break
    return cylinders


def ends_of(spec: mujoco.MjSpec, constraint: Any) -> tuple[str, str]:
    """Return the names of the two bodies, or joints, that a constraint ties to each
    other."""
    ends = (constraint.name1, constraint.name2)
    if constraint.objtype == mujoco.mjtObj.mjOBJ_SITE:
        ends = tuple(spec.site(name).parent.name for name in ends)
    return ends[0], ends[1] or "world"


def is_part_of_cylinder(joint: mujoco.MjsJoint) -> bool:
    """Return whether the names of a joint and its link tell a cylinder's tube or rod,
    which moves no link."""
    for name in (joint.name, joint.parent.name):
        if not PARTS.intersection(re.split(r"[\W_\d]+", name.lower())):
            return False
    return True


def _pins(spec: mujoco.MjSpec, data: mujoco.MjData) -> list[_Pin]:
    """Return where bodies turn on each other: hinges and points that equalities
    connect."""
    pins = list[_Pin]()
    for joint in spec.joints:
        if joint.type == mujoco.mjtJoint.mjJNT_HINGE:
            bodies = (joint.parent.name, joint.parent.parent.name)
            pins.append(_Pin(bodies, data.joint(joint.name).xanchor, joint))
    for equality in spec.equalities:
        if equality.type != mujoco.mjtEq.mjEQ_CONNECT:
            continue
        if equality.objtype == mujoco.mjtObj.mjOBJ_SITE:
            at = data.site(equality.name1).xpos
        else:
            body = data.body(equality.name1)
            at = body.xpos + body.xmat.reshape(3, 3) @ np.array(equality.data[:3])
        pins.append(_Pin(ends_of(spec, equality), at))
    return pins


def _at(pins: Sequence[_Pin], body: str, *without: str) -> list[_Pin]:
    """Return the pins of a body, but for those to some other bodies."""
    return [
        pin for pin in pins if body in pin.bodies and pin.other(body) not in without
    ]


@record
class _Linkage:
    """A cylinder, how it is pinned, the joint that it moves, and the settings that say
    so.

    `foot` pins the tube to a link, `eye` the rod to another; `bars` are the rocker and
    the coupler between rod and moved link, if there are any.
    """

    tube: str
    rod: str
    foot: _Pin
    eye: _Pin
    joint: Any
    settings: Plain
    bars: tuple[str, ...] = ()


def _linkage(
    pins: Sequence[_Pin],
    foot: _Pin,
    eye: _Pin,
    cylinder: tuple[str, str],
    data: mujoco.MjData,
) -> _Linkage | None:
    """Return what a cylinder, (tube, rod), moves, by a rocker and a coupler or
    directly; None: it moves no joint."""
    tube, rod = cylinder
    base = foot.other(tube)
    moved = eye.other(rod)
    for pinned in _rockers(pins, base, moved, rod):
        coupler = pinned.coupler.other(moved)
        child = pinned.child.other(coupler)
        joint = _joint(pins, base, child)
        if not joint or child == base:
            continue
        places = (pinned.rocker, pinned.coupler, pinned.child, foot, eye)
        settings = _four_bar(data.joint(joint.name), places)
        if settings is None:
            return None
        return _Linkage(tube, rod, foot, eye, joint, settings, (moved, coupler))
    joint = _joint(pins, base, moved)
    if not joint:
        return None
    return _Linkage(tube, rod, foot, eye, joint, {"kind": "linear"})


class _FourBarPins(NamedTuple):
    """Where a rocker turns on the link that carries the cylinder, where a coupler turns
    on the rocker, and where the moved link turns on the coupler."""

    rocker: _Pin
    coupler: _Pin
    child: _Pin


def _rockers(
    pins: Sequence[_Pin], base: str, rocker: str, rod: str
) -> Iterator[_FourBarPins]:
    """Yield the pins of four-bar linkages whose rocker a rod moves and a base
    carries."""
    for ground in _at(pins, rocker, rod):
        if ground.other(rocker) != base:
            continue
        for pin in _at(pins, rocker, rod, base):
            for end in _at(pins, pin.other(rocker), rocker):
                yield _FourBarPins(ground, pin, end)


def _joint(pins: Sequence[_Pin], first: str, second: str) -> Any:
    """Return the joint between two bodies, in either order; None where there is
    none."""
    for pin in pins:
        if pin.joint and {*pin.bodies} == {first, second}:
            return pin.joint
    return None


def _four_bar(joint: Any, pins: Sequence[_Pin]) -> Plain | None:
    """Return the settings of a cylinder that turns a joint by a rocker and a coupler,
    as the file stands.

    The pins are those of rocker and link, rocker and coupler, coupler and child, of the
    tube, of the rod.
    """
    # points in the plane across the joint's axis, as complex numbers from the joint [m]
    axis = joint.xaxis
    x = np.cross([0.0, 1.0, 0.0] if abs(axis[1]) < 0.9 else [1.0, 0.0, 0.0], axis)
    x /= np.linalg.norm(x)
    y = np.cross(axis, x)
    offsets = [pin.at - joint.xanchor for pin in pins]
    ground, pin, child, foot, eye = (
        complex(offset @ x, offset @ y) for offset in offsets
    )
    # the rocker's pivot lies at (ground, 0)
    turn = abs(ground) / ground
    is_left = ((pin - ground) * np.conj(child - ground)).imag > 0
    bars = FourBar(
        ground=round(abs(ground), 6),
        rocker=round(abs(pin - ground), 6),
        coupler=round(abs(child - pin), 6),
        child=round(abs(child), 6),
        phase_deg=round(math.degrees(np.angle(child * turn) - joint.qpos[0]), 6),
        side="left" if is_left else "right",
    )
    rocker_angle, per_joint_angle, _ = map(float, four_bar(joint.qpos[0], bars))
    if not math.isfinite(rocker_angle):
        return None
    between_pivots = float(np.angle((eye - ground) * np.conj(foot - ground)))
    # the rod's pin turns with the rocker
    sense = 1.0 if math.sin(between_pivots) * per_joint_angle > 0 else -1.0
    theta0 = math.degrees(math.remainder(between_pivots - rocker_angle, math.tau))
    # the sign of theta0 says which way the rod moves
    if theta0 * sense < 0:
        theta0 += 360.0 * sense
    triangle = {
        "a": round(abs(foot - ground), 6),
        "b": round(abs(eye - ground), 6),
        "theta0": round(theta0, 6),
    }
    return {"kind": "linear", "triangle": triangle, "four_bar": bars.model_dump()}
