"""A URDF or MJCF -> the model of a serial arm that hydroid can simulate, and its
meshes."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from hydroid.arrays import Array, record
from hydroid.cad.chain import choose_chain
from hydroid.cad.cylinders import take_cylinders, take_sites
from hydroid.cad.meshes import convert_meshes
from hydroid.cad.repair import repair_inertias, weigh
from hydroid.cad.source import Notes, read_source, sort_shapes, word
from hydroid.errors import SettingsError
from hydroid.files import Plain, fill_template
from hydroid.mjcf import mjcf_text, mujoco_errors
from hydroid.settings.cylinder import make_cylinder
from hydroid.settings.linkage import Cylinder
from hydroid.settings.load import validate
from hydroid.words import distinct

ENDLESS = 2000.0  # range of a joint that has none [rad, m]
TURNS = 4.1 * np.pi  # range of a joint that is rather in deg [rad]
SLIGHT = 0.11  # range of a joint that is rather rad read as deg [rad]
FAR = 50.0  # range of a joint that is rather in mm [m]


@record
class ImportedArm:
    """A serial arm out of a robot's file: its MJCF, and its meshes as STL by their path
    from that.

    `cylinders` are settings of those that the file models, but for areas, by joint;
    `notes` say what was assumed, left out or mended.
    """

    title: str
    mjcf: str
    meshes: dict[str, bytes]
    cylinders: dict[str, dict[str, Any]]
    notes: tuple[str, ...]


def import_arm(
    path: Path,
    columns: Sequence[str] = (),
    tip: str | None = None,
    total_mass: float | None = None,
) -> ImportedArm:
    """Read a URDF or an MJCF through MuJoCo's importer and take the arm out of it
    (`hydroid.init`).

    `columns` are those of a log, which name joints; `tip` is the last link;
    `total_mass` is that of all moving links [kg].

    Raises:
        ModelError: a file that holds no arm that hydroid can simulate.
    """
    notes = Notes(path)
    spec, files, urdf = read_source(path, notes)
    _clear(spec, path)
    _weigh_as_on_earth(spec, notes)
    # cylinders first: their rods and tubes are then held, and are no joints of the arm
    cylinders = take_sites(spec, notes) | take_cylinders(spec, notes)
    choose_chain(spec, path, notes, columns, tip)
    exact = urdf or all(
        geom.parent.explicitinertial for geom in spec.geoms if geom.meshname
    )
    meshes, lost = convert_meshes(spec, files, exact, notes)
    sort_shapes(spec)
    with mujoco_errors(path):
        repair_inertias(spec, urdf, notes)
        # a link weighs what all parts that are fixed to it weigh
        spec.fuse_static()
        weigh(spec, notes, total_mass, lost)
    _free_joints(spec, notes)
    title = f"{spec.modelname}, from {path.name}"
    whole, model = _in_scene(spec, meshes, path)
    _doubt_limits(model, notes)
    possible = _possible(cylinders, mujoco.MjData(model), notes)
    return ImportedArm(title, mjcf_text(whole), meshes, possible, tuple(notes.lines()))


def _free_joints(spec: mujoco.MjSpec, notes: Notes) -> None:
    """Leave joints only what a fit does not find: their axes and ranges."""
    for joint in spec.joints:
        joint.damping = joint.stiffness = np.zeros(3)
        joint.frictionloss = joint.armature = 0.0
        span = float(np.ptp(joint.range))
        if joint.limited == mujoco.mjtLimited.mjLIMITED_FALSE or not 0 < span < ENDLESS:
            joint.limited = mujoco.mjtLimited.mjLIMITED_FALSE
            what = "without limits: moving without stops, unless you give a range in arm.xml"
            notes.add(what, joint.name)


def _in_scene(
    spec: mujoco.MjSpec, meshes: dict[str, bytes], path: Path
) -> tuple[mujoco.MjSpec, mujoco.MjModel]:
    """Return the arm with light, floor and cameras, and the pose nearest to 0 as
    `home`; and its model before these are arranged."""
    # `arrange` puts its lights and cameras around the arm
    scene = fill_template("cad/scene.xml")
    text = mjcf_text(spec).replace("<worldbody>", scene + "<worldbody>", 1)
    with mujoco_errors(path):
        whole = mujoco.MjSpec.from_string(text, assets=meshes)
        model = whole.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    low, high = np.where(model.jnt_limited, model.jnt_range.T, 0.0)
    whole.add_key(name="home", qpos=np.clip(0.0, low, high))
    with mujoco_errors(path):
        arrange(whole, data.xanchor[0], data.xanchor[-1])
    return whole, model


def _clear(spec: mujoco.MjSpec, path: Path) -> None:
    """Delete what is no part of the arm's bodies or would stand beside the scene,
    and give plain names."""
    extras = [*spec.keys, *spec.excludes, *spec.pairs, *spec.lights, *spec.cameras]
    extras += [geom for geom in spec.geoms if geom.type == mujoco.mjtGeom.mjGEOM_PLANE]
    extras += [look for look in (*spec.textures, *spec.materials) if _is_of_scene(look)]
    for part in extras:
        spec.delete(part)
    unnamed = spec.modelname in ("", "MuJoCo Model")
    spec.modelname = word(path.stem if unnamed else spec.modelname)
    bodies, joints = _renamed(spec)
    for equality in spec.equalities:
        if equality.objtype == mujoco.mjtObj.mjOBJ_SITE:
            continue  # sites keep their names
        of_joints = equality.type == mujoco.mjtEq.mjEQ_JOINT
        names = joints if of_joints else bodies
        equality.name1 = names.get(equality.name1, equality.name1)
        equality.name2 = names.get(equality.name2, equality.name2)


def _renamed(spec: mujoco.MjSpec) -> tuple[dict[str, str], dict[str, str]]:
    """Give bodies and joints plain names, all different; return the new names by the
    old ones."""
    bodies = dict[str, str]()
    taken = {"world"}
    for number, body in enumerate(spec.bodies[1:], 1):
        old = body.name
        body.name = distinct(word(old or f"link{number}"), taken)
        bodies[old] = body.name
    joints = dict[str, str]()
    taken = set[str]()
    for joint in spec.joints:
        old = joint.name
        joint.name = distinct(word(old or f"{joint.parent.name}_joint"), taken)
        joints[old] = joint.name
    return bodies, joints


def _is_of_scene(look: Any) -> bool:
    """Return whether a texture or material would stand beside those of hydroid's own
    scene."""
    if look.name in ("floor", "sky"):
        return True
    return getattr(look, "type", None) == mujoco.mjtTexture.mjTEXTURE_SKYBOX


def _weigh_as_on_earth(spec: mujoco.MjSpec, notes: Notes) -> None:
    """Take out what carries the arm in the file in place of its actuators:
    hydroid does not simulate it."""
    for body in spec.bodies:
        if body.gravcomp:
            body.gravcomp = 0.0
            what = "gravity compensation of the file is left out: actuators carry the weight"
            notes.add(what, body.name)
    option = spec.option
    weightless = not any(option.gravity)
    if weightless or option.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY:
        if weightless:
            option.gravity = [0.0, 0.0, -9.81]
        notes.add("the file switches gravity off: it acts downwards along z")
    if option.density or option.viscosity:
        option.density = option.viscosity = 0.0
        notes.add(
            "density and viscosity of the air are left out: hydroid does not simulate them"
        )
    option.disableflags = option.enableflags = 0


def _doubt_limits(model: mujoco.MjModel, notes: Notes) -> None:
    """Say which limits look like those of another unit."""
    for joint in map(model.joint, range(model.njnt)):
        if joint.limited[0]:
            doubt = _doubt(joint)
            if doubt:
                notes.add(f"{doubt} Correct its range in arm.xml", joint.name)


def _doubt(joint: Any) -> str:
    """Return why a joint's limits look like those of another unit; empty where they do
    not."""
    span = float(np.ptp(joint.range))
    if joint.type[0] == mujoco.mjtJoint.mjJNT_SLIDE:
        if span > FAR:
            return f"moves by {span:.4g} m within its limits. Are they in mm?"
        return ""
    if span > TURNS:
        return f"turns by {span:.4g} rad within its limits. Are they in deg?"
    if span < SLIGHT:
        return f"turns by only {np.degrees(span):.2g} deg within its limits. Are they in rad?"
    return ""


def _possible(
    cylinders: Mapping[str, Plain], data: mujoco.MjData, notes: Notes
) -> dict[str, Plain]:
    """Return the cylinders that can move their joints through their ranges; say of
    others why not.

    `data` may have any pose.
    """
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(data.model, data)
    possible = dict[str, Plain]()
    for joint in map(data.model.joint, range(data.model.njnt)):
        settings = cylinders.get(joint.name)
        if settings is None:
            continue
        try:
            _try_cylinder(settings, joint, data)
        except ValueError as error:
            notes.add(f"the file's cylinder is not taken: {error}", joint.name)
        else:
            possible[joint.name] = settings
    return possible


def _try_cylinder(settings: Plain, joint: Any, data: mujoco.MjData) -> None:
    """Raise ValueError where a cylinder cannot move its joint through its range.

    The file says nothing of areas and openings, and any will do.
    """
    if not joint.limited[0]:
        raise ValueError("the joint has no limits")
    complete = settings | {"area_a": 1.0, "area_b": 1.0, "max_opening": 1.0}
    try:
        cylinder = validate(complete, Cylinder, "")
    except SettingsError as error:
        raise ValueError(error.what) from None
    slides = bool(joint.type[0] == mujoco.mjtJoint.mjJNT_SLIDE)
    low, high = joint.range.tolist()
    make_cylinder(cylinder, (low, high), data, joint.name, slides=slides)


def arrange(spec: mujoco.MjSpec, base: Array, tip: Array) -> None:
    """Put lights and cameras around the stretched arm, as far away as it reaches;
    exclude contacts by design.

    `base` and `tip` are its ends in the world [m], shape (3,). What touches in a named
    pose is close by design, or its hull is wide.
    """
    model = spec.compile()
    centre = np.round(0.5 * (base + tip), 6)
    reach = round(0.8 * float(np.linalg.norm(tip - base)), 6)
    # one joint, or joints close together: the links reach farther
    if reach < 0.2 * model.stat.extent:
        centre = np.round(model.stat.center, 6)
        reach = round(0.5 * float(model.stat.extent), 6)
    if reach > 4.0:
        half = round(1.25 * reach, 3)
        spec.geom("floor").size = [half, half, 0.1]
    for light in spec.lights:
        light.pos = centre - light.dir
    for camera in spec.cameras:
        camera.pos = np.round(centre + 2.3 * reach * camera.pos, 3)
    spec.stat.center = centre
    spec.stat.extent = reach
    for first, second in sorted(_touching(model)):
        names = (model.body(first).name, model.body(second).name)
        spec.add_exclude(bodyname1=names[0], bodyname2=names[1])


def _touching(model: mujoco.MjModel) -> set[tuple[int, int]]:
    """Return the pairs of bodies that touch in any named pose, the lower number
    first."""
    data = mujoco.MjData(model)
    pairs = set[tuple[int, int]]()
    for key in range(model.nkey):
        mujoco.mj_resetDataKeyframe(model, data, key)
        mujoco.mj_forward(model, data)
        for pair in model.geom_bodyid[data.contact.geom]:
            pairs.add((int(pair.min()), int(pair.max())))
    return pairs
