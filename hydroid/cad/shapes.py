"""Mesh files and MuJoCo's primitive shapes -> triangles in m; and the mass properties of what is closed."""

from collections.abc import Iterable
from pathlib import Path

import mujoco
import numpy as np
import trimesh

from hydroid.arm.mesh import LARGEST_LINK
from hydroid.arm.model import mujoco_errors
from hydroid.cad.imported import Array
from hydroid.errors import ModelError

DENSITY = 1000.0
"""of a body without a mass [kg/m³], MuJoCo's; steel links are hollow"""
STEEL = 7850.0  # [kg/m³]
MILLIMETRES = 1e-3


class MeshFiles:
    """The meshes of a robot, read once each and scaled to m.

    Args:
        paths: where each file lies, by its name in the spec.
        notes: receives a line for each mesh that cannot be read, and for a changed unit.
    """

    def __init__(self, paths: dict[str, Path], scales: dict[str, Array], notes: list[str]) -> None:
        self._meshes = {name: _read(path, notes) for name, path in paths.items()}
        sizes = {
            name: float(np.max(mesh.extents * np.abs(scales.get(name, np.ones(3)))))
            for name, mesh in self._meshes.items()
            if mesh is not None
        }
        largest = max(sizes, key=lambda name: sizes[name], default="")
        self._factor = 1.0
        if largest and sizes[largest] > LARGEST_LINK:
            self._factor = MILLIMETRES
            notes.append(
                f"mesh {paths[largest].name} would be {sizes[largest]:.4g} m long: "
                "all meshes are taken to be in mm"
            )

    def get(self, name: str, scale: Array) -> trimesh.Trimesh | None:
        """Return a mesh [m]; None: it cannot be read. `scale` is that of the spec, shape (3,)."""
        mesh = self._meshes.get(name)
        if mesh is None:
            return None
        scaled = mesh.copy()
        scaled.apply_transform(np.diag([*(scale * self._factor), 1.0]))  # a mirror image is turned outward
        return scaled


def _read(path: Path, notes: list[str]) -> trimesh.Trimesh | None:
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


def primitive(kind: int, size: Array) -> trimesh.Trimesh | None:
    """Return one of MuJoCo's shapes, in its own frame, from its sizes [m]; None: it has no volume."""
    geom = mujoco.mjtGeom
    match geom(kind):
        case geom.mjGEOM_BOX:
            return trimesh.creation.box(extents=2 * size)
        case geom.mjGEOM_SPHERE:
            return trimesh.creation.icosphere(subdivisions=2, radius=size[0])
        case geom.mjGEOM_CYLINDER:
            return trimesh.creation.cylinder(radius=size[0], height=2 * size[1], sections=24)
        case geom.mjGEOM_CAPSULE:
            return trimesh.creation.capsule(radius=size[0], height=2 * size[1], count=[16, 16])
        case geom.mjGEOM_ELLIPSOID:
            ball = trimesh.creation.icosphere(subdivisions=2, radius=1.0)
            ball.apply_scale(size)
            return ball
        case _:
            return None


def joined(meshes: Iterable[trimesh.Trimesh]) -> trimesh.Trimesh | None:
    """Return several meshes as one, overlaps and all; None of none."""
    parts = list(meshes)
    whole = trimesh.util.concatenate(parts) if parts else None
    return whole if isinstance(whole, trimesh.Trimesh) else None


def solid_properties(mesh: trimesh.Trimesh) -> tuple[float, Array, Array, str] | None:
    """Return volume [m³], centre [m], inertia for 1 kg [m²], and what was taken for the solid.

    That is the mesh if it is closed, else its convex hull. None: it is flat.
    """
    closed = mesh.is_watertight and mesh.volume > 0
    try:
        solid = mesh if closed else mesh.convex_hull
    except Exception:  # qhull's own error for flat points
        return None
    if not np.isfinite(solid.volume) or solid.volume < 1e-9:
        return None
    inertia = np.asarray(solid.moment_inertia) / solid.mass
    return float(solid.volume), np.asarray(solid.center_mass), inertia, "mesh" if closed else "mesh's hull"


def ball(mass: float) -> Array:
    """Return the inertia of a steel ball about its centre [kg·m²], shape (3, 3)."""
    radius = (mass / STEEL / (4 / 3 * np.pi)) ** (1 / 3)
    return 0.4 * mass * radius**2 * np.eye(3)


def showable(mesh: trimesh.Trimesh, name: str, notes: list[str]) -> trimesh.Trimesh | None:
    """Return the mesh if MuJoCo can show it, or else its hull, with a note; None: neither."""
    for candidate, what in ((mesh, "its hull is shown"), (mesh.convex_hull, "it is not shown")):
        spec = mujoco.MjSpec()
        spec.assets = {"a.stl": stl(candidate)}
        spec.add_mesh(name="a", file="a.stl")
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="a", mass=0)
        try:
            with mujoco_errors(f"mesh of {name}"):
                spec.compile()
            return candidate
        except ModelError as error:
            notes.append(f"{error}: {what}")
    return None


def stl(mesh: trimesh.Trimesh) -> bytes:
    """Return a mesh as binary STL."""
    content = mesh.export(file_type="stl")
    assert isinstance(content, bytes)
    return content
