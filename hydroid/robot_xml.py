"""A URDF or MJCF as a tree of elements that can be trusted: its size,
its names and its numbers are checked.

MuJoCo itself takes a NaN for 0 or for the default,
and ends the program where elements are too deep.
"""

import math
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from hydroid.errors import ModelError
from hydroid.files import is_file

LARGEST = 32  # of a file [MiB]
MOST = 200_000  # elements of a file
DEEPEST = 200  # elements in each other, and joints behind each other
FARTHEST = 1e9  # larger numbers are no lengths in any unit
_PLACES = (
    "xyz",
    "rpy",
    "pos",
    "quat",
    "axis",
    "axisangle",
    "xyaxes",
    "zaxis",
    "euler",
    "fromto",
    "anchor",
)
GEOMETRY = {*_PLACES, "radius", "length", "size", "scale", "ref"}
"""attributes that say where things are and how large"""
INERTIAL = {
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
}
"""attributes of a URDF's elements that say what a link weighs"""
OWN_NAMES = ("link", "joint", "body")  # elements whose name may stand once only
NO_NAMES = ("null", "true", "false")  # in YAML
COPIES = 2000  # that an MJCF may ask for


def read_robot(path: Path) -> ElementTree.Element:
    """Read a URDF, or an MJCF with the files that it includes in their places.

    Raises ModelError: a file cannot be read, is too large or too deep, is included
    twice, or holds the same name twice, or a length, place, angle, limit, mass or
    inertia that is no finite number.
    """
    root = _parsed(path)
    _include(root, path, path.resolve().parent, {path.resolve()})
    _check_names(root, path)
    _check_chains(root, path)
    _check_copies(root, path)
    return root


