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

import mujoco
import numpy as np

from hydroid.arrays import Array
from hydroid.errors import ModelError
from hydroid.files import csv_text, fill_template, write_atomic
from hydroid.mjcf import mjcf_text
from hydroid.plant import Plant
from hydroid.robot_xml import read_robot
from hydroid.use.follow import joint_lags
from hydroid.use.tables import COMMANDS, joint_range, speeds_alone

ANGLES = 15
"""of a joint in its table of speeds"""
SERVO = 500.0
"""rate at which a velocity actuator takes up an error [1/s]"""
_LINK = r"<link\b[^>]*?\bname\s*=\s*([\"']){}\1[^>]*?>.*?</link\s*>"
_MASS = re.compile(r"(<mass\b[^>]*?\bvalue\s*=\s*[\"'])([^\"']*)")
_INERTIA = re.compile(r"<inertia\b[^>]*>")
_MOMENT = re.compile(r"(\bi[xyz]{2}\s*=\s*[\"'])([^\"']*)")


def fitted_urdf(plant: Plant, robot: Path) -> tuple[str, list[str]]:
    """Return a URDF with the masses of a fit, and the names of the links that it
    changed.

    A link's inertia is scaled with its mass, as if its shape stayed and its density
    changed. All other text stays as it is.

    Raises:
        ModelError: the file cannot be read, is no URDF, or has none of the arm's links
            with a mass.
    """
    if read_robot(robot).tag != "robot":
        raise ModelError("is no URDF", robot, "name the URDF that hydroid init read")
    text = robot.read_text(encoding="utf-8")
    links = plant.identified.settings.arm.link_names
    changed = list[str]()
    for name, mass in zip(links, plant.masses.tolist(), strict=True):
        link = re.search(_LINK.format(re.escape(name)), text, re.DOTALL)
        stated = link and _MASS.search(link[0])
        if not link or not stated or float(stated[2]) <= 0.0:
            continue
        heavier = _reweighed(link[0], mass, mass / float(stated[2]))
        text = text[: link.start()] + heavier + text[link.end() :]
        changed.append(name)
    if not changed:
        raise ModelError(f"has none of the links {', '.join(links)} with a mass", robot)
    return text, changed


def _reweighed(link: str, mass: float, factor: float) -> str:
    heavier = _MASS.sub(rf"\g<1>{mass:.9g}", link, count=1)
    return _INERTIA.sub(lambda inertia: _scaled(inertia[0], factor), heavier, count=1)


def _scaled(inertia: str, factor: float) -> str:
    def scale(moment: re.Match[str]) -> str:
        return f"{moment[1]}{factor * float(moment[2]):.9g}"

    return _MOMENT.sub(scale, inertia)


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
        "drive.py": fill_template("use/drive.py.j2"),
        "MOVING.txt": fill_template("use/moving.txt.j2", joints=", ".join(names)),
    }
    for name, text in content.items():
        write_atomic(model / name, text)
    return [model / "moving.xml", model / "drive.py", model / "MOVING.txt"]


def speed_grids(plant: Plant) -> dict[str, Array]:
    """Return rows of angle [rad], command [%] and settled speed [rad/s] by joint, each
    joint alone."""
    grids = dict[str, Array]()
    for column in [joint - 1 for joint in plant.joints]:
        low, high = joint_range(plant, column)
        angles = np.linspace(low, high, ANGLES)
        angle = np.repeat(angles, len(COMMANDS))
        command = np.tile(COMMANDS, ANGLES)
        speed = speeds_alone(plant, column, angle, command)
        grids[plant.names[column]] = np.column_stack([angle, command, speed])
    return grids
