"""What an arm's MJCF says at a glance, read as XML: settings are checked before MuJoCo is imported."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError, fromstring

from hydroid.errors import ModelError
from hydroid.files import is_file

DIGITS = 9
"""of lengths in m and angles in deg that are read off a model: what is finer is its rounding"""

Defaults = dict[str, dict[str, dict[str, str]]]
"""attributes by default class and tag"""


@dataclass(frozen=True)
class Outline:
    """Names and ranges of an arm's model.

    Attributes:
        name: of the model.
        joint_names: in the order of the model, (J,).
        ranges: of these, smallest and largest angle [deg]; None: no limits.
        link_names: bodies that move and have mass: those of the joints in their order, then parts that are
            fixed to them.
        sites: names.
    """

    name: str
    joint_names: tuple[str, ...]
    ranges: tuple[tuple[float, float] | None, ...]
    link_names: tuple[str, ...]
    sites: frozenset[str]


@dataclass
class _Body:
    name: str
    parent: "_Body | None" = None
    joints: list[dict[str, str]] = field(default_factory=list[dict[str, str]])
    weighs: bool = False

    @property
    def moves(self) -> bool:
        return bool(self.joints) or (self.parent is not None and self.parent.moves)


def read_outline(path: Path) -> Outline:
    """Read names and ranges from an MJCF of one file.

    Raises:
        ModelError: missing, not XML, or a number that is none.
    """
    root = read_xml(path, "model", "give the arm's MJCF; `hydroid init` writes one")
    options = {key: value for part in root.iterfind("compiler") for key, value in part.items()}
    defaults: Defaults = {}
    for section in root.iterfind("default"):
        defaults |= _defaults(section, defaults.get("main", {}))
    bodies = [_Body("world")]
    try:
        for world in root.iterfind("worldbody"):
            _walk(world, "main", bodies[0], bodies, defaults)
        joints = [joint for body in bodies for joint in body.joints]
        ranges = tuple(_range(joint, options) for joint in joints)
    except ValueError as error:
        raise ModelError(f"cannot be read ({error})", where=str(path)) from None
    links = [body for body in bodies if body.name and body.moves and body.weighs]
    if options.get("fusestatic") == "true":
        links = [body for body in links if body.joints]
    return Outline(
        root.get("model", "MuJoCo Model"),
        tuple(joint.get("name", "") for joint in joints),
        ranges,
        tuple(body.name for body in sorted(links, key=lambda body: not body.joints)),
        frozenset(site.get("name", "") for site in root.iter("site")),
    )


def read_xml(path: Path, what: str, hint: str) -> Element:
    """Return the root of an XML file; `what` it should be, and the hint where it is not there.

    Raises:
        ModelError: missing, or not XML.
    """
    if not is_file(path):
        raise ModelError(f"no such {what}", where=str(path), hint=hint)
    try:
        return fromstring(path.read_bytes())
    except (ParseError, OSError, ValueError) as error:
        raise ModelError(f"cannot be read as XML ({error})", where=str(path)) from None


def _defaults(section: Element, above: dict[str, dict[str, str]]) -> Defaults:
    own = above | {part.tag: above.get(part.tag, {}) | part.attrib for part in section}
    found = {section.get("class", "main"): own}
    for inner in section.iterfind("default"):
        found |= _defaults(inner, own)
    return found


def _walk(element: Element, kind: str, body: _Body, bodies: list[_Body], defaults: Defaults) -> None:
    """Add what an element holds to its body, and the bodies in it, in MuJoCo's order, to all."""
    kind = element.get("childclass", kind)
    for part in element:
        full = defaults.get(part.get("class", kind), {}).get(part.tag, {}) | part.attrib
        match part.tag:
            case "body":
                bodies.append(_Body(full.get("name", ""), body))
                _walk(part, kind, bodies[-1], bodies, defaults)
            case "frame":
                _walk(part, kind, body, bodies, defaults)
            case "joint":
                body.joints.append(full)
            case "inertial":
                body.weighs |= float(full.get("mass", "0")) > 0
            case "geom":
                body.weighs |= float(full.get("mass", full.get("density", "1"))) > 0
            case _:
                pass


def _range(joint: dict[str, str], options: dict[str, str]) -> tuple[float, float] | None:
    """The range of a joint [deg]; None: it has no limits."""
    limited, given = joint.get("limited", "auto"), "range" in joint
    if limited == "false" or (limited == "auto" and not (given and options.get("autolimits") != "false")):
        return None
    low, high = map(float, joint.get("range", "0 0").split())
    if options.get("angle") == "radian":
        low, high = math.degrees(low), math.degrees(high)
    return round(low, DIGITS), round(high, DIGITS)
