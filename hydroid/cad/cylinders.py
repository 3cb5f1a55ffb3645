"""Cylinders that a robot's file models as links of their own -> where they are pinned.

A tube that turns on one link, a rod that slides in it and is pinned to another: in an
MJCF by an equality constraint, which closes the loop. Between rod and moved link there
may be a rocker and a coupler (a bucket's four-bar linkage). Where one is recognised its
links are held, so that their mass is part of the links that carry them, and the joint
that it moves gets the cylinder. A URDF cannot close loops: its rods are closed where
pins meet (`pins.py`).
"""

import math
from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any, NamedTuple

import mujoco
import numpy as np

from hydroid.arrays import record
from hydroid.cad.loops import SAME, close_loops
from hydroid.cad.pins import (
    Pin,
    closed_pins,
    ends_of,
    hinged_rods,
    pins_at,
    pins_of,
    sliding_rods,
)
from hydroid.cad.repair import bare_model
from hydroid.cad.source import Notes, word
from hydroid.files import Plain
from hydroid.settings.linkage import FourBar, four_bar

ENDS = "parent", "child"  # of the sites that show where a cylinder is pinned
TWIN = "two cylinders move it: they are taken for one, whose areas are those of both"
ANOTHER = (
    "a second cylinder with other pins moves it, which hydroid does not model: left out"
)
LETTERS = ("E", "F", "G", "H")
"""sites of a bucket's linkage, from the foot of its cylinder to the bucket"""


def take_cylinders(spec: mujoco.MjSpec, notes: Notes) -> dict[str, Plain]:
    """Hold the links of cylinders and return what an arm's file says of them,
    by the joint that they move.

    Pivots become sites of the links. A joint needs limits, or its cylinder might pass a
    dead centre. The constraints that close the loops of what is held are deleted;
    others stay.
    """
    cylinder_pairs = [*sliding_rods(spec), *hinged_rods(spec)]
    if not cylinder_pairs:
        return {}
    model, data = bare_model(spec, notes.path)
    close_loops(model, data, notes)
    pins = pins_of(spec, data)
    pins += closed_pins(spec, pins, cylinder_pairs, data, notes)
    held = set[str]()
    taken = dict[str, _Linkage]()
    cylinders = dict[str, Plain]()
    for made in _linkages(pins, cylinder_pairs, data, notes):
        held |= {made.tube, made.rod, *made.bars}
        joint = made.joint
        if joint is None:
            continue
        low, high = joint.range
        if not low < high:
            notes.add(
                "without limits: the file's cylinder that moves it is not taken",
                joint.name,
            )
            continue
        first = taken.setdefault(joint.name, made)
        if first is not made:
            is_twin = _on_one_bolt(first.foot, made.foot, data.joint(joint.name))
            is_twin &= _on_one_bolt(first.eye, made.eye, data.joint(joint.name))
            notes.add(TWIN if is_twin else ANOTHER, joint.name)
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
    pins: Sequence[Pin],
    cylinder_pairs: Sequence[tuple[str, str]],
    data: mujoco.MjData,
    notes: Notes,
) -> Iterator["_Linkage"]:
    """Yield every cylinder, (tube, rod), that is pinned to links which a joint
    connects, and those of six bars, which move none that is known."""
    for tube, rod in cylinder_pairs:
        ends = [*product(pins_at(pins, tube, rod), pins_at(pins, rod, tube))]
        found = [_linkage(pins, foot, eye, (tube, rod), data) for foot, eye in ends]
        made = [linkage for linkage in found if linkage is not None]
        yield from made
        for foot, eye in () if made else ends:
            bars = _six_bars(pins, foot.other(tube), eye.other(rod), rod)
            if bars:
                what = (
                    f"a cylinder on {foot.other(tube)} that turns {bars[0]}, which another link "
                    "carries: a linkage of six bars, which hydroid does not model: held. The joint "
                    "that it moves has a stand-in"
                )
                notes.add(what, tube, rod)
                yield _Linkage(tube, rod, foot, eye, None, {}, bars)
                break


