"""An arm with locked joints as an MJCF with its looks: what a plant steps and shows, and what is exported.

The bodies are those of `hydroid.arm.locked`, with the inertia of all that is fused into them. Shapes, sites,
cameras and lights of a fused body hang on the body that carries it; contacts are off, as in every simulation.
"""

import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
import yaml
from numpy.typing import ArrayLike

from hydroid.arm.locked import Array, Frame, LockedArm, copy_joints
from hydroid.files import write_atomic
from hydroid.mjcf import quiet_mujoco

FITTED, MECHANICS, ACTUATORS, README = "fitted.xml", "mechanics.xml", "actuators.yaml", "README.txt"

_MECHANICAL_README = """\
fitted.xml is the fitted arm for MuJoCo alone. Set ctrl to the commands [%] and call mj_step once per
{timestep:g} s: it moves as the fit does, within 1e-6 rad.
It holds for one start pose, the keyframe `start`, and moves {joints}. Other joints are fused in that
pose, springs are slack there, and each motor adds the constant torque that balances gravity there.
For another pose use hydroid:

    plant = hydroid.load_plant(FOLDER)      # the folder that holds model/
    plant.reset(pose)                       # plant.save(OTHER) writes fitted.xml for this pose
    q = plant.step(command)

arm.xml is the arm before the fit.
"""
_HYDRAULIC_README = """\
MuJoCo alone cannot step this arm: the fit has hydraulics, and MuJoCo has none. Use hydroid:

    plant = hydroid.load_plant(FOLDER)      # the folder that holds model/
    plant.reset(pose)
    q = plant.step(command)                 # plant.model and plant.data are MuJoCo's

mechanics.xml is the fitted arm without its hydraulics: masses, dampers and springs, and no motors. Its
moving joints are {joints}; the others are fused in the start pose, which is the keyframe `start`.
actuators.yaml lists the hydraulic parameters of each joint. arm.xml is the arm before the fit.
"""
_LEFT_OUT = ("contact", "equality", "sensor", "keyframe", "actuator", "deformable", "size")
_COMPILER = ("angle", "autolimits", "eulerseq", "meshdir", "texturedir", "strippath")
_OF_A_LINK = ("inertial", "joint", "freejoint")
_BODY_FIELDS = ("pos", "quat", "ipos", "iquat", "mass", "inertia", "simple", "sameframe")


def dressed_model(spec: mujoco.MjSpec, locked: LockedArm) -> mujoco.MjModel:
    """Return the locked arm's model with shapes, cameras and one idle motor per joint.

    It steps as `locked.model` does, bit for bit: motors are switched off, and their controls are free to hold
    commands in %.
    """
    source, home = spec.copy(), Path(spec.modelfiledir).resolve()
    source.meshdir, source.texturedir = str(home / spec.meshdir), str(home / spec.texturedir)
    text = arm_mjcf(source, locked, locked.model, np.zeros((2, len(locked.joints))))
    with quiet_mujoco():
        model = mujoco.MjModel.from_xml_string(text)
    for name in (*("body_" + field for field in _BODY_FIELDS), "jnt_pos", "jnt_axis", "dof_simplenum"):
        getattr(model, name)[:] = getattr(locked.model, name)
    copy_joints(locked.model, model)
    model.opt.disableflags = locked.model.opt.disableflags
    return model


