"""Mesh files and MuJoCo's shapes -> triangles in m, and the mass properties of what they enclose."""

from pathlib import Path

import mujoco
import numpy as np
import trimesh
from numpy.typing import NDArray

from hydroid.errors import ModelError
from hydroid.mjcf import mujoco_errors

Array = NDArray[np.float64]
SHOWN, HIDDEN = 2, 3
"""groups of shapes that are seen, and of those that only collide"""


def read_mesh(path: Path, notes: list[str]) -> trimesh.Trimesh | None:
    """Read a mesh file of any format that trimesh knows; None, with a note: it cannot be read."""
    try:
        mesh = trimesh.load(path, force="mesh")
    except Exception as error:  # trimesh's readers raise whatever their format's parser does
        reason = str(error).strip().splitlines()
        hint = "; pip install pycollada" if path.suffix.lower() == ".dae" else "; export it as STL"
        what = reason[0] if reason else type(error).__name__
        notes.append(f"mesh {path.name} cannot be read ({what}){hint}")
        return None
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
        notes.append(f"mesh {path.name} holds no triangles; export the solid as STL")
        return None
    return mesh


def shown_stl(mesh: trimesh.Trimesh, name: str, notes: list[str]) -> bytes | None:
    """Return a binary STL of the mesh, or of its hull where MuJoCo refuses the mesh; None: both."""
    for candidate, what in ((mesh, "its hull is shown"), (mesh.convex_hull, "it is not shown")):
        content = candidate.export(file_type="stl")
        assert isinstance(content, bytes)
        spec = mujoco.MjSpec()
        spec.assets = {"a.stl": content}
        spec.add_mesh(name="a", file="a.stl")
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="a", mass=0)
        try:
            with mujoco_errors(f"mesh {name}"):
                spec.compile()
            return content
        except ModelError as error:
            notes.append(f"{error}: {what}")
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


def solid_properties(mesh: trimesh.Trimesh) -> tuple[float, Array, Array, str] | None:
    """Return volume [m³], centre [m], inertia for 1 kg [m²], and what was taken for the solid.

    That is the mesh if it is closed, else its convex hull. None: it is flat.
    """
    closed = mesh.is_watertight and mesh.volume > 0
    try:
        solid = mesh if closed else mesh.convex_hull
    except Exception:  # qhull's own error for flat points
        return None
    if not np.isfinite(solid.volume) or solid.volume < 1e-9:  # one cubic millimetre
        return None
    inertia = np.asarray(solid.moment_inertia) / solid.mass
    return float(solid.volume), np.asarray(solid.center_mass), inertia, "mesh" if closed else "mesh's hull"


def ball(mass: float) -> Array:
    """Return the inertia of a steel ball about its centre [kg·m²], shape (3, 3)."""
    radius = (mass / 7850.0 / (4 / 3 * np.pi)) ** (1 / 3)
    return 0.4 * mass * radius**2 * np.eye(3)
