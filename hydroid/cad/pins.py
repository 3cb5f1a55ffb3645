"""Where bodies of a robot's file turn on each other: by hinges, by constraints, and
where the ends of open cylinders meet.

A URDF cannot close loops. Its cylinders are open chains: a tube that turns on one link,
a rod that slides in it, and frames that show where the rod is pinned. Or the tube turns
on one link, the rod on the other, and nothing says that one slides in the other.
"""

import re
from collections.abc import Collection, Iterator, Sequence
from itertools import chain, combinations
from typing import Any

import mujoco
import numpy as np

from hydroid.arrays import Array, record
from hydroid.cad.loops import SAME
from hydroid.cad.source import Notes

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
PINS = {"eye", "pin", "end", "mount", "pivot", "link", "joint", "frame"}
"""words in the names of frames at which rods are pinned"""


@record
class Pin:
    """Where two bodies turn on each other [m], shape (3,), in the file's pose; `joint`
    None: an equality."""

    bodies: tuple[str, str]
    at: Array
    joint: Any = None

    def other(self, body: str) -> str:
        """Return the body that a body turns on here."""
        return self.bodies[self.bodies[0] == body]


def is_part_of_cylinder(joint: mujoco.MjsJoint) -> bool:
    """Return whether the names of a joint and its link tell a cylinder's tube or rod,
    which moves no link."""
    for name in (joint.name, joint.parent.name):
        if not PARTS.intersection(re.split(r"[\W_\d]+", name.lower())):
            return False
    return True


def ends_of(spec: mujoco.MjSpec, constraint: Any) -> tuple[str, str]:
    """Return the names of the two bodies, or joints, that a constraint ties to each
    other."""
    ends = (constraint.name1, constraint.name2)
    if constraint.objtype == mujoco.mjtObj.mjOBJ_SITE:
        ends = tuple(spec.site(name).parent.name for name in ends)
    return ends[0], ends[1] or "world"


def pins_of(spec: mujoco.MjSpec, data: mujoco.MjData) -> list[Pin]:
    """Return where bodies turn on each other: hinges and points that equalities
    connect."""
    pins = list[Pin]()
    for joint in spec.joints:
        if joint.type == mujoco.mjtJoint.mjJNT_HINGE:
            bodies = (joint.parent.name, joint.parent.parent.name)
            pins.append(Pin(bodies, data.joint(joint.name).xanchor, joint))
    for equality in spec.equalities:
        if equality.type != mujoco.mjtEq.mjEQ_CONNECT:
            continue
        if equality.objtype == mujoco.mjtObj.mjOBJ_SITE:
            at = data.site(equality.name1).xpos
            # a loop that closes at no pose shows no pin
            if np.linalg.norm(data.site(equality.name2).xpos - at) > SAME:
                continue
        else:
            body = data.body(equality.name1)
            frame = body.xmat.reshape(3, 3)
            # the anchor stands in the first body's frame
            at = body.xpos + frame @ np.array(equality.data[:3])
        pins.append(Pin(ends_of(spec, equality), at))
    return pins


def pins_at(pins: Sequence[Pin], body: str, *without: str) -> list[Pin]:
    """Return the pins of a body, but for those to some other bodies."""
    return [
        pin for pin in pins if body in pin.bodies and pin.other(body) not in without
    ]


def sliding_rods(spec: mujoco.MjSpec) -> Iterator[tuple[str, str]]:
    """Yield tubes and the rods that slide in them."""
    for joint in spec.joints:
        if joint.type == mujoco.mjtJoint.mjJNT_SLIDE:
            yield joint.parent.parent.name, joint.parent.name


def hinged_rods(spec: mujoco.MjSpec) -> Iterator[tuple[str, str]]:
    """Yield tubes and rods of one name, such as boom_tube and boom_rod, that turn on two
    links and carry nothing: one slides in the other."""
    by_name = dict[frozenset[str], list[Any]]()
    for joint in spec.joints:
        is_hinge = joint.type == mujoco.mjtJoint.mjJNT_HINGE
        carries = len(joint.parent.find_all("joint")) > 1
        if is_hinge and not carries and is_part_of_cylinder(joint):
            name = frozenset(_other_words(joint.parent.name))
            by_name.setdefault(name, []).append(joint.parent)
    for bodies in by_name.values():
        if len(bodies) != 2:
            continue
        first, second = bodies
        # on one link they would be a pair of cylinders
        if first.parent.name != second.parent.name:
            yield first.name, second.name


def _other_words(name: str) -> set[str]:
    """Return the words of a name but for those of a cylinder's parts and pins."""
    return {*re.split(r"[\W_]+", name.lower())} - PARTS - PINS - {""}


def closed_pins(
    spec: mujoco.MjSpec,
    pins: Sequence[Pin],
    cylinders: Sequence[tuple[str, str]],
    data: mujoco.MjData,
    notes: Notes,
) -> list[Pin]:
    """Return where the ends of open chains meet: as drawn, or else at another pose.

    `cylinders` are tubes and rods. A rod whose end meets nothing is pinned to the frame
    that is named as the rod is, or, without one, where it is drawn.
    """
    frames = _frames(spec, data)
    closed = [*_meeting(frames, pins)]
    cylinder_parts = {*chain.from_iterable(cylinders)}
    for tube, rod in cylinders:
        feet = pins_at(pins, tube, rod)
        heads = pins_at([*pins, *closed], rod, tube)
        is_loose = len(feet) == 1 and not heads
        # a telescope with a tool is no cylinder
        if not is_loose or not is_part_of_cylinder(spec.body(rod).joints[0]):
            continue
        carrier = feet[0].other(tube)
        links = _links_on(carrier, pins, cylinder_parts)
        loose = _LooseRod(rod, feet[0], carrier, links, frames)
        pin = _pin_at_another_pose(loose, data, notes)
        if pin is None:
            pin = _pin_as_drawn(loose, spec, notes)
        if pin is not None:
            closed.append(pin)
    return closed


