"""A URDF or MJCF -> the model of a serial arm that hydroid can simulate, and its meshes."""

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
from hydroid.files import Plain, fill_template
from hydroid.mjcf import mjcf_text, mujoco_errors
from hydroid.settings.cylinder import make_cylinder
from hydroid.settings.linkage import Cylinder
from hydroid.words import distinct

ENDLESS = 2000.0  # range of a joint that has none [rad, m]
# ranges of a joint that are rather in deg, or rad read as deg [rad]
TURNS, SLIGHT = 4.1 * np.pi, 0.11
FAR = 50.0  # range of a joint that is rather in mm [m]


@record
class ImportedArm:
    """A serial arm out of a robot's file: its MJCF, and its meshes as STL by their path from that.

    `cylinders` are settings of those that the file models, but for areas, by joint; `notes` say
    what was assumed, left out or mended.
    """

    title: str
    mjcf: str
    meshes: dict[str, bytes]
    cylinders: dict[str, dict[str, Any]]
    notes: tuple[str, ...]


def import_arm(
    path: Path, columns: Sequence[str] = (), tip: str | None = None, total_mass: float | None = None
) -> ImportedArm:
    """Read a URDF or an MJCF through MuJoCo's importer and take the arm out of it
    (`hydroid.init`)."""
    notes = Notes(path)
    spec, files, urdf = read_source(path, notes)
    _clear(spec, path)
    _weigh_as_on_earth(spec, notes)
    cylinders = take_sites(spec, notes) | take_cylinders(spec, notes)
    choose_chain(spec, path, notes, columns, tip)
    exact = urdf or all(geom.parent.explicitinertial for geom in spec.geoms if geom.meshname)
    meshes, lost = convert_meshes(spec, files, exact, notes)
    sort_shapes(spec)
    with mujoco_errors(path):
        repair_inertias(spec, urdf, notes)
        spec.fuse_static()
        weigh(spec, notes, total_mass, lost)
    for joint in spec.joints:
        joint.damping = joint.stiffness = np.zeros(3)  # a fit finds them
        joint.frictionloss = joint.armature = 0.0
        span = float(np.ptp(joint.range))
        if joint.limited == mujoco.mjtLimited.mjLIMITED_FALSE or not 0 < span < ENDLESS:
            joint.limited = mujoco.mjtLimited.mjLIMITED_FALSE
            notes.add("without limits: moving without stops, unless you give a range in arm.xml", joint.name)
    title = f"{spec.modelname}, from {path.name}"
    # with light, floor and cameras, and the pose nearest to 0 as `home`
    scene = fill_template("cad/scene.xml")  # `arrange` puts its lights and cameras around the arm
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
    _doubt_limits(model, notes)
    kept = _possible(cylinders, data, notes)
    return ImportedArm(title, mjcf_text(whole), meshes, kept, tuple(notes.lines()))


def _clear(spec: mujoco.MjSpec, path: Path) -> None:
    """Delete what is no part of the arm's bodies or would stand beside the scene,
    and give plain names."""
    plane, sky = mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtTexture.mjTEXTURE_SKYBOX
    floors = [geom for geom in spec.geoms if geom.type == plane]
    looks = [*spec.textures, *spec.materials]
    named = [look for look in looks if look.name in ("floor", "sky") or getattr(look, "type", None) == sky]
    for part in (*spec.keys, *spec.excludes, *spec.pairs, *spec.lights, *spec.cameras, *floors, *named):
        spec.delete(part)
    spec.modelname = word(path.stem if spec.modelname in ("", "MuJoCo Model") else spec.modelname)
    renamed, taken = dict[str, str](), {"world"}
    for number, body in enumerate(spec.bodies[1:], 1):
        old, body.name = body.name, distinct(word(body.name or f"link{number}"), taken)
        renamed[old] = body.name
    taken, joints = set(), dict[str, str]()
    for joint in spec.joints:
        old, joint.name = joint.name, distinct(word(joint.name or f"{joint.parent.name}_joint"), taken)
        joints[old] = joint.name
    for one in spec.equalities:
        names = joints if one.type == mujoco.mjtEq.mjEQ_JOINT else renamed
        if one.objtype != mujoco.mjtObj.mjOBJ_SITE:
            one.name1, one.name2 = (names.get(name, name) for name in (one.name1, one.name2))


