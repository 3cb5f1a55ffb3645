"""The shapes of a robot: meshes of any format -> STL files in m; what is shown, and what collides."""

import re
from contextlib import suppress
from pathlib import Path

import mujoco
import numpy as np
import trimesh

from hydroid.arrays import Array
from hydroid.cad.source import Notes
from hydroid.errors import ModelError
from hydroid.mjcf import mujoco_errors
from hydroid.words import distinct

MESHES = "links"  # folder of the meshes beside the model
SHOWN, HIDDEN = 2, 3  # groups of shapes that are seen, and of those that only collide


def convert_meshes(
    spec: mujoco.MjSpec, files: dict[str, Path], exact: bool, notes: Notes
) -> tuple[dict[str, bytes], set[str]]:
    """Turn the meshes into STL files in m and delete those that cannot be shown.

    `exact`: no link has its inertia by what the file says of its meshes, so that the best way may be taken.
    Returned are the files by their path from the model, and the bodies that lost a mesh.
    """
    read = {name: mesh for name, path in files.items() if (mesh := _read_mesh(path, notes)) is not None}
    used = {geom.meshname for geom in spec.geoms}
    sizes = [
        np.max(read[mesh.file].extents * np.abs(mesh.scale))
        for mesh in spec.meshes
        if mesh.file in read and mesh.name in used
    ]
    millimetres = max(sizes, default=0.0) > 50.0  # [m]
    if millimetres:
        notes.add(f"meshes up to {max(sizes):.4g} m long: all are taken to be in mm")
    taken: set[str] = set()
    names = {name: f"{MESHES}/{distinct(word(files[name].stem), taken)}.stl" for name in read}
    meshes, lost = dict[str, bytes](), set[str]()
    for mesh in [mesh for mesh in spec.meshes if mesh.file]:
        shapes = [geom for geom in spec.geoms if geom.meshname == mesh.name]
        mesh.scale = mesh.scale * (1e-3 if millimetres else 1.0)
        source = read.get(mesh.file) if shapes else None
        shown = source and _shown_stl(source, mesh.scale, files[mesh.file].name, notes)
        if not shown:
            lost |= {geom.parent.name for geom in shapes}
            for part in (*shapes, mesh):
                spec.delete(part)
            continue
        mesh.file = names[mesh.file]
        meshes[mesh.file] = shown[0]
        flat = shown[1] == mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        mesh.inertia = shown[1] if exact or flat else mesh.inertia
    spec.meshdir, spec.strippath, spec.assets = "", False, meshes
    return meshes, lost


def sort_shapes(spec: mujoco.MjSpec) -> None:
    """Show what the file shows, or else what collides; let collide what collides, or else what is shown."""
    for body in spec.bodies:
        visual = [geom for geom in body.geoms if not geom.contype and not geom.conaffinity]
        solid = [geom for geom in body.geoms if geom.contype or geom.conaffinity]
        for geom in body.geoms:
            geom.group = SHOWN if geom in (visual or solid) else HIDDEN
            geom.contype = geom.conaffinity = int(geom in (solid or visual))
            if not geom.material and np.allclose(geom.rgba, (0.5, 0.5, 0.5, 1.0)):
                geom.rgba = (0.94, 0.53, 0.08, 1.0)


def word(name: str) -> str:
    """Return a plain word from any name."""
    plain = re.sub(r"\W", "_", name, flags=re.ASCII) or "arm"
    return f"_{plain}" if plain[0].isdigit() else plain


def _read_mesh(path: Path, notes: Notes) -> trimesh.Trimesh | None:
    """Read a mesh file of any format that trimesh knows; None, with a note: it cannot be read."""
    try:
        mesh = trimesh.load(path, force="mesh")
    except Exception as error:  # trimesh's readers raise whatever their format's parser does
        collada = path.suffix.lower() == ".dae" and isinstance(error, ImportError | ValueError)
        cure = "pip install pycollada, or export them as STL" if collada else "export them as STL"
        notes.add(f"cannot be read; {cure}", f"mesh {path.name}")
        return None
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
        notes.add("holds no triangles; export the solid as STL", f"mesh {path.name}")
        return None
    return mesh


def _shown_stl(
    mesh: trimesh.Trimesh, scale: Array, name: str, notes: Notes
) -> tuple[bytes, mujoco.mjtMeshInertia] | None:
    """Return a mesh as a binary STL, and how MuJoCo takes its inertia; None, with a note: it refuses both.

    That is exact where the mesh is closed, else that of its hull, and of no use where it is flat.
    """
    if len(mesh.faces) > 200_000:
        notes.add("more triangles than MuJoCo reads: its hull is shown", f"mesh {name}")
        mesh = mesh.convex_hull
    content, kinds = mesh.export(file_type="stl"), mujoco.mjtMeshInertia
    assert isinstance(content, bytes)
    closed = [kinds.mjMESH_INERTIA_EXACT] if mesh.is_volume else []
    for kind in (*closed, kinds.mjMESH_INERTIA_CONVEX, kinds.mjMESH_INERTIA_SHELL):
        spec = mujoco.MjSpec()
        spec.assets = {"a.stl": content}
        spec.add_mesh(name="a", file="a.stl", scale=scale, inertia=kind)
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="a")
        with suppress(ModelError), mujoco_errors(f"mesh {name}"):
            spec.compile()
            return content, kind
    notes.add("refused by MuJoCo: not shown", f"mesh {name}")
    return None
