"""A URDF or MJCF -> the model of a serial arm that hydroid can simulate, and its meshes."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from hydroid.arrays import Array, record
from hydroid.cad.chain import choose_chain
from hydroid.cad.cylinders import take_cylinders
from hydroid.cad.repair import repair_inertias, weigh
from hydroid.cad.shapes import convert_meshes, sort_shapes, word
from hydroid.cad.source import Notes, read_source
from hydroid.files import fill_template
from hydroid.mjcf import mjcf_text, mujoco_errors
from hydroid.words import distinct


@record
class ImportedArm:
    """A serial arm out of a robot's file: its MJCF.

    Attributes:
        title: names of the model and of the file.
        meshes: binary STL files by their path from the model.
        cylinders: settings of the cylinders that the file models, but for areas, by joint.
        notes: what was assumed, left out or mended, a line each.
    """

    title: str
    mjcf: str
    meshes: dict[str, bytes]
    cylinders: dict[str, dict[str, Any]]
    notes: tuple[str, ...]


def import_arm(
    path: Path, columns: Sequence[str] = (), tip: str | None = None, total_mass: float | None = None
) -> ImportedArm:
    """Read a URDF or an MJCF through MuJoCo's importer and take the arm out of it.

    Args:
        columns: names of a log's columns, which help to choose among branches.
        tip: name of the link at which the arm ends; None: the tip that fits best.
        total_mass: of the links that move [kg]; None: masses are those of the file.

    Raises ModelError: the file cannot be read, or holds no arm.
    """
    notes = Notes()
    spec, files, urdf = read_source(path, notes)
    _clear(spec, path)
    cylinders = take_cylinders(spec, notes)
    choose_chain(spec, str(path), notes, columns, tip)
    exact = urdf or all(geom.parent.explicitinertial for geom in spec.geoms if geom.meshname)
    meshes, lost = convert_meshes(spec, files, exact, notes)
    sort_shapes(spec)
    with mujoco_errors(str(path)):
        repair_inertias(spec, urdf, notes)
        spec.fuse_static()
        weigh(spec, notes, total_mass, lost)
    for joint in spec.joints:
        joint.damping = joint.stiffness = np.zeros(3)  # a fit finds them
        joint.frictionloss = joint.armature = 0.0
        if joint.limited == mujoco.mjtLimited.mjLIMITED_FALSE or not joint.range[0] < joint.range[1]:
            joint.limited = mujoco.mjtLimited.mjLIMITED_FALSE
            notes.add("without limits: moving without stops, unless you give a range in arm.xml", joint.name)
    kept = {joint.name: own for joint in spec.joints if (own := cylinders.get(joint.name))}
    title = f"{spec.modelname}, from {path.name}"
    return ImportedArm(title, _in_scene(spec, meshes), meshes, kept, tuple(notes.lines()))


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


def _in_scene(spec: mujoco.MjSpec, meshes: dict[str, bytes]) -> str:
    """Return the arm's MJCF with light, floor and cameras, and the pose nearest to 0 as `home`."""
    scene = fill_template("cad/scene.xml")  # `arrange` puts its lights and cameras around the arm
    text = mjcf_text(spec).replace("<worldbody>", scene + "<worldbody>", 1)
    with mujoco_errors(spec.modelname):
        whole = mujoco.MjSpec.from_string(text, assets=meshes)
        model = whole.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    low, high = np.where(model.jnt_limited, model.jnt_range.T, 0.0)
    whole.add_key(name="home", qpos=np.clip(0.0, low, high))
    arrange(whole, data.xanchor[0], data.xanchor[-1])
    return mjcf_text(whole)


def arrange(spec: mujoco.MjSpec, base: Array, tip: Array) -> None:
    """Put lights and cameras around the stretched arm, as far away as it reaches; exclude contacts by design.

    `base` and `tip` are its ends in the world [m], shape (3,). What touches in a named pose is close by
    design, or its hull is wide.
    """
    with mujoco_errors(spec.modelname):
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
