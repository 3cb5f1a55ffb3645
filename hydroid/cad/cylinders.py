"""Cylinders that a robot's file models as links of their own -> where they are pinned.

A tube that turns on one link, a rod that slides in it and is pinned to another: in an MJCF by an
equality constraint, which closes the loop. Between rod and moved link there may be a rocker and a
coupler (a bucket's four-bar linkage). Where one is recognised its links are held, so that their
mass is part of the links that carry them, and the joint that it moves gets the cylinder.
A URDF cannot close loops: its rods end nowhere.
"""

import math
import re
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from hydroid.arrays import Array, record
from hydroid.cad.repair import bare_model
from hydroid.cad.source import Notes, word
from hydroid.files import Plain
from hydroid.settings.linkage import FourBar, four_bar

PARTS = {"rod", "piston", "cylinder", "cyl", "ram", "tube", "barrel", "anchor", "clevis", "trunnion"}
"""words in the names of a cylinder's links and joints"""
ENDS = "parent", "child"  # of the sites that show where a cylinder is pinned


@record
class _Pin:
    """Where two bodies turn on each other [m], shape (3,), in the file's pose; `joint` None:
    an equality."""

    bodies: tuple[str, str]
    at: Array
    joint: Any = None

    def other(self, body: str) -> str:
        return self.bodies[self.bodies[0] == body]


def take_cylinders(spec: mujoco.MjSpec, notes: Notes) -> dict[str, Plain]:
    """Hold the links of cylinders and return what an arm's file says of them,
    by the joint that they move.

    Pivots become sites of the links. A joint needs limits, or its cylinder might pass a dead
    centre. The constraints that close the loops of what is held are deleted; others stay.
    """
    if not any(one.type == mujoco.mjtEq.mjEQ_CONNECT for one in spec.equalities):
        return {}
    _, data = bare_model(spec, notes.path)
    pins, helpers, found = _pins(spec, data), set[str](), dict[str, Plain]()
    for slide in [joint for joint in spec.joints if joint.type == mujoco.mjtJoint.mjJNT_SLIDE]:
        rod, tube = slide.parent.name, slide.parent.parent.name
        for foot in _at(pins, tube, rod):
            for eye in _at(pins, rod, tube):
                made = _linkage(pins, foot, eye, (tube, rod), data)
                if made is None:
                    continue
                joint, own, links = made
                helpers |= {tube, rod, *links}
                if not joint.range[0] < joint.range[1]:
                    notes.add("without limits: the file's cylinder that moves it is not taken", joint.name)
                    continue
                found[joint.name] = own
                if not links:
                    carrier = joint.parent.parent.name
                    ends = (foot, eye) if foot.other(tube) == carrier else (eye, foot)
                    places = zip(ENDS, ends, (carrier, joint.parent.name), strict=True)
                    for end, pin, body in places:
                        place = data.body(body).xmat.reshape(3, 3).T @ (pin.at - data.body(body).xpos)
                        spec.body(body).add_site(name=f"{joint.name}_pivot_{end}", pos=place)
                notes.add("cylinders of the file give these joints' pivots", joint.name)
    for name in helpers:  # and all that hangs on them
        for joint in spec.body(name).find_all("joint"):
            spec.delete(joint)
    for one in [one for one in spec.equalities if helpers.intersection(ends_of(spec, one))]:
        spec.delete(one)
    return found


def take_sites(spec: mujoco.MjSpec, notes: Notes) -> dict[str, Plain]:
    """Return what an arm's file says of the cylinders that pairs of sites show, by joint.

    The sites are called JOINT_pivot_parent and JOINT_pivot_child; the name of the joint may lack
    its ending `_joint`, or be that of the link, and is completed.
    """
    found, sites = dict[str, Plain](), {word(site.name): site for site in spec.sites}
    for joint in spec.joints:
        for name in (joint.name, joint.name.removesuffix("_joint"), joint.parent.name):
            pair = [sites[f"{name}_pivot_{end}"] for end in ENDS if f"{name}_pivot_{end}" in sites]
            if len(pair) == len(ENDS):
                for site, end in zip(pair, ENDS, strict=True):
                    site.name = f"{joint.name}_pivot_{end}"
                found[joint.name] = {"kind": "linear"}
                notes.add("sites of the file give these joints' pivots", joint.name)
                break
    return found


def ends_of(spec: mujoco.MjSpec, constraint: Any) -> tuple[str, str]:
    """Return the names of the two bodies, or joints, that a constraint ties to each other."""
    ends = constraint.name1, constraint.name2
    if constraint.objtype == mujoco.mjtObj.mjOBJ_SITE:
        ends = tuple(spec.site(name).parent.name for name in ends)
    return ends[0], ends[1] or "world"


