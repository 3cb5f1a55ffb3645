"""A URDF or MJCF file -> MuJoCo's spec of it, and where its meshes are."""

from collections.abc import Mapping, Sequence
from itertools import chain, islice
from pathlib import Path
from xml.etree import ElementTree

import mujoco

from hydroid.errors import ModelError
from hydroid.files import is_file
from hydroid.mjcf import mujoco_errors
from hydroid.words import listed

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
    where = str(path)
    usd = path.suffix.lower() in (".usd", ".usda", ".usdc", ".usdz")
    root = ElementTree.Element("usd") if usd else _parsed(path)
    kind = "xacro" if any("xacro" in str(part.tag).lower() for part in root.iter()) else str(root.tag)
    if kind in REFUSED:
        what, hint = REFUSED[kind]
        raise ModelError(what, where, hint.format(name=path.name))
    urdf, folder = kind == "robot", path.resolve().parent
    if not urdf and kind != "mujoco":
        what = f"is neither URDF nor MJCF: its root element is <{root.tag}>"
        raise ModelError(what, where, "export the arm as URDF")
    files = _prepare_urdf(root, notes) if urdf else {}
    if not urdf:
        _prepare_mjcf(root, folder)
    with mujoco_errors(where):
        spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
    if not urdf:
        files = {mesh.file: mesh.file for mesh in spec.meshes if mesh.file}
        folder /= spec.meshdir
    return spec, _found(files, folder, notes), urdf


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


def _found(files: Mapping[str, str], folder: Path, notes: Notes) -> dict[str, Path]:
    """Look for meshes from the folder and its parents, with and without a package's name, or by name."""
    below = {path.name.lower(): path for path in islice(folder.rglob("*"), 20_000)} if files else {}
    found = dict[str, Path]()
    for name, given in files.items():
        rest = Path(given.rpartition("://")[2].replace("\\", "/").lstrip("/"))
        tails = (Path(given), rest, Path(*rest.parts[1:]))
        tried = (place / tail for place in (folder, *islice(folder.parents, 4)) for tail in tails)
        alike = [below[rest.name.lower()]] if rest.name.lower() in below else []
        if place := next((path for path in chain(tried, alike) if is_file(path)), None):
            found[name] = place
        else:
            what = (
                f"not found from {folder} and its parents, nor by name below it: these shapes are not shown"
            )
            notes.add(what, f"mesh {given}")
    return found
