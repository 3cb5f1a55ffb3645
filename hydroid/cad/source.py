"""A URDF or MJCF file -> MuJoCo's spec of it with hinges alone, and where its meshes are."""

from itertools import chain, islice
from pathlib import Path
from xml.etree import ElementTree

import mujoco

from hydroid.errors import ModelError
from hydroid.files import is_file
from hydroid.mjcf import mujoco_errors

URDF_OPTIONS = {"discardvisual": "false", "fusestatic": "false", "strippath": "true"}
"""keep what MuJoCo drops from a URDF by default: visuals, and links that no joint moves"""
HELD = {
    mujoco.mjtJoint.mjJNT_SLIDE: "slides",
    mujoco.mjtJoint.mjJNT_FREE: "floats freely",
    mujoco.mjtJoint.mjJNT_BALL: "is a ball joint",
}
"""kinds of joints that hydroid does not move, and what they do"""


def read_source(path: Path, notes: list[str]) -> tuple[mujoco.MjSpec, dict[str, Path], bool]:
    """Read a URDF or an MJCF without the joints that hydroid does not move.

    Returns:
        MuJoCo's spec, where each file of a mesh that it names lies, and whether the file is a URDF.

    Raises:
        ModelError: missing, not XML, of another kind, a xacro, or refused by MuJoCo.
    """
    where = str(path)
    if not is_file(path):
        raise ModelError("no such robot", where=where, hint="give a URDF or an MJCF file")
    try:
        root = ElementTree.fromstring(path.read_bytes())
    except (ElementTree.ParseError, OSError, ValueError) as error:
        raise ModelError(f"cannot be read as XML ({error})", where=where) from None
    if any("xacro" in str(element.tag).lower() for element in root.iter()):
        hint = f"expand it first: xacro {path.name} > robot.urdf"
        raise ModelError("is a xacro, not a URDF", where=where, hint=hint)
    urdf, folder = root.tag == "robot", path.resolve().parent
    if not urdf and root.tag != "mujoco":
        what = f"is neither URDF nor MJCF: its root element is <{root.tag}>"
        raise ModelError(what, where=where, hint="export the arm as URDF")
    with mujoco_errors(where):
        if urdf:
            files = _prepare_urdf(root, notes)
            spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
        else:
            spec = mujoco.MjSpec.from_file(where)
            files = {mesh.file: mesh.file for mesh in spec.meshes if mesh.file}
            folder /= spec.meshdir
    found = {name: _find(given, folder, notes) for name, given in files.items()}
    _hold_joints(spec, notes)
    return spec, {name: place for name, place in found.items() if place}, urdf


def _prepare_urdf(root: ElementTree.Element, notes: list[str]) -> dict[str, str]:
    """Let MuJoCo keep all of a URDF, and return what it says of each mesh by a plain file name."""
    children = {child.get("link") for child in root.iterfind("joint/child")}
    for link in root.iterfind("link"):
        if link.get("name") not in children:
            notes.append(f"the root link {link.get('name')} is the fixed base: its mass does not matter")
    for joint in root.iterfind("joint[@type='planar']"):  # MuJoCo makes three joints of it
        joint.set("type", "fixed")
        notes.append(_held(str(joint.get("name")), "moves in a plane"))
    names: dict[str, str] = {}
    for mesh in root.iterfind("link/*/geometry/mesh"):
        mesh.set("filename", names.setdefault(str(mesh.get("filename")), f"mesh{len(names)}.stl"))
    section = root.find("mujoco")
    section = ElementTree.SubElement(root, "mujoco") if section is None else section
    compiler = section.find("compiler")
    compiler = ElementTree.SubElement(section, "compiler") if compiler is None else compiler
    compiler.attrib.update(URDF_OPTIONS)
    return {name: given for given, name in names.items()}


def _find(given: str, folder: Path, notes: list[str]) -> Path | None:
    """Look for a mesh from the folder and its parents, with and without its package's name, or by name."""
    rest = Path(given.rpartition("://")[2])
    places = (folder, *islice(folder.parents, 4))
    tried = [place / tail for place in places for tail in (rest, Path(*rest.parts[1:]))]
    alike = (path for path in islice(folder.rglob("*"), 20_000) if path.name == rest.name)
    found = next((path for path in chain(tried, alike) if is_file(path)), None)
    if found is None:
        looked = f"{tried[0]}, {tried[-1]} and {rest.name} below {folder}"
        notes.append(f"mesh {given} is not there; looked for {looked}")
    return found


def _hold_joints(spec: mujoco.MjSpec, notes: list[str]) -> None:
    """Delete the joints that are no hinges or follow others, and say so of all that is left out."""
    followers: dict[str, str] = {}
    for equality in spec.equalities:
        if equality.type == mujoco.mjtEq.mjEQ_JOINT:
            followers[equality.name1] = f"mimics {equality.name2}" if equality.name2 else "has an equality"
        else:
            notes.append(f"equality {equality.name or '(unnamed)'} is left out: hydroid models serial arms")
    for joint in list(spec.joints):
        name = joint.name or f"of {joint.parent.name}"
        if name in followers:
            notes.append(f"joint {name} {followers[name]}, which hydroid does not model: it is held at 0")
        elif joint.type in HELD:
            notes.append(_held(name, HELD[joint.type]))
        else:
            continue
        spec.delete(joint)
    if spec.actuators:
        notes.append(f"its {len(spec.actuators)} actuators are left out: the hydraulics take their place")


def _held(joint: str, what: str) -> str:
    return f"joint {joint} {what}: hydroid moves hinges only, so it is held at 0"