def is_part_of_cylinder(joint: mujoco.MjsJoint) -> bool:
    """Return whether the names of a joint and its link tell a cylinder's tube or rod,
    which moves no link."""
    return all({*re.split(r"[\W_\d]+", name.lower())} & PARTS for name in (joint.name, joint.parent.name))


def _pins(spec: mujoco.MjSpec, data: mujoco.MjData) -> list[_Pin]:
    """Return where bodies turn on each other: hinges and points that equalities connect."""
    hinge, connect = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtEq.mjEQ_CONNECT
    pins = [
        _Pin((joint.parent.name, joint.parent.parent.name), data.joint(joint.name).xanchor, joint)
        for joint in spec.joints
        if joint.type == hinge
    ]
    for one in spec.equalities:
        if one.type == connect and one.objtype == mujoco.mjtObj.mjOBJ_SITE:
            first, second = (spec.site(name) for name in (one.name1, one.name2))
            pins.append(_Pin((first.parent.name, second.parent.name), data.site(one.name1).xpos))
        elif one.type == connect:
            body = data.body(one.name1)
            at = body.xpos + body.xmat.reshape(3, 3) @ np.array(one.data[:3])
            pins.append(_Pin((one.name1, one.name2 or "world"), at))
    return pins


def _at(pins: Sequence[_Pin], body: str, *without: str) -> list[_Pin]:
    return [pin for pin in pins if body in pin.bodies and pin.other(body) not in without]


def _linkage(
    pins: Sequence[_Pin], foot: _Pin, eye: _Pin, cylinder: tuple[str, str], data: mujoco.MjData
) -> tuple[Any, Plain, tuple[str, ...]] | None:
    """Return the joint that a cylinder moves, its settings, and links between them; None: it moves
    none. `foot` pins the tube to a link, `eye` the rod to another.
    """
    tube, rod = cylinder
    base, moved = foot.other(tube), eye.other(rod)
    # a rocker on the same link, with a coupler to the link that moves
    for ground in _at(pins, moved, rod):
        for pin in _at(pins, moved, rod, base) if ground.other(moved) == base else ():
            coupler = pin.other(moved)
            for end in _at(pins, coupler, moved):
                joint = _joint(pins, base, end.other(coupler))
                if joint and end.other(coupler) != base:
                    bars = _four_bar(data.joint(joint.name), (ground, pin, end, foot, eye))
                    return (joint, bars, (moved, coupler)) if bars else None
    joint = _joint(pins, base, moved)
    return (joint, {"kind": "linear"}, ()) if joint else None


def _joint(pins: Sequence[_Pin], first: str, second: str) -> Any:
    return next((pin.joint for pin in pins if {*pin.bodies} == {first, second} and pin.joint), None)


def _four_bar(joint: Any, pins: Sequence[_Pin]) -> Plain | None:
    """Return the settings of a cylinder that turns a joint by a rocker and a coupler,
    as the file stands.

    The pins are those of rocker and link, rocker and coupler, coupler and child, of the tube,
    of the rod.
    """
    axis = joint.xaxis
    x = np.cross([0.0, 1.0, 0.0] if abs(axis[1]) < 0.9 else [1.0, 0.0, 0.0], axis)
    x /= np.linalg.norm(x)
    # in a plane across the axis [m]
    y, away = np.cross(axis, x), [one.at - joint.xanchor for one in pins]
    ground, pin, child, foot, eye = (complex(one @ x, one @ y) for one in away)
    turn = abs(ground) / ground  # the rocker's pivot lies at (ground, 0)
    side = "left" if ((pin - ground) * np.conj(child - ground)).imag > 0 else "right"
    sides = {"ground": ground, "rocker": pin - ground, "coupler": child - pin, "child": child}
    phase = round(math.degrees(np.angle(child * turn) - joint.qpos[0]), 6)
    bars = FourBar(**{n: round(abs(way), 6) for n, way in sides.items()}, phase_deg=phase, side=side)
    psi, first, _ = map(float, four_bar(joint.qpos[0], bars))
    if not math.isfinite(psi):
        return None
    theta = float(np.angle((eye - ground) * np.conj(foot - ground)))
    # the rod's pin turns with the rocker, by psi
    sense = 1.0 if math.sin(theta) * first > 0 else -1.0
    theta0 = math.degrees(math.remainder(theta - psi, math.tau))
    theta0 += 360.0 * sense if theta0 * sense < 0 else 0.0  # its sign is the rod's way
    a, b = (round(abs(pivot - ground), 6) for pivot in (foot, eye))
    shape = {"a": a, "b": b, "theta0": round(theta0, 6)}
    return {"kind": "linear", "triangle": shape, "four_bar": bars.model_dump()}
