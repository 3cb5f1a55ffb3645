"""An arm with locked joints as an MJCF with its looks: what a plant steps and shows, and what is exported.

The bodies are those of `hydroid.arm.locked`, with the inertia of all that is fused into them. Shapes, sites,
cameras and lights of a fused body hang on the body that carries it; contacts are off, as in every simulation.
"""

import math
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from hydroid.arm.locked import Fusion, LockedArm
from hydroid.arm.quiet import quiet_mujoco

_LEFT_OUT = ("contact", "equality", "sensor", "keyframe", "actuator", "deformable", "size")
_WEIGHED = (
    "inertiafromgeom", "settotalmass", "boundmass", "boundinertia", "balanceinertia", "discardvisual",
    "fusestatic", "inertiagrouprange", "alignfree",
)  # fmt: skip
_OF_A_LINK = ("body", "inertial", "joint", "freejoint")
_COPIED = [
    f"body_{name}" for name in ["pos", "quat", "ipos", "iquat", "mass", "inertia", "simple", "sameframe"]
]
_COPIED += [
    f"jnt_{name}"
    for name in [
        "pos",
        "axis",
        "range",
        "limited",
        "margin",
        "solref",
        "solimp",
        "stiffness",
        "stiffnesspoly",
    ]
]
_COPIED += [
    f"dof_{name}"
    for name in ["damping", "dampingpoly", "armature", "frictionloss", "solref", "solimp", "simplenum"]
]
_COPIED += ["qpos0", "qpos_spring"]
_OPTIONS = [
    "timestep",
    "gravity",
    "integrator",
    "solver",
    "iterations",
    "tolerance",
    "jacobian",
    "enableflags",
    "disableflags",
]


def dressed_model(spec: mujoco.MjSpec, fusion: Fusion, locked: LockedArm) -> mujoco.MjModel:
    """Return the locked arm's model with shapes, cameras and one idle motor per joint.

    It steps as `locked.model` does, bit for bit: motors are switched off, and their controls are free to hold
    commands in %.
    """
    text = arm_mjcf(spec, fusion, locked.model, np.zeros((2, len(locked.joints))))
    with quiet_mujoco():
        model = mujoco.MjModel.from_xml_string(text)
    for name in _COPIED:
        getattr(model, name)[:] = getattr(locked.model, name)
    for name in _OPTIONS:
        setattr(model.opt, name, getattr(locked.model.opt, name))
    return model


def arm_mjcf(
    spec: mujoco.MjSpec,
    fusion: Fusion,
    model: mujoco.MjModel,
    motors: ArrayLike | None = None,
    meshes: str | None = None,
) -> str:
    """Return the MJCF of an arm with locked joints.

    Args:
        spec: the arm's MJCF, for its looks.
        fusion: which bodies move as one.
        model: its fused bodies and their joints, and the time step.
        motors: torque per command [N·m/%] and torque without one [N·m] of the moving joints, shape (2, V);
            None: no motors.
        meshes: the folder of the meshes as the file is to name it; by default where they are.
    """
    source = spec.copy()
    source.compiler.savecompiled = source.compiler.savecanonical = False  # canonical is six digits
    root = ElementTree.fromstring(source.to_xml())
    for name in _LEFT_OUT:
        for section in root.findall(name):
            root.remove(section)
    compiler = _section(root, "compiler")
    for name in _WEIGHED:
        compiler.attrib.pop(name, None)
    compiler.set("inertiafromgeom", "false")
    if meshes is None:
        home = Path(spec.modelfiledir).resolve()
        compiler.set("meshdir", str(home / spec.meshdir))
        compiler.set("texturedir", str(home / spec.texturedir))
    else:
        compiler.set("meshdir", meshes)
    option = _section(root, "option")
    option.set("timestep", repr(float(model.opt.timestep)))
    _section(option, "flag").set("contact", "disable")
    _fuse(root, fusion, model)
    _keep_drawn_tendons(root)
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, j) for j in range(model.njnt)]
    if motors is not None:
        actuators = _section(root, "actuator")
        for name, gain, bias in zip(names, *np.asarray(motors), strict=True):
            values = {"gainprm": _text([gain]), "biastype": "affine", "biasprm": _text([bias, 0, 0])}
            limits = {"ctrllimited": "true", "ctrlrange": "-100 100"}
            ElementTree.SubElement(actuators, "general", {"name": name, "joint": name} | values | limits)
    pose = {"name": "start", "qpos": _text(model.qpos_spring)}
    ElementTree.SubElement(_section(root, "keyframe"), "key", pose)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _fuse(root: ElementTree.Element, fusion: Fusion, model: mujoco.MjModel) -> None:
    """Put the kept bodies in the place of all, and what else hangs on the others into their frames."""
    world = _section(root, "worldbody")
    bodies = [world, *world.iter("body")]  # in the order of their numbers
    classes = {child: body for body in bodies for child in body.findall("body")}
    kept: dict[int, ElementTree.Element] = {}
    fused: list[tuple[ElementTree.Element, ElementTree.Element]] = []
    degrees = _section(root, "compiler").get("angle", "degree") == "degree"
    new = ElementTree.Element("worldbody", world.attrib)
    for number, body in enumerate(bodies):
        carrier = fusion.carrier[number]
        inherited = _inherited_class(body, classes)
        if number == 0:
            kept[0] = home = new
        elif number == carrier:
            k = fusion.kept.index(number)
            parent = kept[fusion.carrier[fusion.full.body_parentid[number]]]
            frame = {"pos": _text(model.body_pos[k]), "quat": _text(model.body_quat[k])}
            home = ElementTree.SubElement(parent, "body", {"name": body.get("name", "")} | frame | inherited)
            kept[number] = home
            _add_inertial(home, model, k)
            home.append(_joint(body, model, k - 1, degrees))
        else:
            position, turn = fusion.place(number, carrier)
            frame = {"pos": _text(position), "quat": _text(turn)}
            home = ElementTree.SubElement(kept[carrier], "frame", frame | inherited)
        fused.append((home, body))
    for home, body in fused:
        home.extend([part for part in body if part.tag not in _OF_A_LINK])
    root[list(root).index(world)] = new


def _add_inertial(body: ElementTree.Element, model: mujoco.MjModel, k: int) -> None:
    frame = {"pos": _text(model.body_ipos[k]), "quat": _text(model.body_iquat[k])}
    mass = {"mass": _text([model.body_mass[k]]), "diaginertia": _text(model.body_inertia[k])}
    ElementTree.SubElement(body, "inertial", frame | mass)


def _joint(body: ElementTree.Element, model: mujoco.MjModel, j: int, degrees: bool) -> ElementTree.Element:
    joint = next(iter(body.findall("joint")))
    slack = float(model.qpos_spring[j])
    values = {
        "damping": model.dof_damping[j],
        "stiffness": model.jnt_stiffness[j],
        "frictionloss": model.dof_frictionloss[j],
        "armature": model.dof_armature[j],
        "springref": math.degrees(slack) if degrees else slack,
    }
    for name, value in values.items():
        joint.set(name, _text([value]))
    return joint


def _inherited_class(
    body: ElementTree.Element, parents: dict[ElementTree.Element, ElementTree.Element]
) -> dict[str, str]:
    """The default class of a body's parts, which it may have from a body above it."""
    above: ElementTree.Element | None = body
    while above is not None:
        if name := above.get("childclass"):
            return {"childclass": name}
        above = parents.get(above)
    return {}


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


def _text(values: NDArray[np.float64] | list[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
