"""A URDF or MJCF -> the model of a serial arm that hydroid can simulate, and its meshes."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from hydroid.arrays import Array, record
from hydroid.cad.cylinders import ends_of, is_part_of_cylinder, take_cylinders, take_sites
from hydroid.cad.meshes import convert_meshes
from hydroid.cad.repair import repair_inertias, weigh
from hydroid.cad.source import Notes, read_source, sort_shapes, word
from hydroid.errors import ModelError
from hydroid.files import Plain, fill_template
from hydroid.log.clues import joint_of, words
from hydroid.mjcf import mjcf_text, mujoco_errors
from hydroid.settings.cylinder import make_cylinder
from hydroid.settings.linkage import Cylinder
from hydroid.words import distinct, listed

ENDLESS = 2000.0  # range of a joint that has none [rad, m]
TURNS, SLIGHT = 4.1 * np.pi, 0.11  # ranges of a joint that are rather in deg, or rad read as deg [rad]
FAR = 50.0  # range of a joint that is rather in mm [m]
FINGERS = {"finger", "fingers", "jaw", "jaws", "claw", "claws", "knuckle", "fingertip"}
SIDES = {"left", "right", "l", "r"}


@record
class ImportedArm:
    """A serial arm out of a robot's file: its MJCF, and its meshes as STL by their path from that.

    `cylinders` are settings of those that the file models, but for areas, by joint; `notes` say what was
    assumed, left out or mended.
    """

    title: str
    mjcf: str
    meshes: dict[str, bytes]
    cylinders: dict[str, dict[str, Any]]
    notes: tuple[str, ...]


def import_arm(
    path: Path, columns: Sequence[str] = (), tip: str | None = None, total_mass: float | None = None
) -> ImportedArm:
    """Read a URDF or an MJCF through MuJoCo's importer and take the arm out of it (`hydroid.init`)."""
    notes = Notes(path)
    spec, files, urdf = read_source(path, notes)
    _clear(spec, path)
    _weigh_as_on_earth(spec, notes)
    cylinders = take_sites(spec, notes) | take_cylinders(spec, notes)
    _choose_chain(spec, path, notes, columns, tip)
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
    """Delete what is no part of the arm's bodies or would stand beside the scene, and give plain names."""
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
    """Take out what carries the arm in the file in place of its actuators: hydroid does not simulate it."""
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


def _choose_chain(
    spec: mujoco.MjSpec, path: Path, notes: Notes, columns: Sequence[str], tip: str | None
) -> None:
    """Choose the joints from the base to `tip`, or else to the tip that fits best, and delete the others.

    The best tip is the one with the most joints that the columns of a log name, then the one with the most
    joints, then the first. Rods and tubes of cylinders are no tips, nor are fingers that the log does not
    name. What is left out is held, and its mass belongs to the link that carries it.
    """
    _hold(spec, notes)
    chains: dict[str, tuple[str, ...]] = {}
    for joint in spec.joints:
        if len(joint.parent.joints) > 1:
            hint = "put a small body between them: hydroid moves one joint per link"
            raise ModelError(f"body {joint.parent.name!r} has several joints", path, hint)
        chains[joint.parent.name] = _path(joint.parent)
    inner = {name for chain in chains.values() for name in chain[:-1]}
    tips = {link: chain for link, chain in chains.items() if chain[-1] not in inner}
    if not tips:
        raise ModelError("has no joint that hydroid could move", path)
    if tip is None:
        arms = [_without_fingers(spec, chain, columns) for chain in tips.values()]
        wanted = max(arms, key=lambda chain: (_named(spec, chain, columns), len(chain)))
        why = "the log names most of its joints" if _named(spec, wanted, columns) else "the longest branch"
    else:
        link, why = spec.body(tip), "as asked"
        wanted = () if link is None else _path(link)
        if not wanted:
            raise ModelError(f"no joint moves a link {tip!r}", path, f"tips: {', '.join(tips)}")
    left = [joint for joint in spec.joints if joint.name not in wanted]
    if left:
        others = listed([f"--tip {link}" for link, chain in tips.items() if chain != wanted], 6)
        named = [joint.name for joint in left if _named(spec, [joint.name], columns)]
        warning = f"; THE LOG NAMES {', '.join(named)}" if named else ""
        held = listed([joint.name for joint in left], 12)
        notes.add(
            f"the arm is {' - '.join(wanted)} ({why}); held at 0, on no way to its end: {held}{warning}. "
            f"Other ends: {others or 'none'}"
        )
    for joint in left:
        spec.delete(joint)


