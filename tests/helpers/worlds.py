"""Twelve arms as the world has them, each with a log: URDFs and MJCFs that `hydroid
init` must take."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import trimesh
from arms import MODELS
from printed import Known, follow
from robots import LIMIT, body, joint
from truths import Speed, judged

Joint = tuple[str, str, str, str, tuple[float, float, float], str]
"""joint, parent, child, kind, place on the parent [m], and limits"""
SWING: Joint = ("swing", "base", "house", "revolute", (0, 0, 1), "-3 3")
BOOM: Joint = ("boom", "house", "boom_link", "revolute", (0.5, 0, 0.3), "-0.5 1.2")
STICK: Joint = ("stick", "boom_link", "stick_link", "revolute", (3, 0, 0), "-2.2 -0.2")
BUCKET: Joint = (
    "bucket",
    "stick_link",
    "bucket_link",
    "revolute",
    (1.8, 0, 0),
    "-2 0.6",
)
TELESCOPE: Joint = (
    "telescope",
    "stick_link",
    "telescope_link",
    "prismatic",
    (0.4, 0, 0),
    "0 1.4",
)
TOOL: Joint = (
    "bucket",
    "telescope_link",
    "bucket_link",
    "revolute",
    (1.8, 0, 0),
    "-2 0.6",
)
SIZES = {
    "house": 1.5,
    "boom_link": 3.0,
    "stick_link": 1.8,
    "telescope_link": 1.8,
    "bucket_link": 0.9,
}
SIZES |= {"turret": 0.6, "mast": 2.0, "jib": 1.5}
"""length of the links [m]; they are a fifth as wide and high"""
EXCAVATOR = (SWING, BOOM, STICK, BUCKET)
CRANE = (SWING, BOOM, STICK, TELESCOPE, TOOL)
AXES = {"house": "0 0 1", "turret": "0 0 1", "telescope_link": "1 0 0"}
"""of the joints that move these links; all others lift"""


@dataclass(frozen=True)
class World:
    """One arm and its log.

    joints: that the import must find, in order. columns: of commands and positions in
    the log, by joint. density: of the links in the file [kg/m³]; None: they have no
    masses. shape: of a link's geometry. more: of the URDF. said: beginnings of lines
    that must be printed.
    """

    joints: Sequence[str]
    parts: Sequence[Joint]
    columns: Mapping[str, tuple[str, str]]
    density: float | None = 1200.0
    shape: str = '<box size="{0} {1} {1}"/>'
    more: str = ""
    said: Sequence[str] = ()
    write: Callable[["World", Path], Path] = field(
        default=lambda world, folder: urdf(world, folder)
    )


def named(*joints: str, pattern: str = "{}_cmd_V {}_deg") -> dict[str, tuple[str, str]]:
    command, angle = pattern.split()
    units = {"telescope": angle.replace("deg", "m")}
    return {
        joint: (command.format(joint), units.get(joint, angle).format(joint))
        for joint in joints
    }


def urdf(world: World, folder: Path) -> Path:
    text = '<link name="base"/>'
    for name, parent, child, kind, at, limits in world.parts:
        length = SIZES.get(child, 0.6)
        mass = None if world.density is None else world.density * length**3 / 25
        shape = world.shape.format(length, length / 5, child)
        text += body(
            child,
            (length, length / 5, length / 5),
            mass,
            shape,
            seen=f"{length / 2} 0 0",
        )
        how = {
            "kind": kind,
            "at": " ".join(map(str, at)),
            "axis": AXES.get(child, "0 -1 0"),
        }
        limit = LIMIT.format(*limits.split()) if limits else ""
        text += joint(name, parent, child, limit=limit, **how)
        solid = trimesh.creation.box((1e3 * length, 200 * length, 200 * length))
        if "mm_" in world.shape:
            (folder / f"mm_{child}.stl").write_bytes(solid.export(file_type="stl"))
    path = folder / "robot.urdf"
    path.write_text(f'<robot name="machine">{text}{world.more}</robot>')
    return path


def mjcf(world: World, folder: Path) -> Path:
    """Copy an MJCF of the crane with an include, a missing texture, a plugin and a
    sensor."""
    for name in ("looks.xml", "machine.xml"):
        (folder / name).write_bytes((MODELS / name).read_bytes())
    return folder / "machine.xml"


def _legs() -> tuple[Joint, ...]:
    parts: list[Joint] = []
    for side in ("fl", "fr"):
        above = "base"
        for name in ("swivel", "stabilizer", "steering", "wheel", "hub"):
            parts.append(
                (
                    f"{name}_{side}",
                    above,
                    f"{name}_{side}_link",
                    "revolute",
                    (0.4, 0, 0),
                    "-1 1",
                )
            )
            above = f"{name}_{side}_link"
    return tuple(parts)


TUBE: Joint = (
    "boom_tube",
    "house",
    "boom_tube_link",
    "revolute",
    (0.6, 0, -0.2),
    "-1 1",
)
ROD: Joint = (
    "boom_rod",
    "boom_tube_link",
    "boom_rod_link",
    "prismatic",
    (0.3, 0, 0),
    "0 0.8",
)
NAMES, LONG = (
    ("swing", "boom", "stick", "bucket"),
    ("swing", "boom", "stick", "telescope", "bucket"),
)
MIMIC = (
    '<link name="lever"/><joint name="lever_joint" type="revolute"><parent link="stick_link"/>'
    '<child link="lever"/><limit lower="-1" upper="1" effort="1" velocity="1"/><mimic joint="bucket"/>'
    "</joint>"
)
HEAVY, NONE = (
    "MASSES THAT NO MACHINE HAS [kg]: house",
    "no masses in the file [kg]: house",
)
WORLDS = {
    "as CAD should be": World(NAMES, EXCAVATOR, named(*NAMES)),
    "a simulator's default masses": World(NAMES, EXCAVATOR, named(*NAMES), density=0.05, said=[HEAVY]),
    "no masses": World(NAMES, EXCAVATOR, named(*NAMES), density=None, said=[NONE]),
    "no masses, lost meshes": World(
        NAMES, EXCAVATOR, named(*NAMES), None, '<mesh filename="package://x/{2}.dae"/>',
        said=["mesh package://x/house.dae, mesh", NONE],
    ),
    "meshes in mm": World(
        NAMES, EXCAVATOR, named(*NAMES), shape='<mesh filename="mm_{2}.stl"/>', said=["meshes up to 3000 m"],
    ),
    "a crane with a telescope": World(LONG, CRANE, named(*LONG)),
    "a forwarder, joints by number": World(
        LONG, CRANE, {name: (f"u{k}", f"q{k}{'_m' if k == 4 else ''}") for k, name in enumerate(LONG, 1)},
    ),
    "legs longer than the arm": World(
        LONG, (*_legs(), *CRANE), named(*LONG), said=["the arm is swing - boom - stick - telescope - bucket"],
    ),
    "cylinders as open links": World(
        NAMES, (*EXCAVATOR, TUBE, ROD), named(*NAMES), said=["boom_tube and boom_rod: part of a cylinder"],
    ),
    "an MJCF with textures and plugins": World(LONG, CRANE, named(*LONG), write=mjcf),
    "continuous swing, a mimic, other words": World(
        NAMES, (("swing", "base", "house", "continuous", (0, 0, 1), ""), BOOM, STICK, BUCKET),
        {
            "stick": ("dipper joystick [V]", "dipper angle [deg]"),
            "swing": ("slew joystick [V]", "slew angle [deg]"),
            "bucket": ("tool joystick [V]", "tool angle [deg]"),
            "boom": ("boom joystick [V]", "boom angle [deg]"),
        },
        more=MIMIC, said=["lever_joint: following another joint", "swing: without limits"],
    ),
    "columns by the names of links": World(
        ("j1", "j2", "j3"),
        (
            ("j1", "base", "turret", "revolute", (0, 0, 1), "-3 3"),
            ("j2", "turret", "mast", "revolute", (0.5, 0, 0.3), "-0.5 1.2"),
            ("j3", "mast", "jib", "revolute", (2.0, 0, 0), "-2.2 -0.2"),
        ),
        {"j3": ("jib_cmd", "jib_deg"), "j1": ("turret_cmd", "turret_deg"), "j2": ("mast_cmd", "mast_deg")},
    ),
}  # fmt: skip


NOISE_DEG, NOISE_M = 0.05, 0.001
"""of the angles and places in a log"""
STEP = 0.005
"""of the machine's simulation [s]"""
SECONDS = 40.0
"""duration of a log that is followed"""