def _links_on(
    carrier: str, pins: Sequence[Pin], cylinder_parts: Collection[str]
) -> dict[str, Any]:
    """Return the links that turn on a body, each with its joint, without tubes and
    rods."""
    joints = dict[str, Any]()
    for pin in pins_at(pins, carrier):
        link = pin.other(carrier)
        if pin.joint and link not in cylinder_parts:
            joints[link] = pin.joint
    return joints


def _pin_at_another_pose(
    loose: "_LooseRod", data: mujoco.MjData, notes: Notes
) -> Pin | None:
    """Return the pin of a loose rod to the one frame that is named as the rod is."""
    anchors = loose.anchors
    if len(anchors) != 1:
        return None
    (anchor,) = anchors
    pose = ""
    if ends := loose.ends:
        joint = data.joint(loose.links[anchor.owner].name)
        pose = _pose(joint, loose.foot, anchor, ends[0])
    what = f"its pin and {anchor.name} meet at another pose than drawn{pose}"
    notes.add(what, loose.rod)
    return Pin((loose.rod, anchor.owner), anchor.at)


def _pin_as_drawn(loose: "_LooseRod", spec: mujoco.MjSpec, notes: Notes) -> Pin | None:
    """Return the pin of a loose rod to the one link that its carrier carries, where the
    rod's one end is drawn."""
    # several frames of the rod's name leave open to which of them it is pinned
    if loose.anchors:
        return None
    carried = {body.name for body in spec.body(loose.carrier).bodies}
    below = [link for link in loose.links if link in carried]
    ends = loose.ends
    if len(ends) != 1 or len(below) != 1:
        return None
    what = f"the rod's end {ends[0].name} meets no other pin: taken to be pinned to"
    notes.add(f"{what} {below[0]} where it is drawn. Compare arm.png", loose.rod)
    return Pin((loose.rod, below[0]), ends[0].at)


def _pose(joint: Any, foot: Pin, anchor: "_Frame", end: "_Frame") -> str:
    """Return at which angle of a joint an anchor is as far from a foot as the rod's end
    is drawn; empty: at none."""
    reach = float(np.linalg.norm(end.at - foot.at))
    angles = np.linspace(-np.pi, np.pi, 3601)
    axis = joint.xaxis
    arm = anchor.at - joint.xanchor
    along = axis * (axis @ arm)
    sine = np.sin(angles)[:, None]
    cosine = np.cos(angles)[:, None]
    turned = along + cosine * (arm - along) + sine * np.cross(axis, arm)
    lengths = np.linalg.norm(joint.xanchor + turned - foot.at, axis=1)
    errors = np.abs(lengths - reach)
    # of the two angles the one nearer to the drawn pose
    meeting = angles[errors < SAME]
    if not len(meeting):
        return ""
    nearest = meeting[np.argmin(np.abs(meeting))]
    return f": {np.degrees(nearest):.3g} deg of {joint.name}"


@record
class _Frame:
    """A body that nothing but a place tells, the moving body that it is fixed to, and
    where it is [m], shape (3,)."""

    name: str
    owner: str
    at: Array


@record
class _LooseRod:
    """A rod that slides in its tube and whose other end meets nothing.

    `foot` is where its tube turns on its `carrier`, `links` turn on the carrier by
    their joints, and `frames` are those of the whole file.
    """

    rod: str
    foot: Pin
    carrier: str
    links: dict[str, Any]
    frames: Sequence[_Frame]

    @property
    def ends(self) -> list[_Frame]:
        """The rod's own frames: where it may be pinned."""
        return [frame for frame in self.frames if frame.owner == self.rod]

    @property
    def anchors(self) -> list[_Frame]:
        """The frames of other links that are named as the rod is."""
        words = _other_words(self.rod)
        return [
            frame
            for frame in self.frames
            if frame.owner in self.links and _other_words(frame.name) == words
        ]


def _frames(spec: mujoco.MjSpec, data: mujoco.MjData) -> list[_Frame]:
    """Return the bodies that no joint moves against their parent and that carry
    nothing."""
    frames = list[_Frame]()
    for body in spec.bodies[1:]:
        if body.joints or body.bodies:
            continue
        owner = body.parent
        while not owner.joints and owner.name != "world":
            owner = owner.parent
        place = data.body(body.name).xpos.copy()
        frames.append(_Frame(body.name, owner.name, place))
    return frames


def _meeting(frames: Sequence[_Frame], pins: Sequence[Pin]) -> Iterator[Pin]:
    """Yield where frames of two bodies meet, or a frame and a hinge of two others."""
    for first, second in combinations(frames, 2):
        apart = first.owner != second.owner
        if apart and np.linalg.norm(first.at - second.at) < SAME:
            yield Pin((first.owner, second.owner), first.at)
    for frame in frames:
        for pin in pins:
            apart = frame.owner not in pin.bodies
            if apart and np.linalg.norm(frame.at - pin.at) < SAME:
                for body in pin.bodies:
                    yield Pin((frame.owner, body), pin.at)