class _Tree(ElementTree.TreeBuilder):
    """Counts what it builds: later steps recurse into it."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path
        self._depth = 0
        self._count = 0

    def start(self, tag: str, attrs: dict[str, str], /) -> ElementTree.Element:
        self._depth += 1
        self._count += 1
        if self._depth > DEEPEST:
            raise ModelError(
                f"its elements are nested more than {DEEPEST} deep", self._path
            )
        if self._count > MOST:
            raise ModelError(f"holds more than {MOST} elements", self._path)
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> ElementTree.Element:
        self._depth -= 1
        return super().end(tag)


def _parsed(path: Path) -> ElementTree.Element:
    try:
        if path.exists() and not is_file(path):
            raise ModelError("is no file", path)
        with path.open("rb") as file:
            data = file.read(LARGEST * 2**20 + 1)
        if len(data) > LARGEST * 2**20:
            raise ModelError(
                f"is larger than {LARGEST} MiB, too large for a robot's description",
                path,
            )
        return ElementTree.fromstring(data, ElementTree.XMLParser(target=_Tree(path)))
    except (ElementTree.ParseError, OSError, ValueError, LookupError) as error:
        raise ModelError(f"cannot be read as XML ({error})", path) from None


def _include(
    root: ElementTree.Element, path: Path, folder: Path, there: set[Path]
) -> None:
    """Put included files in their places, each once, as MuJoCo does:
    what includes itself has no end."""
    for owner, element in _owned(root):
        _check_numbers(owner, element, path)
        if root.tag == "robot":
            _check_inertial(owner, element, path)
        _check_limits(owner, element, path)
    for parent in [*root.iter()]:
        for at, part in reversed([*enumerate(parent)]):
            if part.tag != "include":
                continue
            file = folder / str(part.get("file"))
            if file.resolve() in there:
                raise ModelError(
                    f"includes {part.get('file')} again",
                    path,
                    "MuJoCo takes a file once",
                )
            there.add(file.resolve())
            inner = _parsed(file)
            _include(inner, file, folder, there)
            parent[at : at + 1] = [*inner]


def _owned(root: ElementTree.Element) -> Iterator[tuple[str, ElementTree.Element]]:
    """Yield every element with the words that name it, or the nearest around it that
    has a name."""
    waiting = [("", root)]
    while waiting:
        owner, element = waiting.pop()
        if name := element.get("name"):
            owner = f"{element.tag} {name!r}"
        yield owner, element
        waiting += [(owner, child) for child in element]


def _check_names(root: ElementTree.Element, path: Path) -> None:
    """Refuse a name that two links or two joints share:
    what the file says of it is said of both."""
    if root.tag == "robot":
        elements = [*root]
    else:
        elements = list[ElementTree.Element]()
        for tree in root.findall("worldbody"):
            elements += tree.iter()
    seen = set[tuple[str, str]]()
    for element in elements:
        name = element.get("name", "")
        if element.tag not in OWN_NAMES or not name:
            continue
        if (element.tag, name) in seen:
            raise ModelError(f"has two {element.tag}s {name!r}", path, "rename one")
        if element.tag == "joint" and name.lower() in NO_NAMES:
            what = f"joint {name!r}: settings name joints, and in YAML this word is no text"
            raise ModelError(what, path, "rename it")
        seen.add((element.tag, name))


def _check_chains(root: ElementTree.Element, path: Path) -> None:
    """Refuse links of a URDF that carry themselves, and chains that no program should
    go along."""
    parents = dict[str, str]()
    for joint in root.iterfind("joint"):
        child = _link(joint.find("child"))
        parent = _link(joint.find("parent"))
        # a joint without both MuJoCo refuses
        if child and parent:
            parents[child] = parent
    for link in parents:
        above = link
        count = 0
        while above in parents:
            above = parents[above]
            count += 1
            if above == link:
                what = f"link {link!r} is carried by itself"
                raise ModelError(what, path, "correct parents and children")
            if count > DEEPEST:
                raise ModelError(
                    f"link {link!r} is carried by more than {DEEPEST} others", path
                )


def _link(end: ElementTree.Element | None) -> str:
    """Return the link that an end of a joint names; empty where there is none."""
    if end is None:
        return ""
    return end.get("link", "")


def _check_copies(root: ElementTree.Element, path: Path) -> None:
    """Refuse what MuJoCo would copy without end."""
    copies = 0.0
    waiting = [(1.0, root)]
    while waiting:
        times, element = waiting.pop()
        if element.tag == "replicate":
            times *= _number(element.get("count", "1")) or 1.0
            copies += times
        if copies > COPIES:
            raise ModelError(f"replicates more than {COPIES} times", path)
        waiting += [(times, child) for child in element]


def _check_numbers(owner: str, element: ElementTree.Element, path: Path) -> None:
    for name in GEOMETRY.intersection(element.keys()):
        text = element.get(name, "")
        for number in map(_number, text.split()):
            # False of NaN, too; words that are no numbers MuJoCo refuses
            if number is None or abs(number) <= FARTHEST:
                continue
            shown = f'{name}="{text[:60]}"'
            raise ModelError(
                f"{_place(owner, element)}: {shown} must be finite numbers", path
            )


def _check_inertial(owner: str, element: ElementTree.Element, path: Path) -> None:
    """Refuse a mass or an inertia that is no finite number."""
    for name in INERTIAL.get(element.tag, ()):
        text = element.get(name, "0")
        number = _number(text)
        if number is None or not math.isfinite(number):
            shown = f'{name}="{text[:60]}"'
            raise ModelError(
                f"{_place(owner, element)}: {shown} must be a finite number", path
            )


def _check_limits(owner: str, element: ElementTree.Element, path: Path) -> None:
    """Refuse limits that are no numbers or reversed, and take infinite ones out:
    there are none then."""
    low, high = _limits(element)
    if low is None or high is None:
        # MuJoCo refuses what is no number
        return
    place = _place(owner, element)
    if math.isnan(low) or math.isnan(high):
        raise ModelError(f"{place}: a limit is no number", path)
    if low > high:
        raise ModelError(f"{place}: lower {low:g} above upper {high:g}", path)
    infinite = (math.isinf(low), math.isinf(high))
    if all(infinite):
        for name in ("lower", "upper", "range", "limited"):
            element.attrib.pop(name, None)
    elif any(infinite):
        hint = "give both, or none: a joint without limits"
        raise ModelError(f"{place}: one limit is infinite", path, hint)


def _limits(element: ElementTree.Element) -> tuple[float | None, float | None]:
    """Return the limits that an element of a URDF or an MJCF states."""
    if element.tag == "limit":
        return _number(element.get("lower", "0")), _number(element.get("upper", "0"))
    ends = element.get("range", "").split()
    if element.tag == "joint" and len(ends) == 2:
        low, high = map(_number, ends)
        return low, high
    return None, None


def _place(owner: str, element: ElementTree.Element) -> str:
    tag = str(element.tag)
    if owner.startswith(f"{tag} "):
        return owner
    return f"{owner}, {tag}".removeprefix(", ")


def _number(word: str) -> float | None:
    try:
        return float(word)
    except ValueError:
        return None