def arm_mjcf(
    spec: mujoco.MjSpec,
    locked: LockedArm,
    model: mujoco.MjModel,
    motors: ArrayLike | None = None,
) -> str:
    """Return the MJCF of an arm with locked joints.

    Args:
        spec: the arm's MJCF, for its looks.
        locked: which of its bodies move as one.
        model: inertia and joints of the locked arm, and the time step; `locked.model` or one like it.
        motors: torque per command [N·m/%] and torque without one [N·m] of the moving joints, shape (2, V);
            None: no motors.
    """
    source = spec.copy()
    source.compiler.savecompiled = source.compiler.savecanonical = False  # canonical is six digits
    root = ElementTree.fromstring(source.to_xml())
    for name in _LEFT_OUT:
        for section in root.findall(name):
            root.remove(section)
    compiler = _section(root, "compiler")
    for name in compiler.attrib.keys() - _COMPILER:  # what changes weights or fuses bodies
        del compiler.attrib[name]
    compiler.set("inertiafromgeom", "false")
    option = _section(root, "option")
    option.set("timestep", repr(float(model.opt.timestep)))
    _section(option, "flag").set("contact", "disable")
    _fuse(root, locked.frames, model)
    _keep_drawn_tendons(root)
    if motors is not None:
        actuators = _section(root, "actuator")
        for name, gain, bias in zip(locked.joints, *np.asarray(motors), strict=True):
            values = {"gainprm": _text([gain]), "biastype": "affine", "biasprm": _text([bias, 0, 0])}
            limits = {"ctrllimited": "true", "ctrlrange": "-100 100"}
            ElementTree.SubElement(actuators, "general", {"name": name, "joint": name} | values | limits)
    pose = {"name": "start", "qpos": _text(model.qpos_spring)}
    ElementTree.SubElement(_section(root, "keyframe"), "key", pose)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _fuse(root: ElementTree.Element, frames: tuple[Frame, ...], model: mujoco.MjModel) -> None:
    """Put the locked arm's bodies in the place of all; what hangs on the others moves to them in frames."""
    world, degrees = _section(root, "worldbody"), _section(root, "compiler").get("angle") != "radian"
    above, bodies = {child: part for part in world.iter() for child in part}, list(world.iter("body"))
    kept = [ElementTree.Element("worldbody", world.attrib)]
    homes = [(kept[0], world)]
    for body, frame in zip(bodies, frames[1:], strict=True):  # in the order of their numbers
        inherited, k = _default_class(body, above), frame.body
        if k < len(kept):
            placed = _frame(frame.position, frame.turn)
            home = ElementTree.SubElement(kept[k], "frame", placed | inherited)
        else:
            named = {"name": body.get("name", "")} | _frame(model.body_pos[k], model.body_quat[k])
            home = ElementTree.SubElement(kept[model.body_parentid[k]], "body", named | inherited)
            mass = {"mass": _text([model.body_mass[k]]), "diaginertia": _text(model.body_inertia[k])}
            placed = _frame(model.body_ipos[k], model.body_iquat[k])
            ElementTree.SubElement(home, "inertial", placed | mass)
            home.append(_joint(body, model, k - 1, degrees))
            kept.append(home)
        homes.append((home, body))
    for body in bodies:
        above[body].remove(body)
    for home, body in homes:
        home.extend([part for part in body if part.tag not in _OF_A_LINK])
    root[list(root).index(world)] = kept[0]


def _default_class(
    body: ElementTree.Element, above: dict[ElementTree.Element, ElementTree.Element]
) -> dict[str, str]:
    """The default class of a body's parts: its own, or that of what it is in."""
    part: ElementTree.Element | None = body
    while part is not None:
        if name := part.get("childclass"):
            return {"childclass": name}
        part = above.get(part)
    return {}


def _joint(body: ElementTree.Element, model: mujoco.MjModel, j: int, degrees: bool) -> ElementTree.Element:
    joint, slack = body.findall("joint")[0], float(model.qpos_spring[j])
    joint.set("damping", _text([model.dof_damping[j]]))
    joint.set("stiffness", _text([model.jnt_stiffness[j]]))
    joint.set("frictionloss", _text([model.dof_frictionloss[j]]))
    joint.set("armature", _text([model.dof_armature[j]]))
    joint.set("springref", _text([math.degrees(slack) if degrees else slack]))
    return joint


def _keep_drawn_tendons(root: ElementTree.Element) -> None:
    """Keep tendons as drawings of cylinders: none of their forces is simulated."""
    for section in root.findall("tendon"):
        for tendon in list(section):
            if tendon.tag != "spatial":
                section.remove(tendon)
            for name in tendon.attrib.keys() - {"name", "width", "rgba", "material", "group"}:
                del tendon.attrib[name]


def _section(root: ElementTree.Element, name: str) -> ElementTree.Element:
    found = root.find(name)
    return ElementTree.SubElement(root, name) if found is None else found


def _frame(position: Array, turn: Array) -> dict[str, str]:
    return {"pos": _text(position), "quat": _text(turn)}


def _text(values: Array | list[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def write_fitted(
    folder: Path, mjcf: str, timestep: float, joints: str, actuators: dict[str, Any] | None
) -> None:
    """Write the fitted arm to `model/`, beside `arm.xml`, and a README that says what it is good for.

    Args:
        folder: `model/`.
        mjcf: the fitted arm.
        timestep: MuJoCo's [s].
        joints: names of the joints that take commands.
        actuators: hydraulic parameters by joint (stage 2); None: the MJCF has motors (stage 1).

    Raises:
        RunError: the folder cannot be written.
    """
    write_atomic(folder / (FITTED if actuators is None else MECHANICS), mjcf)
    if actuators is not None:
        text = yaml.safe_dump(actuators, sort_keys=False, allow_unicode=True)
        write_atomic(folder / ACTUATORS, text)
    words = _MECHANICAL_README if actuators is None else _HYDRAULIC_README
    write_atomic(folder / README, words.format(timestep=timestep, joints=joints))
