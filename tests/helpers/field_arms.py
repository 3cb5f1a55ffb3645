"""Arms as CAD and simulators have them, of which the truth is known: are they taken
rightly by `hydroid init`, or is it said?

All are of one excavator, or a part of it: a swing, a boom, a stick and a bucket in the
plane of x and z, drawn with all joints at 0, stretched along x. Points of the plane are
complex numbers, x + i z [m].
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import robots
import trimesh
from printed import follow
from robots import LIMIT
from truths import judged
from worlds import SECONDS, World, speeds_of, write_log

import hydroid
from hydroid.arm.model import load_model
from hydroid.errors import HydroidError
from hydroid.settings.arm import Arm, load_arm
from hydroid.settings.cylinder import LinearActuator

BOOM, STICK, BUCKET = 0.5 + 0.3j, 3.0 + 0j, 1.8 + 0j
"""joints on house, boom and stick"""
BOOM_FOOT, BOOM_EYE = 0.9 - 0.1j, 1.4 + 0.35j
"""pins of the boom's cylinder, on the house and on the boom"""
STICK_FOOT, STICK_EYE = 1.6 + 0.6j, -0.4 + 0.25j
"""of the stick's, on the boom and on the stick"""
BUCKET_FOOT, ROCKER, COUPLER_END = 0.5 + 0.5j, 1.53 + 0.02j, 0.18 + 0.23j
"""of the bucket's cylinder and its rocker, on the stick; of its coupler on the
bucket"""
ROCKER_LENGTH, COUPLER_LENGTH = 0.45, 0.4
WIDTHS = {"house": 1.0, "boom": 0.5, "stick": 0.35, "bucket": 0.6}
"""of the links' boxes, as high as wide [m]"""
CLOSE_LENGTH = 1e-4
"""error of a cylinder's length [m] up to which it is taken rightly"""
Lengths = Callable[[float], float]


def turned(point: complex, angle: float) -> complex:
    return point * np.exp(1j * angle)


def rocker_pin(angle: float) -> complex:
    """Return where rod, rocker and coupler meet, in the stick's frame: the crossing of
    two circles that lies left of the line between their centres."""
    end = BUCKET + turned(COUPLER_END, angle)
    between = abs(end - ROCKER)
    along = (ROCKER_LENGTH**2 - COUPLER_LENGTH**2 + between**2) / (2 * between)
    across = np.sqrt(ROCKER_LENGTH**2 - along**2)
    return ROCKER + (end - ROCKER) / between * complex(along, across)


LENGTHS: Mapping[str, Lengths] = {
    "boom": lambda q: abs(BOOM + turned(BOOM_EYE, q) - BOOM_FOOT),
    "stick": lambda q: abs(STICK + turned(STICK_EYE, q) - STICK_FOOT),
    "bucket": lambda q: abs(rocker_pin(q) - BUCKET_FOOT),
}
"""of cylinders from pin to pin [m] by the joint's angle [rad]"""


@dataclass(frozen=True)
class Part:
    """A link and how it hangs on another: by a hinge, a slide, or fixed.

    at: place of its joint on the parent. size: of its box, which begins at its joint
    [m]; none: a mere frame. mass: [kg]; None: the file has none. turn: of its frame at
    rest, upwards [rad].
    """

    name: str
    parent: str
    joint: str = ""
    at: complex = 0j
    kind: str = "hinge"
    size: tuple[float, float, float] | None = None
    mass: float | None = None
    limits: tuple[float, float] | None = None
    turn: float = 0.0
    axis: str = "0 -1 0"
    shape: str = ""
    more: str = ""


def link(
    name: str,
    parent: str,
    at: complex,
    length: float,
    mass: float | None,
    limits: tuple[float, float],
    **more: Any,
) -> Part:
    width = WIDTHS.get(name, length / 6)
    size = (length, width, width)
    return Part(
        name, parent, f"{name}_joint", at, size=size, mass=mass, limits=limits, **more
    )


HOUSE = link("house", "base", 1j, 1.5, 1800.0, (-3.0, 3.0), axis="0 0 1")
ARM = (
    HOUSE,
    link("boom", "house", BOOM, 3.0, 450.0, (-0.5, 1.2)),
    link("stick", "boom", STICK, 1.8, 150.0, (-2.2, -0.2)),
    link("bucket", "stick", BUCKET, 0.9, 160.0, (-2.0, 0.6)),
)
MASSES = {part.name: part.mass or 0.0 for part in ARM}
TUBE, ROD, BAR = 40.0, 15.0, 10.0
"""masses of the parts of each cylinder and linkage [kg]"""


