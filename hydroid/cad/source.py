"""A URDF or MJCF file -> MuJoCo's spec of it, and where its meshes lie."""

import re
from collections.abc import Sequence
from itertools import islice, product
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

SHOWN = 2
"""group of shapes that are seen"""
HIDDEN = 3
"""group of shapes that only collide"""
UNSAID_COLOUR = (0.5, 0.5, 0.5, 1.0)
"""MuJoCo's of shapes of which the file says nothing"""
COLOUR = (0.94, 0.53, 0.08, 1.0)
"""of these, here: a machine's orange"""
MOST_FILES = 20_000
"""below the robot's folder, among which a mesh is looked for by its name"""
USD = (".usd", ".usda", ".usdc", ".usdz")
"""endings of USD stages"""
ONCE = "origin axis limit parent child mimic inertial mass inertia geometry"
"""elements of a URDF of which each parent has one"""
URDF_OPTIONS = {"discardvisual": "false", "fusestatic": "false", "strippath": "true"}
"""keep what MuJoCo drops from a URDF by default: visuals, and links that no joint
moves"""
REFUSED = {
    "sdf": (
        "is an SDF",
        "convert it: sdformat2mjcf {name} arm.xml (pip install sdformat-mjcf)",
    ),
    "usd": (
        "is a USD stage",
        "export the arm as URDF or MJCF (Isaac Sim: the URDF exporter)",
    ),
    "xacro": ("is a xacro, not a URDF", "expand it first: xacro {name} > robot.urdf"),
}
"""files that hold robots and are not read, and what to do"""
IGNORED = "extension plugin sensor texture hfield skin flex flexcomp composite size"
"""elements of an MJCF that the arm does not need, whose files or libraries are often
missing"""


class Notes:
    """What an import assumed, left out or mended: sentences with the names of what they
    are about.

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
        lines = list[str]()
        for sentence, parts in self._parts.items():
            lines.append(f"{listed(parts, 4)}: {sentence}" if parts else sentence)
        return lines


def read_source(
    path: Path, notes: Notes
) -> tuple[mujoco.MjSpec, dict[str, Path], bool]:
    """Read a URDF or an MJCF: its spec, where each mesh file that it names lies,
    and whether it is a URDF.

    Raises:
        ModelError: a file of another kind, or one that MuJoCo refuses.
    """
    # a USD stage is no XML
    is_usd = path.suffix.lower() in USD
    root = ElementTree.Element("usd") if is_usd else read_robot(path)
    is_xacro = any("xacro" in str(part.tag).lower() for part in root.iter())
    kind = "xacro"
    if not is_xacro:
        kind = str(root.tag)
    if kind in REFUSED:
        what, hint = REFUSED[kind]
        raise ModelError(what, path, hint.format(name=path.name))
    folder = path.resolve().parent
    if kind == "robot":
        files = _prepare_urdf(root, notes)
        spec = _spec(root, path)
        return spec, _found(files, folder, notes), True
    if kind == "mujoco":
        _prepare_mjcf(root)
        spec = _spec(root, path)
        files = {mesh.file: mesh.file for mesh in spec.meshes if mesh.file}
        return spec, _found(files, folder / spec.meshdir, notes), False
    what = f"is neither URDF nor MJCF: its root element is <{root.tag}>"
    raise ModelError(what, path, "export the arm as URDF")


def _spec(root: ElementTree.Element, path: Path) -> mujoco.MjSpec:
    with mujoco_errors(path):
        return mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))


def _found(files: dict[str, str], folder: Path, notes: Notes) -> dict[str, Path]:
    """Return where mesh files lie, by the names that the spec has for them.

    A file is where it is said to be, or else there from the folder or one of its
    parents, by as many of its last folders as are there; or it has its name below the
    folder.
    """
    by_name: dict[str, Path] = {}
    if files:
        below = [*islice(folder.rglob("*"), MOST_FILES)]
        # of several of one name, that in the fewest folders, whatever the disk's order
        below.sort(key=lambda path: (-len(path.parts), str(path)))
        by_name = {path.name.lower(): path for path in below}
    found = dict[str, Path]()
    for name, given in files.items():
        path = _plain_path(given)
        places = _places(path, folder)
        alike = by_name.get(path.name.lower())
        if alike is not None:
            places.append(alike)
        place = next(filter(is_file, places), None)
        if place:
            found[name] = place
        else:
            what = "nor by name below it: these shapes are not shown"
            notes.add(
                f"not found from {folder} and its parents, {what}", f"mesh {given}"
            )
    return found


def _plain_path(given: str) -> Path:
    """Return the path that a mesh's file name or URI means."""
    scheme, colon, rest = given.partition(":")
    # C: is a disk, and no scheme
    is_uri = colon and len(scheme) > 1
    text = given
    if is_uri:
        text = unquote(rest.removeprefix("//"))
    return Path(text.replace("\\", "/"))


