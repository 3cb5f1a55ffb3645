"""A URDF or MJCF file -> MuJoCo's spec of it with hinges alone, and where its meshes are."""

from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from xml.etree import ElementTree

import mujoco

from hydroid.errors import ModelError
from hydroid.files import is_file
from hydroid.mjcf import mujoco_errors

URDF_OPTIONS = {"discardvisual": "false", "fusestatic": "false", "strippath": "true"}
"""keep what MuJoCo drops from a URDF by default: visuals, and links that no joint moves"""
HELD = {"prismatic": "slides", "floating": "floats freely", "planar": "moves in a plane"}
"""kinds of a URDF's joints that hydroid does not move, and what they do"""
HELD_IN_MJCF = {
    mujoco.mjtJoint.mjJNT_SLIDE: "slides",
    mujoco.mjtJoint.mjJNT_FREE: "floats freely",
    mujoco.mjtJoint.mjJNT_BALL: "is a ball joint",
}


@dataclass
class Source:
    """A file as MuJoCo reads it, without the joints that hydroid does not move.

    Attributes:
        path: the file.
        spec: MuJoCo's.
        urdf: whether it is a URDF.
        meshes: where each file that the spec names lies, by that name.
        notes: a line for each thing that was assumed, left out or mended.
    """

    path: Path
    spec: mujoco.MjSpec
    urdf: bool
    meshes: dict[str, Path] = field(default_factory=dict[str, Path])
    notes: list[str] = field(default_factory=list[str])


def read_source(path: Path) -> Source:
    """Read a URDF or an MJCF.

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
    if root.tag == "robot":
        return _urdf(path, root)
    if root.tag == "mujoco":
        return _mjcf(path)
    what = f"is neither URDF nor MJCF: its root element is <{root.tag}>"
    raise ModelError(what, where=where, hint="export the arm as URDF")


def _urdf(path: Path, root: ElementTree.Element) -> Source:
    source, mimics = Source(path, mujoco.MjSpec(), urdf=True), list[str]()
    children = {child.get("link") for child in root.iterfind("joint/child")}
    for link in root.iterfind("link"):
        if link.get("name") not in children:
            source.notes.append(
                f"the root link {link.get('name')} is the fixed base: its mass does not matter"
            )
    for joint in root.iterfind("joint"):
        name, kind = str(joint.get("name")), str(joint.get("type"))
        mimic = joint.find("mimic")
        if mimic is not None:
            joint.remove(mimic)
            mimics.append(name)
            source.notes.append(
                f"joint {name} mimics {mimic.get('joint')}, which hydroid does not model: it is held at 0"
            )
        elif kind in HELD:
            joint.set("type", "fixed")  # MuJoCo refuses some of them
            source.notes.append(f"joint {name} {HELD[kind]}: hydroid moves hinges only, so it is held at 0")
    _find_urdf_meshes(source, root)
    section = root.find("mujoco")
    section = ElementTree.SubElement(root, "mujoco") if section is None else section
    compiler = section.find("compiler")
    compiler = ElementTree.SubElement(section, "compiler") if compiler is None else compiler
    compiler.attrib.update(URDF_OPTIONS)
    with mujoco_errors(str(path)):
        source.spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
    for name in mimics:
        source.spec.delete(source.spec.joint(name))
    return source


def _find_urdf_meshes(source: Source, root: ElementTree.Element) -> None:
    """Give every mesh a plain file name, and take out the shapes whose mesh is not there."""
    names: dict[str, str] = {}
    for link in root.iterfind("link"):
        for shape in [s for s in link if s.tag in ("visual", "collision")]:
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                continue
            given = str(mesh.get("filename"))
            if given not in names:
                found, looked = _find(given, source.path.resolve().parent)
                names[given] = f"mesh{len(names)}.stl" if found else ""
                if found:
                    source.meshes[names[given]] = found
                else:
                    source.notes.append(f"mesh {given} is not there; looked for {looked}")
            if names[given]:
                mesh.set("filename", names[given])
            else:
                link.remove(shape)


def _find(given: str, folder: Path) -> tuple[Path | None, str]:
    """Return where a mesh lies, and what was looked for."""
    scheme, _, rest = given.rpartition("://")
    parts = Path(rest).parts
    tried: list[Path] = []
    if scheme in ("package", "model") and len(parts) > 1:
        inside = Path(*parts[1:])
        for place in [folder, *islice(folder.parents, 4)]:
            tried += [place / rest, place / inside]
    else:
        tried = [folder / rest, Path(rest)]
    last = parts[-1] if parts else given
    alike = (path for path in islice(folder.rglob("*"), 20_000) if parts and path.name == last)
    found = next((path for path in tried if is_file(path)), None) or next(alike, None)
    return found, f"{tried[0]}, {tried[-1]} and {last} below {folder}"


def _mjcf(path: Path) -> Source:
    with mujoco_errors(str(path)):
        source = Source(path, mujoco.MjSpec.from_file(str(path)), urdf=False)
    spec, notes = source.spec, source.notes
    folder = path.resolve().parent / spec.meshdir
    for mesh in spec.meshes:
        if mesh.file:
            found = next((p for p in (folder / mesh.file, folder / Path(mesh.file).name) if is_file(p)), None)
            if found:
                source.meshes[mesh.file] = found
            else:
                notes.append(f"mesh {mesh.file} is not there; looked for {folder / mesh.file}")
    followers: dict[str, str] = {}
    for equality in spec.equalities:
        if equality.type == mujoco.mjtEq.mjEQ_JOINT:
            leader = equality.name2
            followers[equality.name1] = f"follows {leader}" if leader else "is held by an equality"
        else:
            notes.append(f"equality {equality.name or '(unnamed)'} is left out: hydroid models serial arms")
    for joint in list(spec.joints):
        name = joint.name or f"of {joint.parent.name}"
        if joint.type in HELD_IN_MJCF:
            what = HELD_IN_MJCF[joint.type]
            notes.append(f"joint {name} {what}: hydroid moves hinges only, so it is held at 0")
        elif name in followers:
            notes.append(f"joint {name} {followers[name]}, which hydroid does not model: it is held at 0")
        else:
            continue
        spec.delete(joint)
    if spec.actuators:
        notes.append(f"its {len(spec.actuators)} actuators are left out: the hydraulics take their place")
    return source