def _six_bars(pins: Sequence[Pin], base: str, crank: str, rod: str) -> tuple[str, ...]:
    """Return the crank that a rod turns and what hangs between it and the moved link,
    if a link beside the cylinder's base carries it; empty: none does."""
    grounds = [pin.other(crank) for pin in pins_at(pins, crank, rod) if pin.joint]
    carrier = next((one for one in grounds if _joint(pins, base, one)), "")
    if not carrier:
        return ()
    struts = [pin.other(crank) for pin in pins_at(pins, crank, rod, carrier)]
    return (crank, *struts)


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
        axes = frame.xmat.reshape(3, 3)
        place = axes.T @ (pin.at - frame.xpos)
        spec.body(body).add_site(name=f"{made.joint.name}_pivot_{end}", pos=place)


def take_sites(spec: mujoco.MjSpec, notes: Notes) -> dict[str, Plain]:
    """Return what an arm's file says of the cylinders that sites show, by joint.

    The sites are called JOINT_pivot_parent and JOINT_pivot_child; the name of the joint
    may lack its ending `_joint`, or be that of the link, and is completed. Of a four-bar
    linkage there are JOINT_pivot_rocker and JOINT_pivot_rod, too, or sites E, F, G, H.
    """
    cylinders = dict[str, Plain]()
    sites = {word(site.name): site for site in spec.sites}
    for joint in spec.joints:
        for name in (joint.name, joint.name.removesuffix("_joint"), joint.parent.name):
            site_names = [f"{name}_pivot_{end}" for end in ENDS]
            if not sites.keys() >= {*site_names}:
                continue
            if f"{name}_pivot_rocker" in sites:
                bars = [f"{name}_pivot_{pin}" for pin in ("rod", "rocker")]
                pins = (site_names[0], *bars, site_names[1])
                _take_bars(spec, joint, pins, cylinders, notes)
                break
            for site_name, end in zip(site_names, ENDS, strict=True):
                sites[site_name].name = f"{joint.name}_pivot_{end}"
            cylinders[joint.name] = {"kind": "linear"}
            notes.add("sites of the file give these joints' pivots", joint.name)
            break
    if sites.keys() >= {*LETTERS}:
        for joint in sites["H"].parent.joints:
            what = "foot of the cylinder, pin of its rod, pivot of the rocker, end of the coupler"
            notes.add(f"sites E, F, G and H: taken for {what}", joint.name)
            _take_bars(spec, joint, LETTERS, cylinders, notes)
    return cylinders


def _take_bars(
    spec: mujoco.MjSpec,
    joint: Any,
    sites: Sequence[str],
    cylinders: dict[str, Plain],
    notes: Notes,
) -> None:
    """Add the cylinder of a four-bar linkage: the foot, the rod's pin, which is the
    coupler's, the rocker's pivot and the coupler's end on the moved link."""
    _, data = bare_model(spec, notes.path)
    try:
        foot, pin, rocker, child = [
            Pin(("", ""), data.site(name).xpos.copy()) for name in sites
        ]
    except KeyError:
        what = f"its four-bar linkage lacks the site {sites[1]}, where rod, rocker and coupler meet"
        notes.add(f"{what}: left out", joint.name)
        return
    settings = _four_bar(data.joint(joint.name), (rocker, pin, child, foot, pin))
    if settings is None:
        notes.add(
            "its four-bar linkage does not close, or two of its pins coincide: left out",
            joint.name,
        )
        return
    cylinders[joint.name] = settings
    notes.add("sites of the file give these joints' pivots", joint.name)


@record
class _Linkage:
    """A cylinder, how it is pinned, the joint that it moves, and the settings that say
    so.

    `foot` pins the tube to a link, `eye` the rod to another; `bars` are the rockers and
    the coupler between rod and moved link, if there are any. `joint` None: of a linkage
    that is held.
    """

    tube: str
    rod: str
    foot: Pin
    eye: Pin
    joint: Any
    settings: Plain
    bars: tuple[str, ...] = ()