def _weigh_as_on_earth(spec: mujoco.MjSpec, notes: Notes) -> None:
    """Take out what carries the arm in the file in place of its actuators:
    hydroid does not simulate it."""
    lifted, option = [body for body in spec.bodies if body.gravcomp], spec.option
    for body in lifted:
        body.gravcomp = 0.0
        notes.add("gravity compensation of the file is left out: actuators carry the weight", body.name)
    if not any(option.gravity) or option.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY:
        option.gravity = [0.0, 0.0, -9.81] if not any(option.gravity) else option.gravity
        notes.add("the file switches gravity off: it acts downwards along z")
    if option.density or option.viscosity:
        option.density = option.viscosity = 0.0
        notes.add("density and viscosity of the air are left out: hydroid does not simulate them")
    option.disableflags = option.enableflags = 0


def _doubt_limits(model: mujoco.MjModel, notes: Notes) -> None:
    """Say which limits look like those of another unit."""
    for joint in map(model.joint, range(model.njnt)):
        if not joint.limited[0]:
            continue
        span, slides = float(np.ptp(joint.range)), joint.type[0] == mujoco.mjtJoint.mjJNT_SLIDE
        if slides and span > FAR:
            what = f"moves by {span:.4g} m within its limits. Are they in mm? Correct its range in arm.xml"
            notes.add(what, joint.name)
        elif not slides and span > TURNS:
            what = f"turns by {span:.4g} rad within its limits. Are they in deg? Correct its range in arm.xml"
            notes.add(what, joint.name)
        elif not slides and span < SLIGHT:
            what = f"turns by only {np.degrees(span):.2g} deg within its limits. Are they in rad?"
            notes.add(f"{what} Correct its range in arm.xml", joint.name)


def _possible(cylinders: Mapping[str, Plain], data: mujoco.MjData, notes: Notes) -> dict[str, Plain]:
    """Return the cylinders that can move their joints through their ranges; say of others why not.

    `data` has all joints where the file has them.
    """
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(data.model, data)
    found = dict[str, Plain]()
    for joint in map(data.model.joint, range(data.model.njnt)):
        own = cylinders.get(joint.name)
        if own is None:
            continue
        try:
            if not joint.limited[0]:
                raise ValueError("the joint has no limits")
            settings = Cylinder.model_validate(own | {"area_a": 1.0, "area_b": 1.0, "max_opening": 1.0})
            slides = bool(joint.type[0] == mujoco.mjtJoint.mjJNT_SLIDE)
            make_cylinder(settings, tuple(joint.range.tolist()), data, joint.name, slides=slides)
        except ValueError as error:
            notes.add(f"the file's cylinder is not taken: {error}", joint.name)
        else:
            found[joint.name] = own
    return found


def arrange(spec: mujoco.MjSpec, base: Array, tip: Array) -> None:
    """Put lights and cameras around the stretched arm, as far away as it reaches;
    exclude contacts by design.

    `base` and `tip` are its ends in the world [m], shape (3,). What touches in a named pose is
    close by design, or its hull is wide.
    """
    model = spec.compile()
    centre, reach = np.round(0.5 * (base + tip), 6), round(0.8 * float(np.linalg.norm(tip - base)), 6)
    # one joint, or joints close together: the links reach farther
    if reach < 0.2 * model.stat.extent:
        centre, reach = np.round(model.stat.center, 6), round(0.5 * float(model.stat.extent), 6)
    if reach > 4.0:
        spec.geom("floor").size = [round(1.25 * reach, 3)] * 2 + [0.1]
    for light in spec.lights:
        light.pos = centre - light.dir
    for camera in spec.cameras:
        camera.pos = np.round(centre + 2.3 * reach * camera.pos, 3)
    spec.stat.center, spec.stat.extent = centre, reach
    data, pairs = mujoco.MjData(model), set[tuple[int, int]]()
    for key in range(model.nkey):
        mujoco.mj_resetDataKeyframe(model, data, key)
        mujoco.mj_forward(model, data)
        pairs |= {(int(pair.min()), int(pair.max())) for pair in model.geom_bodyid[data.contact.geom]}
    for first, second in sorted(pairs):
        spec.add_exclude(bodyname1=model.body(first).name, bodyname2=model.body(second).name)