@dataclass(frozen=True)
class Valves:
    """How the joints of a world follow their commands, in the order of its columns.

    Attributes:
        limits: from where to where each can go [rad, m], shape (J, 2).
        dead: bands [%], of commands above and below 0, shape (J, 2), as the next two.
        exponent: of the command beyond.
        full: speeds [rad/s, m/s].
        delay: before the valve [s], shape (J,).
        lag: behind it [s], shape (J,).
    """

    limits: np.ndarray
    dead: np.ndarray
    exponent: np.ndarray
    full: np.ndarray
    delay: np.ndarray
    lag: np.ndarray

    def speed(self, u: np.ndarray) -> np.ndarray:
        """Return the speeds that commands [%], shape (J,), settle at [rad/s, m/s]."""
        each = np.arange(len(u))
        side = (u < 0).astype(int)
        dead = self.dead[each, side]
        beyond = np.maximum(np.abs(u) - dead, 0) / (100 - dead)
        return np.sign(u) * beyond ** self.exponent[each, side] * self.full[each, side]


def valves_of(world: World) -> Valves:
    """Return the valves of a world's machine."""
    rng = np.random.default_rng(3)
    given = {name: limits or "-1 1" for name, *_, limits in world.parts}
    limits = np.array([[*map(float, given[name].split())] for name in world.columns])
    both = limits.shape
    return Valves(
        limits,
        dead=rng.uniform(5, 35, both),
        exponent=rng.uniform(1, 2.2, both),
        full=np.ptp(limits, axis=1)[:, None] / rng.uniform(5, 12, both),
        delay=STEP * np.round(rng.uniform(0.05, 0.3, both[0]) / STEP),
        lag=rng.uniform(0.03, 0.2, both[0]),
    )