def _linkage(
    pins: Sequence[Pin],
    foot: Pin,
    eye: Pin,
    cylinder: tuple[str, str],
    data: mujoco.MjData,
) -> _Linkage | None:
    """Return what a cylinder, (tube, rod), moves, by a rocker and a coupler or
    directly; None: it moves no joint."""
    tube, rod = cylinder
    base = foot.other(tube)
    moved = eye.other(rod)
    for rocker in (moved, *_on_one_pin(pins, eye, moved, data)):
        for pinned in _rockers(pins, base, rocker, rod):
            coupler = pinned.coupler.other(rocker)
            child = pinned.child.other(coupler)
            joint = _joint(pins, base, child)
            if not joint or child == base:
                continue
            # a second rocker beside the first is not what they move
            if _on_one_bolt(pinned.child, pinned.coupler, data.joint(joint.name)):
                continue
            places = (pinned.rocker, pinned.coupler, pinned.child, foot, eye)
            settings = _four_bar(data.joint(joint.name), places)
            if settings is None:
                return None
            # a rocker on either side is as good as one
            twins = [
                pin.other(coupler)
                for pin in pins_at(pins, coupler, rocker, rod, child)
                if _joint(pins, base, pin.other(coupler))
            ]
            bars = (rocker, coupler, *twins)
            return _Linkage(tube, rod, foot, eye, joint, settings, bars)
    joint = _joint(pins, base, moved)
    if not joint:
        return None
    return _Linkage(tube, rod, foot, eye, joint, {"kind": "linear"})


def _on_one_pin(
    pins: Sequence[Pin], eye: Pin, coupler: str, data: mujoco.MjData
) -> list[str]:
    """Return the bodies that turn on a coupler where the rod's eye does, beside it on
    one bolt: its rockers, where the rod is pinned to the coupler."""
    found = list[str]()
    for hinge in pins_at(pins, coupler):
        if not hinge.joint:
            continue
        joint = data.joint(hinge.joint.name)
        for pin in pins_at(pins, coupler):
            if pin is not eye and _on_one_bolt(pin, eye, joint):
                found.append(pin.other(coupler))
    return found


def _on_one_bolt(first: Pin, second: Pin, joint: Any) -> bool:
    """Return whether two pins lie on one line along a joint's axis."""
    way = first.at - second.at
    across = way - joint.xaxis * (joint.xaxis @ way)
    return bool(np.linalg.norm(across) < SAME)


class _FourBarPins(NamedTuple):
    """Where a rocker turns on the link that carries the cylinder, where a coupler turns
    on the rocker, and where the moved link turns on the coupler."""

    rocker: Pin
    coupler: Pin
    child: Pin


def _rockers(
    pins: Sequence[Pin], base: str, rocker: str, rod: str
) -> Iterator[_FourBarPins]:
    """Yield the pins of four-bar linkages whose rocker a rod moves and a base
    carries."""
    for ground in pins_at(pins, rocker, rod):
        if ground.other(rocker) != base:
            continue
        for pin in pins_at(pins, rocker, rod, base):
            for end in pins_at(pins, pin.other(rocker), rocker):
                yield _FourBarPins(ground, pin, end)


def _joint(pins: Sequence[Pin], first: str, second: str) -> Any:
    """Return the joint between two bodies, in either order; None where there is
    none."""
    for pin in pins:
        if pin.joint and {*pin.bodies} == {first, second}:
            return pin.joint
    return None


def _four_bar(joint: Any, pins: Sequence[Pin]) -> Plain | None:
    """Return the settings of a cylinder that turns a joint by a rocker and a coupler,
    as the file stands; None: its bars do not close, or two of their pins coincide.

    The pins are those of rocker and link, rocker and coupler, coupler and child, of the
    tube, of the rod.
    """
    # points in the plane across the joint's axis, as complex numbers from the joint [m]
    axis = joint.xaxis
    # any direction will do that is not nearly the axis'
    across = [0.0, 1.0, 0.0]
    if abs(axis[1]) >= 0.9:
        across = [1.0, 0.0, 0.0]
    x = np.cross(across, axis)
    x /= np.linalg.norm(x)
    y = np.cross(axis, x)
    offsets = [pin.at - joint.xanchor for pin in pins]
    ground, pin, child, foot, eye = (
        complex(offset @ x, offset @ y) for offset in offsets
    )
    # pins that coincide are no bars; the rod's may be the coupler's
    lengths = ground, pin - ground, child - pin, child, foot - ground, eye - ground
    if min(map(abs, lengths)) < SAME:
        return None
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
    sense = -1.0
    if math.sin(between_pivots) * per_joint_angle > 0:
        sense = 1.0
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