def cylinder(name: str, carrier: str, foot: complex, eye: complex) -> tuple[Part, Part]:
    """Return tube and rod from a foot to an eye of the carrier's frame; the rod's frame
    is 0.4 m from the foot."""
    way = eye - foot
    length = abs(way)
    tube = Part(
        f"{name}_tube",
        carrier,
        f"{name}_tube_joint",
        foot,
        size=(0.6 * length, 0.1, 0.1),
        mass=TUBE,
        limits=(-3.0, 3.0),
        turn=float(np.angle(way)),
    )
    rod = Part(
        f"{name}_rod",
        tube.name,
        f"{name}_rod_joint",
        0.4 + 0j,
        "slide",
        size=(length - 0.4, 0.06, 0.06),
        mass=ROD,
        limits=(-1.0, 1.5),
        axis="1 0 0",
    )
    return tube, rod


def frame(name: str, parent: str, at: complex) -> Part:
    return Part(name, parent, f"{name}_fixed", at, "fixed")


def bar(name: str, carrier: str, at: complex, mass: float) -> Part:
    size = (0.5, 0.1, 0.1)
    joint = f"{name}_joint"
    return Part(name, carrier, joint, at, size=size, mass=mass, limits=(-2.0, 2.0))


def bars() -> tuple[Part, Part]:
    """Return the rocker on the stick and the coupler on it, as drawn."""
    pin, end = rocker_pin(0.0), BUCKET + COUPLER_END
    turn = float(np.angle(pin - ROCKER))
    rocker = Part(
        "rocker",
        "stick",
        "rocker_joint",
        ROCKER,
        size=(ROCKER_LENGTH, 0.06, 0.06),
        mass=BAR,
        limits=(-3.0, 3.0),
        turn=turn,
    )
    coupler = Part(
        "coupler",
        "rocker",
        "coupler_joint",
        ROCKER_LENGTH + 0j,
        size=(COUPLER_LENGTH, 0.06, 0.06),
        mass=BAR,
        limits=(-3.0, 3.0),
        turn=float(np.angle(end - pin)) - turn,
    )
    return rocker, coupler


def open_cylinders() -> tuple[Part, ...]:
    """Return tubes and rods of boom and stick, whose rods end nowhere."""
    boom = cylinder("boom", "house", BOOM_FOOT, BOOM + BOOM_EYE)
    return *boom, *cylinder("stick", "boom", STICK_FOOT, STICK + STICK_EYE)


def rod_ends() -> tuple[Part, ...]:
    """Return the frames of the rods' eyes, as drawn."""
    boom, stick = abs(LENGTHS["boom"](0.0)), abs(LENGTHS["stick"](0.0))
    return (
        frame("boom_rod_eye", "boom_rod", boom - 0.4 + 0j),
        frame("stick_rod_eye", "stick_rod", stick - 0.4 + 0j),
    )


def anchors() -> tuple[Part, ...]:
    """Return the frames on boom and stick at which the rods are pinned."""
    return (
        frame("boom_anchor", "boom", BOOM_EYE),
        frame("stick_anchor", "stick", STICK_EYE),
    )


def linkage() -> tuple[Part, ...]:
    """Return the parts of the bucket's cylinder and linkage, whose ends meet as
    drawn."""
    tube, rod = cylinder("bucket", "stick", BUCKET_FOOT, rocker_pin(0.0))
    reach = LENGTHS["bucket"](0.0) - 0.4
    return (
        tube,
        rod,
        *bars(),
        frame("bucket_rod_eye", rod.name, reach + 0j),
        frame("coupler_end", "coupler", COUPLER_LENGTH + 0j),
        frame("bucket_anchor", "bucket", COUPLER_END),
    )


def hinged_rods() -> tuple[Part, ...]:
    """Return tubes that turn on one link and rods that turn on the other, as some
    exporters cut a cylinder."""
    parts = list[Part]()
    for name, carrier, moved, foot, eye in (
        ("boom", "house", "boom", BOOM_FOOT, BOOM_EYE),
        ("stick", "boom", "stick", STICK_FOOT, STICK_EYE),
    ):
        joint = {"boom": BOOM, "stick": STICK}[name]
        tube, rod = cylinder(name, carrier, foot, joint + eye)
        parts += [
            tube,
            replace(
                rod,
                parent=moved,
                at=eye,
                kind="hinge",
                turn=tube.turn + np.pi,
                limits=(-3.0, 3.0),
                axis="0 -1 0",
            ),
        ]
    return tuple(parts)


