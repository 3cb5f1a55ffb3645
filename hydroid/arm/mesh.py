"""A link's mesh or shape -> volume, centre of mass and inertia at uniform density.

A closed, outward-facing surface fixes the integrals of 1, x and x xᵀ over the volume inside it (divergence
theorem, face by face). A surface that is open, inverted or in other units gives numbers all the same, and
wrong ones: hence the checks.
"""

import math
from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from hydroid.errors import MeshError
from hydroid.files import is_file
from hydroid.settings.parts import Box, Cylinder

LARGEST_LINK = 50.0  # [m]; a link beyond this is taken for one in millimetres
KINDS = (".stl", ".obj")
SMALLEST_VOLUME = 1e-9  # [m³]; one cubic millimetre


@dataclass(frozen=True)
class MassProperties:
    """What a mesh or a shape says of a link whose mass is not known yet."""

    volume: float
    """[m³]"""
    centre: NDArray[np.float64]
    """centre of mass in the mesh's frame [m], shape (3,)"""
    inertia: NDArray[np.float64]
    """inertia tensor about the centre, for a mass of 1 kg [m²], shape (3, 3)"""


def mass_properties(path: Path) -> MassProperties:
    """Read an STL or OBJ file, in m, its origin in the link's joint, and integrate over its inside.

    Raises:
        MeshError: missing, unreadable, empty, non-finite, in millimetres, away from its joint, open,
            inverted, or without volume.
    """
    with np.errstate(all="ignore"):  # what is not finite is refused below
        mesh = read_mesh(path)
        _check(mesh, str(path))
    inertia = np.asarray(mesh.moment_inertia, dtype=float) / mesh.mass
    return MassProperties(
        volume=float(mesh.volume),
        centre=np.asarray(mesh.center_mass, dtype=float),
        inertia=0.5 * (inertia + inertia.T),
    )


def shape_properties(shape: Box | Cylinder) -> MassProperties:
    """Return the same of a block or a round bar."""
    if isinstance(shape, Box):
        square = np.array(shape.size) ** 2
        return MassProperties(
            float(np.prod(shape.size)), np.array(shape.at), np.diag(square.sum() - square) / 12
        )
    low, high = np.array(shape.ends)
    length = float(np.linalg.norm(high - low))
    along, across = (high - low) / length, shape.radius**2 / 4 + length**2 / 12
    inertia = across * np.eye(3) + (shape.radius**2 / 2 - across) * np.outer(along, along)
    return MassProperties(math.pi * shape.radius**2 * length, 0.5 * (low + high), inertia)


def read_mesh(path: Path) -> trimesh.Trimesh:
    """Read an STL or OBJ file as it is, open or closed, in whatever unit.

    Raises:
        MeshError: missing, unreadable, an ASCII STL, or empty.
    """
    where = str(path)
    if not is_file(path):
        raise MeshError("no such mesh", where=where, hint="put the link's STL there, or correct its name")
    if path.suffix.lower() not in KINDS:
        raise MeshError("is neither STL nor OBJ", where=where, hint="export it again, as binary STL")
    if path.suffix.lower() == ".stl":
        _check_stl(path)
    try:
        mesh = trimesh.load(path, force="mesh", process=False)  # processing would drop NaN faces
    except Exception as error:  # trimesh's readers raise whatever their format's parser does
        reason = str(error).strip().splitlines()
        what = f"cannot be read ({reason[0] if reason else type(error).__name__})"
        raise MeshError(what, where=where, hint="export it again, as binary STL") from None
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        hint = "export the solid, not a sketch or an assembly"
        raise MeshError("holds no triangles", where=where, hint=hint)
    return mesh


def _check_stl(path: Path) -> None:
    """A binary STL is as long as its number of faces says; an ASCII one MuJoCo cannot show."""
    try:
        with path.open("rb") as file:
            head = file.read(84)
        size = path.stat().st_size
    except OSError as error:
        raise MeshError(f"cannot be read ({error.strerror})", where=str(path)) from None
    faces = int.from_bytes(head[80:84], "little")
    if len(head) == 84 and size == 84 + 50 * faces:
        return
    if head.lstrip()[:5].lower() == b"solid":
        raise MeshError("is an ASCII STL", where=str(path), hint="export it again, as binary STL")
    needed = f", and {faces} faces would need {84 + 50 * faces}"
    what = f"is no binary STL: it has {size} bytes{needed if len(head) == 84 else ', its head alone is 84'}"
    raise MeshError(what, where=str(path), hint="copy or export it again, as binary STL")


def _check(mesh: trimesh.Trimesh, where: str) -> None:
    for wrong, what, hint in _faults(mesh):
        if wrong:
            raise MeshError(what, where=where, hint=hint)


def _faults(mesh: trimesh.Trimesh) -> Generator[tuple[bool | np.bool_, str, str]]:
    """Each fault's presence, name and hint; what follows supposes that the mesh has none of those before."""
    yield not np.isfinite(mesh.vertices).all(), "has vertices that are not finite", "export it again"
    mesh.merge_vertices()  # an STL names a corner anew in every face
    extent = float(np.ptp(mesh.vertices, axis=0).max())
    millimetres = f"is {extent:.4g} m long, which looks like millimetres"
    yield extent > LARGEST_LINK, millimetres, "export it in metres, or scale it by 0.001"
    away = float(np.linalg.norm(mesh.vertices.mean(axis=0)))
    yield away > LARGEST_LINK, f"lies {away:.4g} m from its origin", "put the origin in the link's joint"
    faces_at_edge = np.unique(mesh.edges_sorted, axis=0, return_counts=True)[1]
    holes = f"is not watertight: {np.count_nonzero(faces_at_edge != 2)} edges do not join exactly two faces"
    yield not mesh.is_watertight, holes, "close its holes in CAD, and export one solid"
    mixed = "has faces that look both inward and outward"
    yield not mesh.is_winding_consistent, mixed, "make its normals consistent"
    inverted = mesh.volume < -SMALLEST_VOLUME
    yield inverted, "is inside out: its volume is negative", "flip its normals"
    yield mesh.volume < SMALLEST_VOLUME, "encloses no volume", "give the solid a thickness, in metres"
