"""Meshes of any format and unit -> STL files in m that MuJoCo takes."""

import warnings
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

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
LARGEST = 1e7  # of a vertex in any of these units: no machine is 10 km long
TOO_LONG = 5.0  # length of a mesh over the longest distance between joints: no part of the arm
TOO_SHORT = 1 / 30  # length of what is seen of a link over its own distance: a link is no pin
BRACKET = 1 / 300  # the same of the fixed base, over the longest distance: it may be small
# part of the longest distance between joints from which a link's own tells its meshes' unit
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

    def nearest(self, length: float, of: float) -> float:
        """Return the unit [m] in which a mesh of a length is most like a distance [m]."""
        return min(UNITS, key=lambda unit: abs(np.log(length * unit / of)))


def convert_meshes(
    spec: mujoco.MjSpec, files: dict[str, Path], exact: bool, notes: Notes
) -> tuple[dict[str, bytes], set[str]]:
    """Turn the meshes into STL files in m and delete those that cannot be shown.

    `exact`: no link has its inertia by what the file says of its meshes, so that the best way may
    be taken. Returned are the files by their path from the model, and the bodies that lost a mesh.
    """
    read = {name: mesh for name, path in files.items() if (mesh := _read_mesh(path, notes)) is not None}
    units = _units(spec, files, read, notes)
    taken: set[str] = set()
    names = {name: f"{MESHES}/{distinct(word(files[name].stem), taken)}.stl" for name in read}
    meshes, lost = dict[str, bytes](), set[str]()
    for mesh in [mesh for mesh in spec.meshes if mesh.file]:
        shapes = [geom for geom in spec.geoms if geom.meshname == mesh.name]
        mesh.scale = mesh.scale * units.get(mesh.name, 1.0)
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


def _units(
    spec: mujoco.MjSpec, files: Mapping[str, Path], read: Mapping[str, trimesh.Trimesh], notes: Notes
) -> dict[str, float]:
    """Return the unit of each mesh that is used [m], by its name.

    Most meshes of a file have one unit: the one in which most links are as long as their joints are
    apart. A mesh that this makes far too long or too short has its own.
    """
    lengths = {
        mesh.name: float(np.max(read[mesh.file].extents * np.abs(mesh.scale)))
        for mesh in spec.meshes
        if mesh.file in read
    }
    of = {geom.meshname: geom.parent.name for geom in spec.geoms if lengths.get(geom.meshname)}
    if not of:
        return {}
    reach, longest = _reach(spec, notes), dict[str, float]()
    for mesh, body in of.items():
        link = reach.link[body]
        longest[link] = max(longest.get(link, 0.0), lengths[mesh])
    told = {link: own for link, own in reach.own.items() if own >= SPEAKS * reach.longest and link in longest}
    if told:
        votes = [reach.nearest(longest[link], own) for link, own in told.items()]
        common = max(UNITS, key=votes.count)
    else:
        common = 1e-3 if max(lengths[mesh] for mesh in of) > LONGEST else 1.0
    units = dict[str, float]()
    for mesh, body in of.items():
        link = reach.link[body]
        own = told.get(link, reach.longest)
        least = own * (TOO_SHORT if link in told else BRACKET if not link else 0.0)
        fits = longest[link] * common >= least and lengths[mesh] * common <= TOO_LONG * reach.longest
        alike = lengths[mesh] if longest[link] * common >= least else longest[link]
        units[mesh] = common if fits or not reach.longest else reach.nearest(alike, own)
    by_name = {mesh.name: files[mesh.file].name for mesh in spec.meshes if mesh.name in units}
    odd = {mesh: unit for mesh, unit in units.items() if unit != common}
    if common != 1.0:
        usual = max((lengths[mesh] for mesh in units if mesh not in odd), default=0.0)
        those = "all but the following" if odd else "all"
        notes.add(f"meshes up to {usual:.4g} m long: {those} are taken to be in {UNITS[common]}")
    for mesh, unit in odd.items():
        what = f"taken to be in {UNITS[unit]}, by the distances of the joints"
        notes.add(what, f"mesh {by_name[mesh]} ({lengths[mesh]:.4g} m long)")
    return units


def _reach(spec: mujoco.MjSpec, notes: Notes) -> _Reach:
    model, data = bare_model(spec, notes.path)
    links = {k: model.body(int(at)).name if at else "" for k, at in enumerate(model.body_weldid)}
    own = dict[str, float]()
    for joint in range(model.njnt):
        above = links[int(model.body_parentid[model.jnt_bodyid[joint]])]
        if above:
            here = data.joint(int(model.body(above).jntadr[0])).xanchor
            apart = float(np.linalg.norm(data.joint(joint).xanchor - here))
            own[above] = max(own.get(above, 0.0), apart)
    return _Reach(
        {link: apart for link, apart in own.items() if apart > 0},
        {model.body(k).name: link for k, link in links.items()},
    )


def _read_mesh(path: Path, notes: Notes) -> trimesh.Trimesh | None:
    """Read a mesh file of any format that trimesh knows; None, with a note: it cannot be read."""
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # of numbers that are refused below
            mesh = trimesh.load(path, force="mesh")
    except Exception as error:  # trimesh's readers raise whatever their format's parser does
        collada = path.suffix.lower() == ".dae" and isinstance(error, ImportError | ValueError)
        cure = "pip install pycollada, or export them as STL" if collada else "export them as STL"
        notes.add(f"cannot be read; {cure}", f"mesh {path.name}")
        return None
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
        notes.add("holds no triangles; export the solid as STL", f"mesh {path.name}")
        return None
    if np.abs(mesh.vertices).max() > LARGEST:
        notes.add("larger than any machine: not shown", f"mesh {path.name}")
        return None
    return mesh


def _shown_stl(
    mesh: trimesh.Trimesh, scale: Array, name: str, notes: Notes
) -> tuple[bytes, mujoco.mjtMeshInertia] | None:
    """Return a mesh as a binary STL, and how MuJoCo takes its inertia; None, with a note:
    it refuses both.

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
