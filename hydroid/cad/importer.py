"""A URDF or MJCF -> the model of a serial arm that hydroid can simulate, and its meshes."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from hydroid.cad.chain import choose_chain
from hydroid.cad.cylinders import take_cylinders
from hydroid.cad.notes import Notes
from hydroid.cad.repair import repair_inertias, weigh
from hydroid.cad.scene import SCENE, clear_scene, exclude_contacts, place_scene
from hydroid.cad.shapes import HIDDEN, SHOWN, read_mesh, shown_stl
from hydroid.cad.source import read_source
from hydroid.mjcf import mujoco_errors

MESHES = "links"
"""folder of the meshes beside the model"""


@dataclass(frozen=True, eq=False)
class ImportedArm:
    """A serial arm out of a robot's file.

    Attributes:
        name: of the robot.
        mjcf: its model, with meshes in the folder MESHES.
        meshes: binary STL files by their path from the model.
        cylinders: settings of the cylinders that the file models, but for areas, by joint.
        notes: what was assumed, left out or mended, a line each.
    """

    name: str
    mjcf: str
    meshes: dict[str, bytes]
    cylinders: dict[str, dict[str, Any]]
    notes: tuple[str, ...]


def import_arm(
    path: Path, columns: Sequence[str] = (), tip: str | None = None, total_mass: float | None = None
) -> ImportedArm:
    """Read a robot through MuJoCo's importer and take the arm out of it.

    Args:
        path: a URDF or an MJCF.
        columns: names of a log's columns, which help to choose among branches.
        tip: name of the link at which the arm ends; None: the tip that fits best.
        total_mass: of the links that move [kg]; None: masses are those of the file.

    Raises:
        ModelError: the file cannot be read, or holds no arm.
    """
    notes = Notes()
    spec, files, urdf = read_source(path, notes)
    _clear(spec, path)
    cylinders = take_cylinders(spec, notes)
    choose_chain(spec, str(path), notes, columns, tip)
    exact = urdf or all(geom.parent.explicitinertial for geom in spec.geoms if geom.meshname)
    meshes, lost = _convert_meshes(spec, files, exact, notes)
    _sort_shapes(spec)
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
    return ImportedArm(spec.modelname, _in_scene(spec, meshes), meshes, kept, tuple(notes.lines()))


def _clear(spec: mujoco.MjSpec, path: Path) -> None:
    """Delete what is no part of the arm's bodies, and give these plain names."""
    for section in (spec.keys, spec.excludes, spec.pairs):
        for part in list(section):
            spec.delete(part)
    clear_scene(spec)
    spec.modelname = _word(path.stem if spec.modelname in ("", "MuJoCo Model") else spec.modelname)
    renamed, taken = dict[str, str](), {"world"}
    for number, body in enumerate(spec.bodies[1:], start=1):
        old, body.name = body.name, _distinct(_word(body.name or f"link{number}"), taken)
        renamed[old] = body.name
    taken, joints = set(), dict[str, str]()
    for joint in spec.joints:
        old, joint.name = joint.name, _distinct(_word(joint.name or f"{joint.parent.name}_joint"), taken)
        joints[old] = joint.name
    for one in spec.equalities:
        names = joints if one.type == mujoco.mjtEq.mjEQ_JOINT else renamed
        if one.objtype != mujoco.mjtObj.mjOBJ_SITE:
            one.name1, one.name2 = (names.get(name, name) for name in (one.name1, one.name2))


def _word(name: str) -> str:
    """A plain word from any name."""
    word = re.sub(r"\W", "_", name, flags=re.ASCII) or "arm"
    return f"_{word}" if word[0].isdigit() else word


def _distinct(name: str, taken: set[str]) -> str:
    """A name that is not taken, which it is from now on."""
    free = next(n for n in (name, *(f"{name}_{k}" for k in range(2, 10_000))) if n not in taken)
    taken.add(free)
    return free


def _convert_meshes(
    spec: mujoco.MjSpec, files: dict[str, Path], exact: bool, notes: Notes
) -> tuple[dict[str, bytes], set[str]]:
    """Turn the meshes into STL files in m and delete those that cannot be shown.

    Returns the files, and the bodies that lost a mesh.

    `exact`: no link has its inertia by what the file says of its meshes, so that the best way may be taken.
    """
    read = {name: mesh for name, path in files.items() if (mesh := read_mesh(path, notes)) is not None}
    used = {geom.meshname for geom in spec.geoms}
    sizes = [
        float(np.max(read[mesh.file].extents * np.abs(mesh.scale)))
        for mesh in spec.meshes
        if mesh.file in read and mesh.name in used
    ]
    millimetres = max(sizes, default=0.0) > 50.0  # [m]
    if millimetres:
        notes.add(f"meshes up to {max(sizes):.4g} m long: all are taken to be in mm")
    taken: set[str] = set()
    names = {name: f"{MESHES}/{_distinct(_word(files[name].stem), taken)}.stl" for name in read}
    meshes, lost = dict[str, bytes](), set[str]()
    for mesh in [mesh for mesh in spec.meshes if mesh.file]:
        shapes = [geom for geom in spec.geoms if geom.meshname == mesh.name]
        mesh.scale = mesh.scale * (1e-3 if millimetres else 1.0)
        given = read.get(mesh.file) if shapes else None
        shown = given and shown_stl(given, mesh.scale, files[mesh.file].name, notes)
        if not shown:
            lost |= {geom.parent.name for geom in shapes}
            for part in (*shapes, mesh):
                spec.delete(part)
            continue
        mesh.file = names[mesh.file]
        meshes[mesh.file] = shown[0]
        mesh.inertia = shown[1] if exact else mesh.inertia
    spec.meshdir, spec.strippath, spec.assets = "", False, meshes
    return meshes, lost


def _sort_shapes(spec: mujoco.MjSpec) -> None:
    """Show what the file shows, or else what collides; let collide what collides, or else what is shown."""
    for body in spec.bodies:
        visual = [geom for geom in body.geoms if not geom.contype and not geom.conaffinity]
        solid = [geom for geom in body.geoms if geom.contype or geom.conaffinity]
        for geom in body.geoms:
            geom.group = SHOWN if geom in (visual or solid) else HIDDEN
            geom.contype = geom.conaffinity = int(geom in (solid or visual))
            if not geom.material and np.allclose(geom.rgba, (0.5, 0.5, 0.5, 1.0)):
                geom.rgba = (0.94, 0.53, 0.08, 1.0)


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
