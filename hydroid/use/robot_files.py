"""A fitted arm for other programs: the user's own URDF with the fit's masses, and an
MJCF that moves.

Plain MuJoCo has no hydraulics. Its model gets a velocity actuator on each joint, and a
loop of some twenty lines beside it sets their speeds from a table: settled speeds
against command and angle, late by delay and lags. `README.txt` says what that leaves
out.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from xml.etree.ElementTree import Element

import mujoco
import numpy as np

from hydroid.arrays import Array
from hydroid.errors import ModelError
from hydroid.files import csv_text, fill_template, write_atomic
from hydroid.log.mapping import map_signals
from hydroid.mjcf import mjcf_text
from hydroid.plant import Plant
from hydroid.robot_xml import read_robot
from hydroid.use.follow import joint_lags
from hydroid.use.tables import COMMANDS, speeds_alone

ANGLES = 15
"""of a joint in its table of speeds"""
SERVO = 500.0
"""rate at which a velocity actuator takes up an error [1/s]"""
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_LINK = re.compile(
    r"""<link\b((?:[^>"']|"[^"]*"|'[^']*')*?)(?:/>|>.*?</link\s*>)""", re.DOTALL
)
_NAME = re.compile(r"""\bname\s*=\s*(["'])(.*?)\1""", re.DOTALL)
_MASS = re.compile(r"<mass\b[^>]*>")
_INERTIA = re.compile(r"<inertia\b[^>]*>")
_NUMBER = re.compile(r"""(\b(?:value|i[xyz]{2})\s*=\s*["'])([^"']*)""")


def fitted_urdf(plant: Plant, robot: Path) -> tuple[str, list[str]]:
    """Return a URDF with the masses of a fit, and the links of the arm of which it
    states no mass.

    A link of the arm may be several of the file, which are fixed to each other or held.
    Masses and inertias of all of them are scaled alike, as if their shapes stayed and
    their density changed. All other text stays as it is.

    Raises:
        ModelError: the file cannot be read, is no URDF, or has none of the arm's links
            with a mass.
    """
    root = read_robot(robot)
    text = _urdf_text(root, robot)
    names = plant.identified.settings.arm.link_names
    owners = _owners(root, names)
    stated = dict.fromkeys(names, 0.0)
    for link in root.iter("link"):
        owner = owners.get(link.get("name", ""))
        if owner:
            stated[owner] += _mass_of(link)
    factors = dict[str, float]()
    for name, mass in zip(names, plant.masses.tolist(), strict=True):
        if stated[name] > 0.0:
            factors[name] = mass / stated[name]
    if not factors:
        raise ModelError(f"has none of the links {', '.join(names)} with a mass", robot)
    # a link that was commented out is none
    plain = _COMMENT.sub(lambda part: " " * len(part[0]), text)
    # from the end, so that places before it stay
    for block in reversed([*_LINK.finditer(plain)]):
        named = _NAME.search(block[1])
        factor = None
        if named:
            factor = factors.get(owners.get(named[2], ""))
        if factor is not None:
            text = _reweighed(text, plain, block.span(), factor)
    return text, [name for name in names if name not in factors]


def _urdf_text(root: Element, robot: Path) -> str:
    """Return the text of a file whose root this is, if it is a URDF."""
    if root.tag != "robot":
        raise ModelError("is no URDF", robot, "name the URDF that hydroid init read")
    try:
        return robot.read_bytes().decode("utf-8")
    except UnicodeDecodeError:
        raise ModelError("is not UTF-8", robot, "save it as UTF-8") from None


def _owners(root: Element, names: Sequence[str]) -> dict[str, str]:
    """Return the link of the arm that each link of a URDF is a part of; those of the
    base are of none."""
    parents = dict[str, str]()
    for joint in root.iter("joint"):
        parent = joint.find("parent")
        child = joint.find("child")
        if parent is not None and child is not None:
            parents[child.get("link", "")] = parent.get("link", "")
    owners = dict[str, str]()
    for link in root.iter("link"):
        name = link.get("name", "")
        owner = name
        while owner and owner not in names:
            owner = parents.get(owner, "")
        if owner:
            owners[name] = owner
    return owners


def _mass_of(link: Element) -> float:
    """Return the mass that a link states [kg]; 0 where it states none."""
    mass = link.find("inertial/mass")
    if mass is None:
        return 0.0
    return float(mass.get("value", "0"))


def _reweighed(text: str, plain: str, span: tuple[int, int], factor: float) -> str:
    """Return a text in which the mass and the inertia of the link at a span are scaled;
    `plain` is the text without its comments."""
    found = [pattern.search(plain, *span) for pattern in (_MASS, _INERTIA)]
    parts = [part for part in found if part is not None]
    # from the end, so that places before it stay
    for part in sorted(parts, key=lambda part: -part.start()):
        scaled = _NUMBER.sub(
            lambda one: f"{one[1]}{factor * float(one[2]):.9g}", part[0]
        )
        text = text[: part.start()] + scaled + text[part.end() :]
    return text


def write_moving(plant: Plant, folder: Path) -> list[Path]:
    """Write a plant, and beside it the model that plain MuJoCo steps; return the files
    to begin with.

    Of stage 1 that is the MJCF whose motors take the command, which `Plant.save`
    writes.

    Raises:
        RunError: the folder cannot be written.
    """
    plant.save(folder)
    model = folder / "model"
    if plant.identified.settings.stage == "mech":
        return [model / "fitted.xml", model / "README.txt"]
    spec = mujoco.MjSpec.from_file(str(model / "mechanics.xml"))
    inertia = spec.compile().dof_M0
    for body in spec.bodies[1:]:
        body.gravcomp = 1.0
    for joint, joint_inertia in zip(spec.joints, inertia.tolist(), strict=True):
        # speeds are those of the table: what would slow the joint is in them already
        joint.damping = [0.0] * 3
        joint.stiffness = [0.0] * 3
        joint.frictionloss = 0.0
        motor = spec.add_actuator(
            name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT
        )
        motor.set_to_velocity(kv=SERVO * joint_inertia)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    speeds: list[Sequence[str]] = [("joint", "angle", "command_pct", "speed")]
    for name, grid in speed_grids(plant).items():
        for row in grid.tolist():
            speeds.append([name, *map("{:.9g}".format, row)])
    names = [plant.names[joint - 1] for joint in plant.joints]
    every_lag = joint_lags(plant)
    lags = [f"{every_lag[joint - 1]:.6g}" for joint in plant.joints]
    content = {
        "moving.xml": mjcf_text(spec),
        "speeds.csv": csv_text(speeds),
        "lags.csv": csv_text([("joint", "lag_s"), *zip(names, lags, strict=True)]),
        "columns.csv": csv_text(_columns(plant)),
        "drive.py": fill_template("use/drive.py.j2"),
        "MOVING.txt": fill_template("use/moving.txt.j2", joints=", ".join(names)),
    }
    for name, text in content.items():
        write_atomic(model / name, text)
    return [model / "moving.xml", model / "drive.py", model / "MOVING.txt"]


def _columns(plant: Plant) -> list[Sequence[str]]:
    """Return what the columns of the logs hold: the factor and the offset with which
    their cells become s, % and rad or m."""
    settings = plant.identified.settings
    arm = settings.arm
    ranges = dict.fromkeys(arm.joint_names, (-np.inf, np.inf))
    rows: list[Sequence[str]] = [("kind", "joint", "column", "gain", "offset")]
    for signal in map_signals(settings.log, ranges, arm):
        is_of_arm = signal.joint in (0, *plant.joints) and signal.kind != "pressure"
        # the length of a cylinder is no line of the angle
        if not is_of_arm or signal.rod is not None:
            continue
        # the second column is for the negative direction
        sign = -1.0 if signal.part else 1.0
        numbers = sign * signal.gain, sign * signal.offset
        row = (signal.kind, signal.owner, signal.name, *map("{:.17g}".format, numbers))
        rows.append(row)
    return rows


def speed_grids(plant: Plant) -> dict[str, Array]:
    """Return rows of angle [rad], command [%] and settled speed [rad/s] by joint, each
    joint alone."""
    grids = dict[str, Array]()
    for column in [joint - 1 for joint in plant.joints]:
        low, high = plant.identified.settings.arm.limits[column]
        angles = np.linspace(low, high, ANGLES)
        angle = np.repeat(angles, len(COMMANDS))
        command = np.tile(COMMANDS, ANGLES)
        speed = speeds_alone(plant, column, angle, command)
        grids[plant.names[column]] = np.column_stack([angle, command, speed])
    return grids
