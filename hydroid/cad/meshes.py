"""Meshes of any format and unit -> STL files in m that MuJoCo takes."""

import warnings
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import trimesh

from hydroid.arrays import Array, record
from hydroid.cad.repair import bare_model
from hydroid.cad.source import Notes, word
from hydroid.errors import ModelError
from hydroid.mjcf import mujoco_errors
from hydroid.words import distinct

MESHES = "links"  # folder of the meshes beside the model
UNITS = {1.0: "m", 1e-2: "cm", 1e-3: "mm"}
"""of mesh files, which do not say theirs, by what one is in m"""
MOST_FACES = 200_000  # of a mesh that MuJoCo reads
LARGEST = 1e7  # of a vertex in any of these units: no machine is 10 km long
# length of a mesh over the longest distance between joints: no part of the arm
TOO_LONG = 5.0
# length of what is seen of a link over its own distance: a link is no pin
TOO_SHORT = 1 / 30
# the same of the fixed base, over the longest distance: it may be small
BRACKET = 1 / 300
# part of the longest distance between joints from which a link's own tells its meshes'
# unit
SPEAKS = 0.3
LONGEST = 50.0  # mesh of an arm whose joints tell no distance [m]


@record
class _Reach:
    """Distances from a joint to the next one [m], by the link between them,
    and the link of each body.

    What no joint moves is part of the fixed base, "".
    """

    own: Mapping[str, float]
    link: Mapping[str, str]

    @property
    def longest(self) -> float:
        """The longest of them [m], 0 where there is none."""
        return max(self.own.values(), default=0.0)

    def clear(self, links: Collection[str]) -> dict[str, float]:
        """Return the distances, by link, that are long enough to tell the unit of a
        link's meshes."""
        least = SPEAKS * self.longest
        return {
            link: distance
            for link, distance in self.own.items()
            if distance >= least and link in links
        }

    def nearest(self, length: float, of: float) -> float:
        """Return the unit [m] in which a mesh of a length is most like a distance
        [m]."""
        return min(UNITS, key=lambda unit: abs(np.log(length * unit / of)))


def convert_meshes(
    spec: mujoco.MjSpec, files: dict[str, Path], exact: bool, notes: Notes
) -> tuple[dict[str, bytes], set[str]]:
    """Turn the meshes into STL files in m and delete those that cannot be shown.

    `exact`: no link has its inertia by what the file says of its meshes, so that the
    best way may be taken. Returned are the files by their path from the model, and the
    bodies that lost a mesh.
    """
    read = _read_meshes(files, notes)
    units = _units(spec, files, read, notes)
    stl_names = _stl_names({name: files[name] for name in read})
    assets = dict[str, bytes]()
    lost = set[str]()
    for mesh in list(spec.meshes):
        if not mesh.file:
            continue
        shapes = [geom for geom in spec.geoms if geom.meshname == mesh.name]
        mesh.scale = mesh.scale * units.get(mesh.name, 1.0)
        source = None
        if shapes:
            source = read.get(mesh.file)
        shown = source and _shown_stl(source, mesh.scale, files[mesh.file].name, notes)
        if not shown:
            lost.update(geom.parent.name for geom in shapes)
            _delete(spec, [*shapes, mesh])
            continue
        content, inertia = shown
        mesh.file = stl_names[mesh.file]
        assets[mesh.file] = content
        if exact or inertia == mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL:
            mesh.inertia = inertia
    spec.meshdir = ""
    spec.strippath = False
    spec.assets = assets
    return assets, lost


def _delete(spec: mujoco.MjSpec, parts: Sequence[Any]) -> None:
    for part in parts:
        spec.delete(part)


def _stl_names(files: Mapping[str, Path]) -> dict[str, str]:
    """Return the path from the model of each mesh's STL file, all different."""
    taken = set[str]()
    return {
        name: f"{MESHES}/{distinct(word(path.stem), taken)}.stl"
        for name, path in files.items()
    }


def _read_meshes(files: Mapping[str, Path], notes: Notes) -> dict[str, trimesh.Trimesh]:
    """Return the meshes that can be read, by the names that the spec has for their
    files."""
    read = dict[str, trimesh.Trimesh]()
    for name, path in files.items():
        mesh = _read_mesh(path, notes)
        if mesh is not None:
            read[name] = mesh
    return read


def _units(
    spec: mujoco.MjSpec,
    files: Mapping[str, Path],
    read: Mapping[str, trimesh.Trimesh],
    notes: Notes,
) -> dict[str, float]:
    """Return the unit of each mesh that is used [m], by its name.

    Most meshes of a file have one unit: the one in which most links are as long as
    their joints are apart. A mesh that this makes far too long or too short has its
    own.
    """
    lengths = _lengths(spec, read)
    body_of = {g.meshname: g.parent.name for g in spec.geoms if lengths.get(g.meshname)}
    if not body_of:
        return {}
    reach = _reach(spec, notes)
    # the longest mesh of each link
    longest = dict[str, float]()
    for mesh, body in body_of.items():
        link = reach.link[body]
        longest[link] = max(longest.get(link, 0.0), lengths[mesh])
    clear = reach.clear(longest)
    common = _common_unit(reach, clear, longest)
    units = dict[str, float]()
    for mesh, body in body_of.items():
        link = reach.link[body]
        distance = clear.get(link, reach.longest)
        least = distance * _least_part(link, clear)
        units[mesh] = _own_unit(
            reach, common, lengths[mesh], longest[link], (least, distance)
        )
    file_of = {
        mesh.name: files[mesh.file].name for mesh in spec.meshes if mesh.name in units
    }
    _tell_units(units, common, lengths, file_of, notes)
    return units