def urdf(parts: Sequence[Part], folder: Path) -> Path:
    """Write a URDF of parts."""
    text = '<link name="base"/>'
    for part in parts:
        if part.size is None:
            text += f'\n  <link name="{part.name}"/>'
        else:
            x, y, z = part.size
            shape = part.shape or f'<box size="{x} {y} {z}"/>'
            seen = "0 0 0" if part.shape else f"{x / 2} 0 0"
            text += robots.body(part.name, part.size, part.mass, shape, seen=seen)
        kinds = {"hinge": "revolute", "slide": "prismatic", "fixed": "fixed"}
        text += robots.joint(
            part.joint,
            part.parent,
            part.name,
            kind=kinds[part.kind],
            at=f"{part.at.real} 0 {part.at.imag}",
            turn=f"0 {-part.turn} 0",
            axis=part.axis,
            limit=LIMIT.format(*part.limits) + part.more if part.limits else "",
        )
    path = folder / "arm.urdf"
    path.write_text(f'<robot name="machine">{text}</robot>')
    return path


def mjcf(
    parts: Sequence[Part],
    folder: Path,
    sites: Sequence[tuple[str, str, complex]] = (),
    more: str = "",
) -> Path:
    """Write an MJCF of parts, sites (name, body and place), and what comes after."""

    def body(part: Part) -> str:
        inside = ""
        if part.kind != "fixed":
            limits = "" if part.limits is None else 'range="{} {}"'.format(*part.limits)
            inside += f'<joint name="{part.joint}" type="{part.kind}" axis="{part.axis}" {limits}/>'
        if part.size is not None:
            half = " ".join(f"{one / 2}" for one in part.size)
            mass = "" if part.mass is None else f'mass="{part.mass}"'
            inside += (
                f'<geom type="box" size="{half}" pos="{part.size[0] / 2} 0 0" {mass}/>'
            )
        for name, owner, at in sites:
            if owner == part.name:
                inside += f'<site name="{name}" pos="{at.real} 0 {at.imag}"/>'
        inside += "".join(body(one) for one in parts if one.parent == part.name)
        place = f'pos="{part.at.real} 0 {part.at.imag}" euler="0 {-part.turn} 0"'
        return f'<body name="{part.name}" {place} {part.more}>{inside}</body>'

    inside = "".join(body(part) for part in parts if part.parent == "base")
    path = folder / "arm.xml"
    path.write_text(
        f'<mujoco model="machine"><compiler angle="radian"/><worldbody>{inside}</worldbody>'
        f"{more}</mujoco>"
    )
    return path


NAMES = ("house", "boom", "stick", "bucket")
SITES = (
    ("boom_pivot_parent", "house", BOOM_FOOT),
    ("boom_pivot_child", "boom", BOOM_EYE),
    ("stick_pivot_parent", "boom", STICK_FOOT),
    ("stick_pivot_child", "stick", STICK_EYE),
)
LINKAGE_SITES = (
    ("bucket_pivot_parent", "stick", BUCKET_FOOT),
    ("bucket_pivot_rod", "stick", rocker_pin(0.0)),
    ("bucket_pivot_rocker", "stick", ROCKER),
    ("bucket_pivot_child", "bucket", COUPLER_END),
)
LETTERS = tuple(
    (letter, owner, at)
    for letter, (_, owner, at) in zip("EFGH", LINKAGE_SITES, strict=True)
)


@dataclass(frozen=True)
class FieldArm:
    """An arm of one kind: what writes its file, and what must be taken.

    Attributes:
        said: words of the line that must be printed; without these it must be taken
            rightly without a word of doubt.
        masses: of the links that move [kg]; the relative error up to which they are
            taken rightly is `close`. None: nobody can know.
        lengths: of the cylinders that must be known; all other joints have stand-ins.
        links: joints, and the distances between them [m].
        options: of `hydroid.init`.
        log: what writes a log; None: none is given.
    """

    name: str
    write: Callable[[Path], Path] | None
    said: str = ""
    masses: Mapping[str, float] = field(default_factory=lambda: MASSES)
    close: float = 0.01
    lengths: Mapping[str, Lengths] = field(default_factory=dict[str, Lengths])
    joints: Sequence[str] = NAMES
    distances: Sequence[float] = (abs(BOOM), abs(STICK), abs(BUCKET))
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])
    log: Callable[[Path], Path] | None = None


def weighing(mass: Callable[[Part], float | None]) -> tuple[Part, ...]:
    return tuple(replace(part, mass=mass(part)) for part in ARM)


def volume(part: Part) -> float:
    assert part.size is not None
    x, y, z = part.size
    return x * y * z


