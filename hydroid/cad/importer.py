"""A URDF or MJCF -> the model of a serial arm that hydroid can simulate, and its meshes."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from hydroid.cad.chain import choose_chain
from hydroid.cad.repair import MASSLESS, repair_inertias, set_inertia
from hydroid.cad.scene import SCENE, clear_scene, exclude_contacts, place_scene
from hydroid.cad.shapes import HIDDEN, SHOWN, ball, read_mesh, shown_stl
from hydroid.cad.source import Source, read_source
from hydroid.mjcf import mujoco_errors

LARGEST_MESH = 50.0
"""size beyond which meshes are taken to be in millimetres [m]"""
MESHES = "links"
"""folder of the meshes beside the model"""
PAINT, BASE = (0.94, 0.53, 0.08, 1.0), (0.25, 0.27, 0.3, 1.0)
"""colours of what the file gives none"""


@dataclass(frozen=True, eq=False)
class ImportedArm:
    """A serial arm out of a robot's file.

    Attributes:
        name: of the robot.
        mjcf: its model, with meshes in the folder MESHES.
        meshes: binary STL files by their path from the model.
        notes: what was assumed, left out or mended, a line each.
    """

    name: str
    mjcf: str
    meshes: dict[str, bytes]
    notes: tuple[str, ...]


def import_arm(path: Path, columns: Sequence[str] = (), tip: str | None = None) -> ImportedArm:
    """Read a robot through MuJoCo's importer and take the arm out of it.

    Args:
        path: a URDF or an MJCF.
        columns: names of a log's columns, which help to choose among branches.
        tip: name of the link at which the arm ends; None: the tip that fits best.

    Raises:
        ModelError: the file cannot be read, or holds no arm.
    """
    source = read_source(path)
    spec, notes = source.spec, source.notes
    _clear(spec, path)
    choose_chain(spec, str(path), notes, columns, tip)
    meshes = _convert_meshes(source)
    _sort_shapes(spec)
    with mujoco_errors(str(path)):
        repair_inertias(spec, source.urdf, notes)
        spec.fuse_static()
    if not any(np.any(joint.damping) for joint in spec.joints):
        notes.append("no joint has damping: a fit estimates it")
    for joint in spec.joints:
        _mend_joint(joint, notes)
    return ImportedArm(spec.modelname, _in_scene(spec, meshes), meshes, tuple(dict.fromkeys(notes)))


def _clear(spec: mujoco.MjSpec, path: Path) -> None:
    """Delete what is no part of the arm's bodies, and give these plain names."""
    forces = (spec.actuators, spec.sensors, spec.equalities, spec.tendons)
    for section in (*forces, spec.keys, spec.excludes, spec.pairs):
        for part in list(section):
            spec.delete(part)
    clear_scene(spec)
    spec.modelname = _word(path.stem if spec.modelname in ("", "MuJoCo Model") else spec.modelname)
    taken = {"world"}
    for number, body in enumerate(spec.bodies[1:], start=1):
        body.name = _distinct(_word(body.name or f"link{number}"), taken)
    taken = set()
    for joint in spec.joints:
        joint.name = _distinct(_word(joint.name or f"{joint.parent.name}_joint"), taken)
    folder = path.resolve().parent / spec.texturedir
    for texture in spec.textures:
        texture.file = texture.file and str(folder / texture.file)  # these stay where they are
    spec.texturedir = ""


def _word(name: str) -> str:
    """A plain word from any name."""
    word = re.sub(r"\W", "_", name, flags=re.ASCII) or "arm"
    return f"_{word}" if word[0].isdigit() else word


def _distinct(name: str, taken: set[str]) -> str:
    """A name that is not taken, which it is from now on."""
    free = next(n for n in (name, *(f"{name}_{k}" for k in range(2, 10_000))) if n not in taken)
    taken.add(free)
    return free


