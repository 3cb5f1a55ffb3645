"""Mesh files and MuJoCo's shapes -> triangles in m."""

from contextlib import suppress
from pathlib import Path

import mujoco
import numpy as np
import trimesh
from numpy.typing import NDArray

from hydroid.cad.notes import Notes
from hydroid.errors import ModelError
from hydroid.mjcf import mujoco_errors

Array = NDArray[np.float64]
SHOWN, HIDDEN = 2, 3
"""groups of shapes that are seen, and of those that only collide"""


def read_mesh(path: Path, notes: Notes) -> trimesh.Trimesh | None:
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


def shown_stl(
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


def geom_mesh(model: mujoco.MjModel, geom: int) -> trimesh.Trimesh | None:
    """Return a shape of a model as triangles in its own frame [m]; None: it has no volume."""
    number, size = int(model.geom_dataid[geom]), model.geom_size[geom]
    kinds = mujoco.mjtGeom
    match kinds(int(model.geom_type[geom])):
        case kinds.mjGEOM_MESH:
            vertices = model.mesh_vert[model.mesh_vertadr[number] :][: model.mesh_vertnum[number]]
            faces = model.mesh_face[model.mesh_faceadr[number] :][: model.mesh_facenum[number]]
            return trimesh.Trimesh(vertices, faces)
        case kinds.mjGEOM_BOX:
            return trimesh.creation.box(extents=2 * size)
        case kinds.mjGEOM_SPHERE:
            return trimesh.creation.icosphere(subdivisions=2, radius=size[0])
        case kinds.mjGEOM_CYLINDER:
            return trimesh.creation.cylinder(radius=size[0], height=2 * size[1], sections=24)
        case kinds.mjGEOM_CAPSULE:
            return trimesh.creation.capsule(radius=size[0], height=2 * size[1], count=[16, 16])
        case kinds.mjGEOM_ELLIPSOID:
            return trimesh.creation.icosphere(subdivisions=2, radius=1.0).apply_scale(size)
        case _:
            return None