BOXED = {part.name: 500.0 * volume(part) for part in ARM}
"""what boxes around hollow parts weigh, by the documentation"""


def as_urdf(*parts: Part) -> Callable[[Path], Path]:
    return lambda folder: urdf(parts, folder)


def as_mjcf(*parts: Part, **more: Any) -> Callable[[Path], Path]:
    return lambda folder: mjcf(parts, folder, **more)


def loops(folder: Path) -> Path:
    """Write an MJCF whose cylinders and linkage are closed by constraints."""
    parts = (*ARM, *open_cylinders(), *linkage()[:4])
    ends = {part.name: part.at for part in (*rod_ends(), *linkage()[4:])}
    pairs = (
        ("boom_rod", "boom", "boom_rod_eye"),
        ("stick_rod", "stick", "stick_rod_eye"),
        ("bucket_rod", "rocker", "bucket_rod_eye"),
        ("coupler", "bucket", "coupler_end"),
    )
    closed = ""
    for first, second, end in pairs:
        closed += (
            f'<connect body1="{first}" body2="{second}" anchor="{ends[end].real} 0 0"/>'
        )
    return mjcf(parts, folder, more=f"<equality>{closed}</equality>")


def at_rest(*parts: Part) -> tuple[Part, ...]:
    """Return parts whose tubes and rods are drawn anyhow: the tubes along x, the rods
    as far as they happen to be."""
    return tuple(
        replace(part, turn=0.3) if part.name.endswith("_tube") else part
        for part in parts
    )


FAR = {"boom": 0.8, "stick": -1.5, "bucket": -1.0}
"""angles of a pose [rad] that is far from the one in which all joints are at 0"""


def drawn_far(folder: Path) -> Path:
    """Write an MJCF that is drawn in another pose, whose angles `ref` states."""
    parts = tuple(replace(part, turn=FAR.get(part.name, 0.0)) for part in ARM)
    pin = ("bucket_pivot_rod", "stick", rocker_pin(FAR["bucket"]))
    bars = [pin if site[0] == pin[0] else site for site in LINKAGE_SITES]
    path = mjcf(parts, folder, sites=(*SITES, *bars))
    text = path.read_text()
    for name, angle in FAR.items():
        joint = f'<joint name="{name}_joint"'
        text = text.replace(joint, f'{joint} ref="{angle}"')
    path.write_text(text)
    return path


def cylinders_of_far() -> tuple[Part, ...]:
    """Return tubes, rods and their eyes as they stand in another pose than the links
    are drawn in."""
    parts = list[Part]()
    for name, carrier, joint, foot, eye in (
        ("boom", "house", BOOM, BOOM_FOOT, BOOM_EYE),
        ("stick", "boom", STICK, STICK_FOOT, STICK_EYE),
    ):
        parts += cylinder(name, carrier, foot, joint + turned(eye, FAR[name]))
        reach = LENGTHS[name](FAR[name]) - 0.4
        parts.append(frame(f"{name}_rod_eye", f"{name}_rod", reach + 0j))
    return tuple(parts)


def loops_of_sites(folder: Path, reach: float = 0.0) -> Path:
    """Write an MJCF whose loops are open as drawn: constraints between sites pull them
    together. The boom's rod is longer by `reach` [m]."""
    drawn = (*ARM, *at_rest(*open_cylinders(), *linkage()[:2]), *linkage()[2:4])
    parts = [
        replace(part, turn=part.turn + 0.2) if part.name == "rocker" else part
        for part in drawn
    ]
    ends = {part.name: part.at for part in (*rod_ends(), *linkage()[4:])}
    pairs = (
        ("boom_rod", ends["boom_rod_eye"] + reach, "boom", BOOM_EYE),
        ("stick_rod", ends["stick_rod_eye"], "stick", STICK_EYE),
        ("bucket_rod", ends["bucket_rod_eye"], "rocker", ROCKER_LENGTH + 0j),
        ("coupler", ends["coupler_end"], "bucket", COUPLER_END),
    )
    sites = list[tuple[str, str, complex]]()
    closed = ""
    for first, at, second, place in pairs:
        sites += [(f"{first}_end", first, at), (f"{second}_eye", second, place)]
        closed += f'<connect site1="{first}_end" site2="{second}_eye"/>'
    return mjcf(parts, folder, sites, f"<equality>{closed}</equality>")


