"""A URDF or MJCF file -> MuJoCo's spec of it, with its meshes of any format as STL files in m."""

import re
from collections.abc import Sequence
from contextlib import suppress
from itertools import chain, islice
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import trimesh

from hydroid.arrays import Array
from hydroid.errors import ModelError
from hydroid.files import is_file
from hydroid.mjcf import mujoco_errors
from hydroid.words import distinct, listed

MESHES = "links"  # folder of the meshes beside the model
SHOWN, HIDDEN = 2, 3  # groups of shapes that are seen, and of those that only collide
URDF_OPTIONS = {"discardvisual": "false", "fusestatic": "false", "strippath": "true"}
"""keep what MuJoCo drops from a URDF by default: visuals, and links that no joint moves"""
REFUSED = {
    "sdf": ("is an SDF", "convert it: sdformat2mjcf {name} arm.xml (pip install sdformat-mjcf)"),
    "usd": ("is a USD stage", "export the arm as URDF or MJCF (Isaac Sim: the URDF exporter)"),
    "xacro": ("is a xacro, not a URDF", "expand it first: xacro {name} > robot.urdf"),
}
"""files that hold robots and are not read, and what to do"""
IGNORED = "extension plugin sensor texture hfield skin flex flexcomp composite size"
"""elements of an MJCF that the arm does not need, whose files or libraries are often missing"""


class Notes:
    """What an import assumed, left out or mended: sentences with the names of what they are about."""

    def __init__(self) -> None:
        self._parts: dict[str, list[str]] = {}

    def add(self, sentence: str, *parts: str) -> None:
        """Say a sentence about parts of the robot; the parts of equal sentences stand in one line."""
        names = self._parts.setdefault(sentence, [])
        names += [part for part in parts if part not in names]

    def lines(self) -> Sequence[str]:
        """Return a line for each sentence."""
        return [f"{listed(parts, 4)}: {what}" if parts else what for what, parts in self._parts.items()]


def read_source(path: Path, notes: Notes) -> tuple[mujoco.MjSpec, dict[str, Path], bool]:
    """Read a URDF or an MJCF: its spec, where each mesh file that it names lies, and whether it is a URDF."""
    usd = path.suffix.lower() in (".usd", ".usda", ".usdc", ".usdz")
    root = ElementTree.Element("usd") if usd else _parsed(path)
    kind = "xacro" if any("xacro" in str(part.tag).lower() for part in root.iter()) else str(root.tag)
    if kind in REFUSED:
        what, hint = REFUSED[kind]
        raise ModelError(what, path, hint.format(name=path.name))
    urdf, folder = kind == "robot", path.resolve().parent
    if not urdf and kind != "mujoco":
        what = f"is neither URDF nor MJCF: its root element is <{root.tag}>"
        raise ModelError(what, path, "export the arm as URDF")
    files = _prepare_urdf(root, notes) if urdf else {}
    if not urdf:
        _prepare_mjcf(root, folder)
    with mujoco_errors(path):
        spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
    if not urdf:
        files = {mesh.file: mesh.file for mesh in spec.meshes if mesh.file}
        folder /= spec.meshdir
    # from the folder and its parents, with and without a package's name, or by name
    below = {path.name.lower(): path for path in islice(folder.rglob("*"), 20_000)} if files else {}
    found = dict[str, Path]()
    for name, given in files.items():
        rest = Path(given.rpartition("://")[2].replace("\\", "/").lstrip("/"))
        tails = (Path(given), rest, Path(*rest.parts[1:]))
        tried = (place / tail for place in (folder, *islice(folder.parents, 4)) for tail in tails)
        alike = below.get(rest.name.lower(), folder)  # a folder is no file
        if place := next(filter(is_file, chain(tried, [alike])), None):
            found[name] = place
        else:
            what = "nor by name below it: these shapes are not shown"
            notes.add(f"not found from {folder} and its parents, {what}", f"mesh {given}")
    return spec, found, urdf


def _parsed(path: Path) -> ElementTree.Element:
    try:
        return ElementTree.fromstring(path.read_bytes())
    except (ElementTree.ParseError, OSError, ValueError) as error:
        raise ModelError(f"cannot be read as XML ({error})", path) from None


def _prepare_urdf(root: ElementTree.Element, notes: Notes) -> dict[str, str]:
    """Let MuJoCo keep all of a URDF, and return what it says of each mesh by a plain file name."""
    children = {child.get("link") for child in root.iterfind("joint/child")}
    for link in root.iterfind("link"):
        if link.get("name") not in children:
            notes.add("root link, the fixed base: its mass does not matter", str(link.get("name")))
    for joint in root.iterfind("joint[@type='planar']"):  # MuJoCo makes three joints of it
        joint.set("type", "fixed")
        notes.add("moving in a plane, which hydroid does not model: held at 0", str(joint.get("name")))
    names: dict[str, str] = {}
    for mesh in root.iterfind("link/*/geometry/mesh"):
        mesh.set("filename", names.setdefault(str(mesh.get("filename")), f"mesh{len(names)}.stl"))
    section = root
    for tag in ("mujoco", "compiler"):
        there = section.find(tag)
        section = ElementTree.SubElement(section, tag) if there is None else there
    section.attrib.update(URDF_OPTIONS)
    return {name: given for given, name in names.items()}


def _prepare_mjcf(root: ElementTree.Element, folder: Path) -> None:
    """Put included files in their places, and take out what the arm does not need."""
    for parent in [*root.iter()]:
        for at, part in reversed([*enumerate(parent)]):
            if part.tag == "include":
                inner = _parsed(folder / str(part.get("file")))
                _prepare_mjcf(inner, folder)
                parent[at : at + 1] = [*inner]
            elif part.tag in IGNORED.split() or "hfield" in (part.get("type"), *part.keys()):
                parent.remove(part)
            elif part.tag == "material":
                part.attrib.pop("texture", None)


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
        collide = [bool(geom.contype or geom.conaffinity) for geom in body.geoms]
        for geom, solid in zip(body.geoms, collide, strict=True):
            geom.group = HIDDEN if solid and not all(collide) else SHOWN
            geom.contype = geom.conaffinity = int(solid or not any(collide))
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