def _places(path: Path, folder: Path) -> list[Path]:
    """Return where a file may lie, the likeliest first: by its path,
    and by ever fewer of its folders."""
    parts = [part for part in path.parts if part != path.anchor]
    tails = [path]
    tails += [Path(*parts[k:]) for k in range(len(parts) - 1)]
    folders = [folder, *islice(folder.parents, 4)]
    return [place / tail for tail, place in product(tails, folders)]


def _prepare_urdf(root: ElementTree.Element, notes: Notes) -> dict[str, str]:
    """Let MuJoCo keep all of a URDF, and return what it says of each mesh by a plain
    file name."""
    _leave_first(root, notes)
    children = {child.get("link") for child in root.iterfind("joint/child")}
    for link in root.iterfind("link"):
        if link.get("name") not in children:
            what = "root link, the fixed base: its mass does not matter"
            notes.add(what, str(link.get("name")))
    # MuJoCo makes three joints of it
    for joint in root.iterfind("joint[@type='planar']"):
        joint.set("type", "fixed")
        what = "moving in a plane, which hydroid does not model: held at 0"
        notes.add(what, str(joint.get("name")))
    names: dict[str, str] = {}
    for mesh in root.iterfind("link/*/geometry/mesh"):
        given = str(mesh.get("filename"))
        mesh.set("filename", names.setdefault(given, f"mesh{len(names)}.stl"))
    compiler = _child(_child(root, "mujoco"), "compiler")
    compiler.attrib.update(URDF_OPTIONS)
    return {name: given for given, name in names.items()}


def _leave_first(root: ElementTree.Element, notes: Notes) -> None:
    """Take out elements that stand again where one is allowed: ROS takes the first,
    and MuJoCo refuses the file."""
    for owner in root:
        for parent in [*owner.iter()]:
            for tag in ONCE.split():
                alike = parent.findall(tag)
                for element in alike[1:]:
                    parent.remove(element)
                    if element.attrib != alike[0].attrib:
                        what = f"has another <{tag}>: the first counts, as in ROS"
                        notes.add(what, str(owner.get("name")))


def _child(element: ElementTree.Element, tag: str) -> ElementTree.Element:
    """Return the child of an element with a tag; a new one where there is none."""
    child = element.find(tag)
    if child is None:
        return ElementTree.SubElement(element, tag)
    return child


def _prepare_mjcf(root: ElementTree.Element) -> None:
    """Take out what the arm does not need."""
    ignored = IGNORED.split()
    for parent in [*root.iter()]:
        for part in [*parent]:
            is_height_field = "hfield" in (part.get("type"), *part.keys())
            if part.tag in ignored or is_height_field:
                parent.remove(part)
            elif part.tag == "material":
                part.attrib.pop("texture", None)


def sort_shapes(spec: mujoco.MjSpec) -> None:
    """Show what the file shows, or else what collides; let collide what collides,
    or else what is shown."""
    for body in spec.bodies:
        collide = [bool(geom.contype or geom.conaffinity) for geom in body.geoms]
        for geom, collides in zip(body.geoms, collide, strict=True):
            geom.group = HIDDEN if collides and not all(collide) else SHOWN
            solid = collides or not any(collide)
            geom.contype = geom.conaffinity = int(solid)
            if not geom.material and np.allclose(geom.rgba, UNSAID_COLOUR):
                geom.rgba = COLOUR


def word(name: str) -> str:
    """Return a plain word from any name."""
    plain = re.sub(r"\W", "_", name, flags=re.ASCII) or "arm"
    if plain[0].isdigit():
        return f"_{plain}"
    return plain