def _without_fingers(spec: mujoco.MjSpec, chain: tuple[str, ...], columns: Sequence[str]) -> tuple[str, ...]:
    """Return a chain without the fingers at its end that no column names: they grip, and are no arm."""
    while len(chain) > 1 and _is_finger(spec, chain[-1]) and not _named(spec, chain[-1:], columns):
        chain = chain[:-1]
    return chain


def _is_finger(spec: mujoco.MjSpec, name: str) -> bool:
    """Return whether a joint's name or its link's says so, or another beside it differs by its side only."""
    joint = spec.joint(name)
    told = {*words(joint.name), *words(joint.parent.name)}
    if told & FINGERS:
        return True
    above = joint.parent.parent
    beside = [other.name for other in spec.joints if other.parent.parent == above and other.name != name]
    return _without_side(name) in map(_without_side, beside)


def _without_side(name: str) -> tuple[str, ...]:
    return tuple(one for one in words(name) if one not in SIDES and not one.isdecimal())


def _hold(spec: mujoco.MjSpec, notes: Notes) -> None:
    """Delete the joints that hydroid does not move, or that follow others, and say so."""
    followers = {e.name1: e.name2 for e in spec.equalities if e.type == mujoco.mjtEq.mjEQ_JOINT}
    for joint in list(spec.joints):
        if joint.type == mujoco.mjtJoint.mjJNT_FREE:
            notes.add("free to float in the file: fixed to the world", joint.parent.name)
        elif joint.name in followers:
            notes.add("following another joint, which hydroid does not model: held at 0", joint.name)
        elif joint.type == mujoco.mjtJoint.mjJNT_BALL:
            notes.add("a ball joint, which hydroid does not model: held at 0", joint.name)
        elif is_part_of_cylinder(joint):
            what = "part of a cylinder that the file pins at one end: held. Give both pivots in arm.yaml"
            notes.add(what, joint.name)
        else:
            continue
        spec.delete(joint)
    for one in spec.equalities:
        if one.type != mujoco.mjtEq.mjEQ_JOINT:
            kind = one.type.name.removeprefix("mjEQ_").lower()
            what = f"a {kind} of the file ties them, which hydroid does not simulate: left out"
            notes.add(what, *ends_of(spec, one))
    for part in (*spec.equalities, *spec.actuators, *spec.tendons):
        spec.delete(part)


def _path(body: mujoco.MjsBody | None) -> tuple[str, ...]:
    return () if body is None else (*_path(body.parent), *(joint.name for joint in body.joints))


def _named(spec: mujoco.MjSpec, chain: Sequence[str], columns: Sequence[str]) -> int:
    """Number of the chain's joints whose name, or whose link's, stands in the name of a column."""
    names = [joint.name for joint in spec.joints]
    links = [joint.parent.name for joint in spec.joints]
    hits = {joint_of(column, of) for column in columns for of in (names, links)} - {None}
    return sum(names.index(name) + 1 in hits for name in chain)


def arrange(spec: mujoco.MjSpec, base: Array, tip: Array) -> None:
    """Put lights and cameras around the stretched arm, as far away as it reaches; exclude contacts by design.

    `base` and `tip` are its ends in the world [m], shape (3,). What touches in a named pose is close by
    design, or its hull is wide.
    """
    model = spec.compile()
    centre, reach = np.round(0.5 * (base + tip), 6), round(0.8 * float(np.linalg.norm(tip - base)), 6)
    if reach < 0.2 * model.stat.extent:  # one joint, or joints close together: the links reach farther
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