def in_pairs(folder: Path, apart: complex = 0j) -> Path:
    """Write an MJCF with two cylinders on the boom and two rockers on the stick, where
    the bucket's rod is pinned to the coupler between them.

    The pins of the boom's second cylinder are `apart` [m] from the first one's.
    """
    left = cylinder("boom_left", "house", BOOM_FOOT, BOOM + BOOM_EYE)
    foot = BOOM_FOOT + apart
    right = cylinder("boom_right", "house", foot, BOOM + BOOM_EYE + apart)
    bucket_tube, bucket_rod, rocker, coupler, *_ = linkage()
    other = replace(rocker, name="other_rocker", joint="other_rocker_joint")
    parts = (*ARM, *left, *right, bucket_tube, bucket_rod, rocker, coupler, other)
    boom = LENGTHS["boom"](0.0) - 0.4
    bucket = LENGTHS["bucket"](0.0) - 0.4
    pairs = (
        ("boom_left_rod", "boom", boom),
        ("boom_right_rod", "boom", boom),
        ("bucket_rod", "coupler", bucket),
        ("other_rocker", "coupler", ROCKER_LENGTH),
        ("coupler", "bucket", COUPLER_LENGTH),
    )
    closed = ""
    for first, second, reach in pairs:
        closed += f'<connect body1="{first}" body2="{second}" anchor="{reach} 0 0"/>'
    return mjcf(parts, folder, more=f"<equality>{closed}</equality>")


def loader(folder: Path) -> Path:
    """Write a loader whose tilt cylinder stands on the chassis and turns a bell crank
    on the boom: six bars."""
    foot, crank = 0.2 + 0.5j, 1.2 + 0.4j
    pin, end = crank + 0.1 + 0.5j, 2.4 + 0.35j
    chassis = Part("chassis", "base", at=1j, kind="fixed", size=(1, 1, 1), mass=3000.0)
    boom = link("boom", "chassis", 0.3 + 0.2j, 2.4, 300.0, (-0.6, 0.8))
    bucket = link("bucket", "boom", 2.4 + 0j, 0.9, 200.0, (-0.8, 0.8))
    tube, rod = cylinder("tilt", "chassis", foot, boom.at + pin)
    bell = bar("bellcrank", "boom", crank, 30.0)
    strut = bar("strut", "bellcrank", 0.1 - 0.4j, 20.0)
    reach = end - crank - strut.at
    eye = abs(boom.at + pin - foot) - 0.4
    closed = (
        f'<connect body1="tilt_rod" body2="bellcrank" anchor="{eye} 0 0"/>'
        f'<connect body1="strut" body2="bucket" anchor="{reach.real} 0 {reach.imag}"/>'
    )
    parts = (chassis, boom, bucket, tube, rod, bell, strut)
    return mjcf(parts, folder, more=f"<equality>{closed}</equality>")


def in_cm(folder: Path) -> Path:
    """Write a URDF of meshes in m, but for the boom's in cm."""
    parts = list[Part]()
    for part in ARM:
        assert part.size is not None
        solid = trimesh.creation.box(part.size)
        solid.apply_translation((part.size[0] / 2, 0, 0))
        solid.apply_scale(100.0 if part.name == "boom" else 1.0)
        file = f"{part.name}.stl"
        (folder / file).write_bytes(solid.export(file_type="stl"))
        parts.append(replace(part, shape=f'<mesh filename="{file}"/>', mass=None))
    return urdf(parts, folder)


def telescope(name: str, parent: str, joint: str, at: complex, mass: float) -> Part:
    size = (1.6, 0.2, 0.2)
    return Part(
        name,
        parent,
        joint,
        at,
        "slide",
        size=size,
        mass=mass,
        limits=(0.0, 1.2),
        axis="1 0 0",
    )


TELESCOPES = (
    *ARM[:3],
    telescope("inner", "stick", "telescope_1", 0.4 + 0j, 60.0),
    telescope("outer", "inner", "telescope_2", 0.3 + 0j, 40.0),
    link("bucket", "outer", 1.5 + 0j, 0.9, 160.0, (-2.0, 0.6)),
)
LONG = ("house", "boom", "stick", "telescope_1", "telescope_2", "bucket")
FINGERS = (
    replace(bar("finger_left", "bucket", 0.9 + 0.2j, 3.0), size=(0.2, 0.05, 0.05)),
    replace(bar("finger_right", "bucket", 0.9 - 0.2j, 3.0), size=(0.2, 0.05, 0.05)),
)
HINGED_ANCHOR = replace(
    bar("bucket_anchor", "bucket", 0.9 + 0j, 5.0), size=(0.1, 0.1, 0.1)
)
LONG_BOOM = (
    HOUSE,
    replace(ARM[1], size=(5.0, 0.45, 0.45), mass=120.0),
    replace(ARM[2], at=5.0 + 0j),
    ARM[3],
)


