"""A URDF or MJCF file -> MuJoCo's spec of it, and where its meshes lie."""

import re
from collections.abc import Sequence
from itertools import chain, islice
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

import mujoco
import numpy as np

from hydroid.errors import ModelError
from hydroid.files import is_file
from hydroid.mjcf import mujoco_errors
from hydroid.robot_xml import read_robot
from hydroid.words import listed

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
    """What an import assumed, left out or mended: sentences with the names of what they are about.

    `path` is the robot's file, which errors name.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._parts: dict[str, list[str]] = {}

    def add(self, sentence: str, *parts: str) -> None:
        """Say a sentence about parts of the robot;
        the parts of equal sentences stand in one line."""
        names = self._parts.setdefault(sentence, [])
        names += [part for part in parts if part not in names]

    def lines(self) -> Sequence[str]:
        """Return a line for each sentence."""
        return [f"{listed(parts, 4)}: {what}" if parts else what for what, parts in self._parts.items()]


def read_source(path: Path, notes: Notes) -> tuple[mujoco.MjSpec, dict[str, Path], bool]:
    """Read a URDF or an MJCF: its spec, where each mesh file that it names lies,
    and whether it is a URDF."""
    usd = path.suffix.lower() in (".usd", ".usda", ".usdc", ".usdz")
    root = ElementTree.Element("usd") if usd else read_robot(path)
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
        _prepare_mjcf(root)
    with mujoco_errors(path):
        spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
    if not urdf:
        files = {mesh.file: mesh.file for mesh in spec.meshes if mesh.file}
        folder /= spec.meshdir
    return spec, _found(files, folder, notes), urdf


def _found(files: dict[str, str], folder: Path, notes: Notes) -> dict[str, Path]:
    """Return where mesh files lie, by the names that the spec has for them.

    A file is where it is said to be, or else there from the folder or one of its parents, by as
    many of its last folders as are there; or it has its name below the folder.
    """
    below = {path.name.lower(): path for path in islice(folder.rglob("*"), 20_000)} if files else {}
    found = dict[str, Path]()
    for name, given in files.items():
        scheme, colon, rest = given.partition(":")
        is_uri = colon and len(scheme) > 1  # C: is a disk
        text = unquote(rest.removeprefix("//")) if is_uri else given
        plain = Path(text.replace("\\", "/"))
        parts = [part for part in plain.parts if part != plain.anchor]
        tails = [plain, *(Path(*parts[k:]) for k in range(len(parts) - 1))]
        tried = (place / tail for tail in tails for place in (folder, *islice(folder.parents, 4)))
        alike = below.get(plain.name.lower(), folder)  # a folder is no file
        if place := next(filter(is_file, chain(tried, [alike])), None):
            found[name] = place
        else:
            what = "nor by name below it: these shapes are not shown"
            notes.add(f"not found from {folder} and its parents, {what}", f"mesh {given}")
    return found


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


def _prepare_mjcf(root: ElementTree.Element) -> None:
    """Take out what the arm does not need."""
    for parent in [*root.iter()]:
        for part in [*parent]:
            if part.tag in IGNORED.split() or "hfield" in (part.get("type"), *part.keys()):
                parent.remove(part)
            elif part.tag == "material":
                part.attrib.pop("texture", None)


def sort_shapes(spec: mujoco.MjSpec) -> None:
    """Show what the file shows, or else what collides; let collide what collides,
    or else what is shown."""
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