def _convert_meshes(source: Source) -> dict[str, bytes]:
    """Turn the meshes into STL files in m, delete those that cannot be shown, and return the files."""
    spec, notes, files = source.spec, source.notes, dict[str, tuple[str, bytes]]()
    read = {name: read_mesh(path, notes) for name, path in source.meshes.items()}
    sizes = {
        mesh.file: float(np.max(found.extents * np.abs(mesh.scale)))
        for mesh in spec.meshes
        if (found := read.get(mesh.file)) is not None
    }
    largest = max(sizes, key=lambda name: sizes[name], default="")
    millimetres = bool(largest) and sizes[largest] > LARGEST_MESH
    if millimetres:
        name = source.meshes[largest].name
        notes.append(f"mesh {name} would be {sizes[largest]:.4g} m long: all meshes are taken to be in mm")
    taken: set[str] = set()
    for name, mesh in read.items():
        content = None if mesh is None else shown_stl(mesh, source.meshes[name].name, notes)
        if content is not None:
            stem = _distinct(_word(source.meshes[name].stem), taken)
            files[name] = f"{MESHES}/{stem}.stl", content
    for mesh in list(spec.meshes):
        shapes = [geom for geom in spec.geoms if geom.meshname == mesh.name]
        if mesh.file and (mesh.file not in files or not shapes):
            for part in (*shapes, mesh):
                spec.delete(part)
        elif mesh.file:
            mesh.file = files[mesh.file][0]
            mesh.scale = mesh.scale * (1e-3 if millimetres else 1.0)
            if source.urdf or all(geom.parent.explicitinertial for geom in shapes):
                mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # of no use, and never refused
    spec.meshdir, spec.strippath, spec.assets = "", False, dict(files.values())
    return dict(files.values())


def _sort_shapes(spec: mujoco.MjSpec) -> None:
    """Show what the file shows, or else what collides; let collide what collides, or else what is shown."""
    plain = np.array([0.5, 0.5, 0.5, 1.0])
    for body in spec.bodies:
        visual = [geom for geom in body.geoms if not geom.contype and not geom.conaffinity]
        solid = [geom for geom in body.geoms if geom.contype or geom.conaffinity]
        for geom in body.geoms:
            geom.group = SHOWN if geom in (visual or solid) else HIDDEN
            geom.contype = geom.conaffinity = int(geom in (solid or visual))
            if not geom.material and np.allclose(geom.rgba, plain):
                geom.rgba = PAINT if any(_joints_above(body)) else BASE


def _joints_above(body: mujoco.MjsBody | None) -> list[mujoco.MjsJoint]:
    return [] if body is None else [*body.joints, *_joints_above(body.parent)]


def _mend_joint(joint: mujoco.MjsJoint, notes: list[str]) -> None:
    """Give the joint's link a mass, say where it has no limits, and leave to a fit what a fit finds."""
    joint.damping = joint.stiffness = np.zeros(3)
    joint.frictionloss = joint.armature = 0.0
    if joint.parent.mass <= MASSLESS:
        name = joint.parent.name
        notes.append(f"link {name} has no mass and no shape: a steel ball of 1 kg in its joint is taken")
        set_inertia(joint.parent, 1.0, np.array(joint.pos), ball(1.0))
    if joint.limited == mujoco.mjtLimited.mjLIMITED_FALSE or not joint.range[0] < joint.range[1]:
        joint.limited = mujoco.mjtLimited.mjLIMITED_FALSE
        notes.append(f"joint {joint.name} has no limits: it turns without stops, unless you give it a range")


def _in_scene(spec: mujoco.MjSpec, meshes: dict[str, bytes]) -> str:
    """Return the arm's MJCF with light, floor and cameras, and the pose nearest to 0 as `home`."""
    spec.compiler.savecompiled = spec.compiler.savecanonical = False  # canonical is six digits
    text = spec.to_xml().replace("<worldbody>", f"{SCENE}<worldbody>", 1)
    with mujoco_errors(spec.modelname):
        whole = mujoco.MjSpec.from_string(text, assets=meshes)
        model = whole.compile()
    low, high = np.where(model.jnt_limited, model.jnt_range.T, 0.0)
    home = np.clip(0.0, low, high)
    whole.add_key(name="home", qpos=home)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    place_scene(whole, data.xanchor[0], data.xanchor[-1])
    exclude_contacts(whole)
    whole.compiler.savecompiled = whole.compiler.savecanonical = False
    return whole.to_xml()