def speeds_of(world: World) -> dict[str, Speed]:
    """Return the speeds that commands [%] of the joints settle at [deg/s, mm/s]."""
    valves = valves_of(world)
    speeds = dict[str, Speed]()
    for number, name in enumerate(world.columns):
        slides = world.columns[name][1].endswith("_m")

        def speed(
            u: float,
            number: int = number,
            factor: float = 1e3 if slides else 180 / np.pi,
        ) -> float:
            every = np.full(len(valves.lag), u)
            return float(factor * valves.speed(every)[number])

        speeds[name] = speed
    return speeds


def write_log(world: World, path: Path, seconds: float = 30.0, number: int = 0) -> Path:
    """Write a log of the world's columns, in the order of `columns`, as a person drives
    the machine.

    Its valves are of their own equations: each joint has a dead band, an exponent and a
    full speed in each direction, a lag behind the valve, a delay, and no load that
    slows it. `number` is that of the log.
    """
    valves = valves_of(world)
    drive = np.random.default_rng([3, number])
    low, high = valves.limits.T
    late = np.round(valves.delay / STEP).astype(int)
    joints, every = len(low), 4
    steps, each = round(seconds / STEP), np.arange(joints)
    command, place = np.zeros((steps, joints)), np.empty((steps, joints))
    now = low + (high - low) * drive.uniform(0.3, 0.7, joints)
    speed, until = np.zeros(joints), np.ones(joints)
    for k in range(steps):
        command[k] = command[k - 1]
        # a sample shows each change
        for j in np.flatnonzero(until <= k * STEP) if k % every == 0 else ():
            until[j] += drive.uniform(0.5, 3)
            part = (now[j] - low[j]) / (high[j] - low[j])
            way = -1 if part > 0.7 else 1 if part < 0.3 else drive.choice([-1, 1])
            command[k, j] = way * drive.uniform(40, 100) * (drive.random() < 0.7)
        u = command[k - late, each] * (k >= late)
        speed += STEP / valves.lag * (valves.speed(u) - speed)
        now = np.clip(now + STEP * speed, low, high)
        place[k] = now
    columns = {"time_s": np.arange(0, seconds, every * STEP)[: len(place[::every])]}
    names = world.columns.values()
    columns |= {
        c: u / 10 if "V" in c else u
        for (c, _), u in zip(names, command[::every].T, strict=True)
    }
    for (_, angle), q in zip(names, place[::every].T, strict=True):
        noise = drive.normal(size=len(q))
        columns[angle] = (
            q + NOISE_M * noise
            if angle.endswith("_m")
            else np.degrees(q) + NOISE_DEG * noise
        )
    text = ",".join(columns)
    np.savetxt(
        path,
        np.stack([*columns.values()], axis=1),
        "%.6g",
        ",",
        header=text,
        comments="",
    )
    return path


def followed(
    world: World, folder: Path, budget: str, known: Known | None = None
) -> tuple[str, str]:
    """Write an arm and two logs, and follow the commands that `init` prints, validated
    on the second log.

    Returns the outcome, and unseen errors (and those of standing still) [deg, mm], or why
    it was refused. What is `known` is not fitted again.
    """
    robot = world.write(world, folder)
    write_log(world, folder / "log.csv", SECONDS, 1)
    write_log(world, folder / "other.csv", SECONDS, 2)
    words = ["mine", "--arm", robot.name, "--log", "log.csv"]
    found = follow(folder, words, "other.csv", budget, known)
    found = judged(found, speeds_of(world))
    return found.verdict, found.line