def _lengths(
    spec: mujoco.MjSpec, read: Mapping[str, trimesh.Trimesh]
) -> dict[str, float]:
    """Return the lengths of meshes in their own units, by name."""
    lengths = dict[str, float]()
    for mesh in spec.meshes:
        if mesh.file in read:
            extents = read[mesh.file].extents * np.abs(mesh.scale)
            lengths[mesh.name] = float(np.max(extents))
    return lengths


def _own_unit(
    reach: _Reach,
    common: float,
    length: float,
    longest: float,
    wanted: tuple[float, float],
) -> float:
    """Return the unit of a mesh of a length [m]: the common one, unless that cannot be.

    `longest` is the length of the longest mesh of its link, which is at least as long
    as the first of `wanted` and most likely as long as the second [m].
    """
    if not reach.longest:
        return common
    least, likely = wanted
    if longest * common < least:
        return reach.nearest(longest, likely)
    if length * common > TOO_LONG * reach.longest:
        return reach.nearest(length, likely)
    return common


def _common_unit(
    reach: "_Reach", clear: Mapping[str, float], longest: Mapping[str, float]
) -> float:
    """Return the unit in which most links are as long as the distances between joints
    tell [m]."""
    if clear:
        votes = [
            reach.nearest(longest[link], distance) for link, distance in clear.items()
        ]
        return max(UNITS, key=votes.count)
    return 1e-3 if max(longest.values()) > LONGEST else 1.0


def _least_part(link: str, clear: Mapping[str, float]) -> float:
    """Return the part of a distance between joints that a link is at least long."""
    if link in clear:
        return TOO_SHORT
    return 0.0 if link else BRACKET


def _tell_units(
    units: Mapping[str, float],
    common: float,
    lengths: Mapping[str, float],
    file_of: Mapping[str, str],
    notes: Notes,
) -> None:
    """Say which units were taken, where a reader might expect m."""
    odd = {mesh: unit for mesh, unit in units.items() if unit != common}
    if common != 1.0:
        usual = max((lengths[mesh] for mesh in units if mesh not in odd), default=0.0)
        which = "all but the following" if odd else "all"
        notes.add(
            f"meshes up to {usual:.4g} m long: {which} are taken to be in {UNITS[common]}"
        )
    for mesh, unit in odd.items():
        what = f"taken to be in {UNITS[unit]}, by the distances of the joints"
        notes.add(what, f"mesh {file_of[mesh]} ({lengths[mesh]:.4g} m long)")


def _reach(spec: mujoco.MjSpec, notes: Notes) -> _Reach:
    model, data = bare_model(spec, notes.path)
    link_of = [model.body(int(at)).name if at else "" for at in model.body_weldid]
    distances = dict[str, float]()
    for joint in range(model.njnt):
        above = link_of[int(model.body_parentid[model.jnt_bodyid[joint]])]
        if not above:
            continue
        first = data.joint(int(model.body(above).jntadr[0])).xanchor
        distance = float(np.linalg.norm(data.joint(joint).xanchor - first))
        distances[above] = max(distances.get(above, 0.0), distance)
    return _Reach(
        own={link: distance for link, distance in distances.items() if distance > 0},
        link={model.body(number).name: link for number, link in enumerate(link_of)},
    )


def _read_mesh(path: Path, notes: Notes) -> trimesh.Trimesh | None:
    """Read a mesh file of any format that trimesh knows; None, with a note: it cannot
    be read."""
    fault = f"mesh {path.name}"
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            # trimesh warns of numbers that are refused below
            warnings.simplefilter("ignore")
            mesh = trimesh.load(path, force="mesh")
    # trimesh's readers raise whatever their format's parser does
    except Exception as error:
        hint = "export them as STL"
        if path.suffix.lower() == ".dae" and isinstance(
            error, ImportError | ValueError
        ):
            hint = f"pip install pycollada, or {hint}"
        notes.add(f"cannot be read; {hint}", fault)
        return None
    is_mesh = isinstance(mesh, trimesh.Trimesh)
    if not is_mesh or not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
        notes.add("holds no triangles; export the solid as STL", fault)
        return None
    if np.abs(mesh.vertices).max() > LARGEST:
        notes.add("larger than any machine: not shown", fault)
        return None
    return mesh


def _shown_stl(
    mesh: trimesh.Trimesh, scale: Array, name: str, notes: Notes
) -> tuple[bytes, mujoco.mjtMeshInertia] | None:
    """Return a mesh as a binary STL, and how MuJoCo takes its inertia; None, with a
    note: it refuses both.

    That is exact where the mesh is closed, else that of its hull, and of no use where
    it is flat.
    """
    if len(mesh.faces) > MOST_FACES:
        notes.add("more triangles than MuJoCo reads: its hull is shown", f"mesh {name}")
        mesh = mesh.convex_hull
    content = mesh.export(file_type="stl")
    assert isinstance(content, bytes)
    kinds = [
        mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX,
        mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    ]
    if mesh.is_volume:
        kinds.insert(0, mujoco.mjtMeshInertia.mjMESH_INERTIA_EXACT)
    for kind in kinds:
        spec = mujoco.MjSpec()
        spec.assets = {"a.stl": content}
        spec.add_mesh(name="a", file="a.stl", scale=scale, inertia=kind)
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="a")
        with suppress(ModelError), mujoco_errors(f"mesh {name}"):
            spec.compile()
            return content, kind
    notes.add("refused by MuJoCo: not shown", f"mesh {name}")
    return None