def lengths_in_cm(folder: Path) -> Path:
    """Write a log of the lengths of cylinders in cm, under names that do not say so."""
    columns = {name: (f"{name}_cmd_V", f"{name}_deg") for name in NAMES}
    limits = {part.name: part.limits or (-1.0, 1.0) for part in ARM}
    moved = [
        (name, "", name, "revolute", (0.0, 0.0, 0.0), "{} {}".format(*limits[name]))
        for name in NAMES
    ]
    path = write_log(World(NAMES, moved, columns), folder / "log.csv")
    head, *rows = path.read_text().splitlines()
    names = [
        name.replace("_deg", "_cyl") if "house" not in name else name
        for name in head.split(",")
    ]
    values = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    for number, name in enumerate(names):
        if name.endswith("_cyl"):
            angle = np.radians(values[:, number])
            length = [LENGTHS[name.removesuffix("_cyl")](one) for one in angle]
            values[:, number] = 1e2 * np.array(length)
    np.savetxt(path, values, "%.6g", ",", header=",".join(names), comments="")
    return path


WITH_ROD_PARTS = MASSES | {
    "house": MASSES["house"] + TUBE + ROD,
    "boom": MASSES["boom"] + TUBE + ROD,
}
BOTH = {name: LENGTHS[name] for name in ("boom", "stick")}
ROD_OF_BUCKET = MASSES | {"stick": 150.0 + TUBE + ROD + 2 * BAR}
HINGED_RODS = MASSES | {
    "house": 1800.0 + TUBE,
    "boom": 450.0 + TUBE + ROD,
    "stick": 150.0 + ROD,
}
TELESCOPE_DISTANCES = (abs(BOOM), abs(STICK), 0.4, 0.3, 1.5)
CHAINED = tuple(
    replace(part, more='<mimic joint="telescope_1"/>') if part.name == "outer" else part
    for part in TELESCOPES
)
IMPOSSIBLE = "MASSES THAT NO MACHINE HAS"
TEMPLATE = {"joints": "swing,boom,arm,bucket", "lengths": "0,3.7,1.6,0.9"}
FIELD_ARMS = (
    FieldArm("sites of the documented names", as_mjcf(*ARM, sites=SITES), lengths=BOTH),
    FieldArm(
        "a four-bar by sites of the documented names",
        as_mjcf(*ARM, sites=SITES + LINKAGE_SITES),
        lengths=LENGTHS,
    ),
    FieldArm(
        "a four-bar by sites E, F, G and H",
        as_mjcf(*ARM, sites=LETTERS),
        said="sites E, F, G and H",
        lengths={"bucket": LENGTHS["bucket"]},
    ),
    FieldArm(
        "cylinders and linkage as loops of an MJCF",
        loops,
        lengths=LENGTHS,
        masses=WITH_ROD_PARTS | {"stick": ROD_OF_BUCKET["stick"]},
    ),
    FieldArm(
        "cylinders and rockers in pairs",
        in_pairs,
        said="two cylinders move it: they are taken for one",
        lengths={name: LENGTHS[name] for name in ("boom", "bucket")},
        masses=MASSES
        | {
            "house": MASSES["house"] + 2 * (TUBE + ROD),
            "stick": ROD_OF_BUCKET["stick"] + BAR,
        },
    ),
    FieldArm(
        "two cylinders of other pins on the boom",
        lambda folder: in_pairs(folder, -0.3 + 0j),
        said="a second cylinder with other pins moves it",
        lengths={name: LENGTHS[name] for name in ("boom", "bucket")},
        masses={"bucket": MASSES["bucket"]},
    ),
    FieldArm(
        "open cylinders whose pins meet as drawn",
        as_urdf(*ARM, *open_cylinders(), *rod_ends(), *anchors()),
        lengths=BOTH,
        masses=WITH_ROD_PARTS,
    ),
    FieldArm(
        "open cylinders whose pins meet at another pose",
        as_urdf(*ARM, *at_rest(*open_cylinders()), *rod_ends(), *anchors()),
        said="meet at another pose than drawn",
        lengths=BOTH,
        masses=WITH_ROD_PARTS,
    ),
    FieldArm(
        "open cylinders with a pin on the rod alone",
        as_urdf(*ARM, *open_cylinders(), *rod_ends()),
        said="taken to be pinned",
        lengths=BOTH,
        masses=WITH_ROD_PARTS,
    ),
    FieldArm(
        "cylinders that stand as in another pose than the links",
        as_urdf(*ARM, *cylinders_of_far(), *anchors()),
        said="meet at another pose than drawn: -85.7 deg of stick_joint",
        lengths=BOTH,
        masses=WITH_ROD_PARTS,
    ),
    FieldArm("drawn far from where angles are 0", drawn_far, lengths=LENGTHS),
    FieldArm(
        "loops of sites that are drawn open",
        loops_of_sites,
        said="moved until they close",
        lengths=LENGTHS,
        masses=WITH_ROD_PARTS | {"stick": ROD_OF_BUCKET["stick"]},
    ),
    FieldArm(
        "a loop among others that closes in no pose",
        lambda folder: loops_of_sites(folder, 9.0),
        said="part of a cylinder that the file pins at one end",
        lengths={name: LENGTHS[name] for name in ("stick", "bucket")},
        masses=WITH_ROD_PARTS | {"stick": ROD_OF_BUCKET["stick"]},
    ),
    FieldArm(
        "open cylinders without a pin",
        as_urdf(*ARM, *open_cylinders()),
        said="part of a cylinder that the file pins at one end",
        masses=WITH_ROD_PARTS,
    ),
    FieldArm(
        "tubes and rods that turn on either link",
        as_urdf(*ARM, *hinged_rods()),
        lengths=BOTH,
        masses=HINGED_RODS,
    ),
    FieldArm(
        "a bucket's linkage as open links",
        as_urdf(*ARM, *linkage()),
        lengths={"bucket": LENGTHS["bucket"]},
        masses=ROD_OF_BUCKET,
    ),
    FieldArm(
        "a loader's tilt linkage of six bars",
        loader,
        said="six bars",
        joints=("boom", "bucket"),
        distances=(2.4,),
        masses={"bucket": 200.0},
    ),
    FieldArm(
        "two telescopes",
        as_urdf(*TELESCOPES),
        joints=LONG,
        distances=TELESCOPE_DISTANCES,
        masses={"inner": 60.0, "outer": 40.0},
    ),
    FieldArm(
        "two telescopes, one on a chain",
        as_urdf(*CHAINED),
        said="following another joint",
        joints=[name for name in LONG if name != "telescope_2"],
        distances=(abs(BOOM), abs(STICK), 0.4, 1.8),
        masses={"inner": 100.0},
    ),
    FieldArm(
        "placeholder masses",
        as_urdf(*weighing(lambda part: 1.0)),
        said=IMPOSSIBLE,
        masses=BOXED,
    ),
    FieldArm(
        "shapes without masses",
        as_mjcf(*weighing(lambda part: None)),
        said="no masses in the file",
        masses=BOXED,
    ),
    FieldArm(
        "links as heavy as water",
        as_urdf(*weighing(lambda part: 1000.0 * volume(part))),
        said="FULL OF WATER",
        masses=BOXED,
    ),
    FieldArm(
        "full boxes of steel",
        as_urdf(*weighing(lambda part: 7850.0 * volume(part))),
        said=IMPOSSIBLE,
        masses=BOXED,
    ),
    FieldArm(
        "a boom in cm beside meshes in m",
        in_cm,
        said="taken to be in cm",
        masses={part.name: 1200.0 * volume(part) for part in ARM},
    ),
    FieldArm(
        "120 kg of boom that is 5 m long",
        as_urdf(*LONG_BOOM),
        said="boom: weighs 120 kg and is 5 m long",
        masses=MASSES | {"boom": 120.0},
        distances=(abs(BOOM), 5.0, abs(BUCKET)),
    ),
    FieldArm(
        "a finger as the tip",
        as_urdf(*ARM, *FINGERS),
        said="held at 0, on no way to its end: finger_left",
        masses=MASSES | {"bucket": 166.0},
    ),
    FieldArm(
        "an anchor as the tip",
        as_urdf(*ARM, HINGED_ANCHOR),
        said="part of a cylinder",
        masses=MASSES | {"bucket": 165.0},
    ),
    FieldArm(
        "gravity compensation",
        as_mjcf(*(replace(part, more='gravcomp="1"') for part in ARM)),
        said="gravity compensation of the file is left out",
    ),
    FieldArm(
        "a template of names and lengths",
        None,
        said="made of boxes of these lengths",
        joints=("swing", "boom", "arm", "bucket"),
        masses={},
        distances=(0.0, 3.7, 1.6),
        options=TEMPLATE,
    ),
    FieldArm(
        "lengths in cm beside an arm without cylinders",
        as_urdf(*ARM),
        said="lengths of cylinders whose pivots are not known",
        log=lengths_in_cm,
    ),
)


@dataclass(frozen=True)
class Outcome:
    """What became of an arm: "right", "said" in one line, "refused", or "wrong" in
    silence; and the line, or what is wrong."""

    verdict: str
    line: str = ""


def outcome(arm: FieldArm, folder: Path) -> Outcome:
    """Write an arm, give it to `init`, and compare what is taken with the truth.

    An arm of which something must be said is wrong, too, if what is done is not what is
    true.
    """
    robot = arm.write(folder) if arm.write else None
    log = arm.log(folder) if arm.log else None
    try:
        result = hydroid.init(folder / "mine", arm=robot, log=log, **arm.options)
        taken = load_arm(folder / "mine" / "arm.yaml")
    except HydroidError as error:
        return Outcome("refused", str(error))
    lines = [str(line).strip() for line in result.lines]
    told = next((line for line in lines if arm.said and arm.said in line), "")
    fault = next(iter(faults(arm, taken)), "")
    if fault:
        return Outcome("wrong", fault)
    if arm.said and not told:
        return Outcome("wrong", f"nobody says {arm.said!r}")
    return Outcome("said" if told else "right", told)


def followed(arm: FieldArm, folder: Path, budget: str) -> Outcome:
    """Write an arm that is taken as it should be and two logs of it, and follow the
    commands that `init` prints: check, a fit of a budget, and validation on the second.

    Right: the fit predicts the second log and has the joints' speeds.
    """
    found = outcome(arm, folder)
    if found.verdict not in ("right", "said"):
        return found
    taken = load_arm(folder / "mine" / "arm.yaml")
    names = [name.removesuffix("_joint") for name in taken.joint_names]
    columns = dict[str, tuple[str, str]]()
    parts = list[Any]()
    for number, (name, ends) in enumerate(
        zip(names, taken.ranges.values(), strict=True), 1
    ):
        unit = "m" if number in taken.slides else "deg"
        columns[name] = (f"{name}_cmd_V", f"{name}_{unit}")
        parts.append((name, "", name, "", (0.0, 0.0, 0.0), "{} {}".format(*ends)))
    world = World(names, parts, columns)
    write_log(world, folder / "log.csv", SECONDS, 1)
    write_log(world, folder / "other.csv", SECONDS, 2)
    words = ["followed", "--log", "log.csv"]
    for option, value in arm.options.items():
        words += [f"--{option}", str(value)]
    for robot in (*folder.glob("arm.urdf"), *folder.glob("arm.xml")):
        words += ["--arm", robot.name]
    ended = follow(folder, words, "other.csv", budget)
    speeds = dict(zip(taken.joint_names, speeds_of(world).values(), strict=True))
    ended = judged(ended, speeds)
    return Outcome(ended.verdict, ended.line)


def faults(arm: FieldArm, taken: Arm) -> list[str]:
    """Return what an arm that was taken has not as the truth."""
    names = [name.removesuffix("_joint") for name in taken.joint_names]
    if names != [*arm.joints]:
        return [f"joints {names}"]
    return [
        *_of_masses(arm, taken),
        *_of_distances(arm, taken),
        *_of_lengths(arm, taken),
    ]


def _of_masses(arm: FieldArm, taken: Arm) -> list[str]:
    return [
        f"{name} weighs {taken.mass_of[name]:.4g} instead of {mass:.4g} kg"
        for name, mass in arm.masses.items()
        if abs(taken.mass_of[name] / mass - 1) > arm.close
    ]


def _of_distances(arm: FieldArm, taken: Arm) -> list[str]:
    model = load_model(taken).compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = np.linalg.norm(np.diff(data.xanchor, axis=0), axis=1)
    if np.allclose(found, arm.distances, atol=1e-6):
        return []
    return [f"distances {found.round(4).tolist()}"]


def _of_lengths(arm: FieldArm, taken: Arm) -> list[str]:
    wrong = list[str]()
    for joint in taken.joints:
        name = joint.name.removesuffix("_joint")
        pinned = isinstance(joint.actuator, LinearActuator) and not joint.slides
        length = arm.lengths.get(name)
        if pinned != (length is not None):
            wrong.append(f"{name} has {'a' if pinned else 'no'} cylinder")
        elif length is not None and isinstance(joint.actuator, LinearActuator):
            angles = np.linspace(*joint.limits, 9)
            true = np.array([length(angle) for angle in angles])
            error = np.abs(joint.actuator.length(angles) - true).max()
            if not error < CLOSE_LENGTH:
                wrong.append(f"{name}: its cylinder's length errs by {error:.3g} m")
    return wrong
