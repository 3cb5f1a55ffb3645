"""YAML -> checked settings; every error names the file, the line,
the setting and what is allowed."""

import difflib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    Field,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from hydroid.errors import SettingsError
from hydroid.files import Plain
from hydroid.quantity_table import TARGETS
from hydroid.settings.document import MOST_BYTES, Lines, read_document, read_yaml
from hydroid.words import listed

_PLAIN = {
    "dict": "must be a mapping of settings",
    "list": "must be a list in brackets, [a, b]",
    "model": "must be a mapping of settings",
    "tuple": "must be a list in brackets, [a, b]",
}
"""what a fault means in YAML, by the start of pydantic's name for it;
its own words say the others"""


_YAML_WORDS = {"None": "null", "True": "true", "False": "false"}
"""how YAML spells what Python spells otherwise"""


def _with_tuples(values: Any) -> Any:
    """Take YAML's lists for tuples, which frozen settings hold."""
    if isinstance(values, dict):
        return {key: _with_tuples(value) for key, value in values.items()}
    if isinstance(values, list):
        return tuple(map(_with_tuples, values))
    return values


class Settings(BaseModel):
    """Base of all settings: frozen; an unknown key is an error,
    and so is true for a number or "3" for 3."""

    model_config = {
        "frozen": True,
        "extra": "forbid",
        "allow_inf_nan": False,
        "strict": True,
    }

    _of_yaml = model_validator(mode="before")(_with_tuples)

    @classmethod
    def names_of_joints(cls, values: Plain, folder: Path) -> tuple[str, ...]:
        """Return the names of the joints that values of a file in a folder are about,
        if any."""
        return ()

    def changed(self, changes: Mapping[str, Any]) -> Self:
        """Return the settings with values replaced by dotted key, such as
        `search.seed`.

        The new values are not checked.
        """
        settings = self
        for key, value in changes.items():
            name, _, inner = key.partition(".")
            if inner:
                value = getattr(settings, name).changed({inner: value})
            settings = settings.model_copy(update={name: value})
        return settings


MOST_DIGITS = 10
"""of a joint's number; Python refuses to convert texts of thousands"""
LONGEST_SHOWN = 60
"""letters of a value in a message"""


def _number_of(key: Any, info: ValidationInfo) -> Any:
    """Take a joint's name, or its number as text, as JSON and `--set` spell it,
    for its number from 1."""
    if not isinstance(key, str):
        return key
    names = _joint_names(info)
    if key in names:
        return names.index(key) + 1
    if _is_number(key) and int(key) > 0:
        return int(key)
    hint = f"; the arm's joints: {', '.join(names)}" if names else ""
    raise ValueError(f"no joint {key!r}{hint}")


def _is_number(key: str) -> bool:
    """Return whether a text is a whole number that may be a joint's; `isdecimal` alone
    takes the digits of any script."""
    return key.isascii() and key.isdecimal() and len(key) < MOST_DIGITS


def _joint_names(info: ValidationInfo) -> tuple[str, ...]:
    """Return the names of the joints of the arm that settings are about;
    none before the arm is read."""
    arm = (info.context or {}).get("arm")
    return arm.joint_names if arm else ()


JointNumber = Annotated[int, BeforeValidator(_number_of), Field(ge=1)]
"""of a joint of the arm, from 1; in a file its name will do"""


def meant(key: Any, names: Sequence[str]) -> Any:
    """Return the number of the joint that a key means, by its number or its name;
    any other key itself."""
    if isinstance(key, str) and _is_number(key):
        return int(key)
    if key in names:
        return names.index(key) + 1
    return key


def each_once(joints: Any, names: Sequence[str]) -> None:
    """Raise ValueError where a joint occurs twice among joints,
    such as by its number and its name."""
    taken = set[Any]()
    for key in joints:
        joint = meant(key, names)
        if joint in taken:
            raise ValueError(f"joint {key} occurs twice")
        taken.add(joint)


def _each_once(joints: Any, info: ValidationInfo) -> Any:
    # keys of another type are no joints: pydantic refuses them in its own words
    if isinstance(joints, dict | tuple) and all(
        isinstance(key, str | int) for key in joints
    ):
        each_once(joints, _joint_names(info))
    return joints


T = TypeVar("T")
ByJoint = Annotated[dict[JointNumber, T], BeforeValidator(_each_once)]
"""values by joint"""
Joints = Annotated[tuple[JointNumber, ...], BeforeValidator(_each_once)]
"""joints, each once"""
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]

S = TypeVar("S", bound=Settings)


def load(path: Path, kind: type[S], overrides: Mapping[str, Any] | None = None) -> S:
    """Read one YAML file as settings of a kind, with overrides by dotted key.

    An override of a joint's settings finds them under its number and under its name.
    """
    values, lines = read_yaml(path)
    changes = dict(overrides or {})
    overridden = dict[str, str]()
    if changes:
        names = kind.names_of_joints(values | changes, path.parent)
        for key, value in changes.items():
            overridden[_replace(values, key, value, names)] = key
    return validate(values, kind, str(path), lines, overridden, path.parent)


def _replace(values: Plain, key: str, value: Any, names: Sequence[str]) -> str:
    """Replace a value in nested mappings by its dotted key,
    and return the key by which they have it."""
    *folders, last = key.split(".")
    mapping = values
    parts = list[str]()
    for folder in folders:
        part = _same_key(mapping, folder, names)
        parts.append(part)
        mapping = mapping.setdefault(part, {})
        if not isinstance(mapping, dict):
            raise SettingsError(f"{folder} has no settings below it", f"--set {key}")
    part = _same_key(mapping, last, names)
    parts.append(part)
    if folders == ["hydraulics"]:
        _remove_sides(mapping, last)
    mapping[part] = value
    return ".".join(map(str, parts))


def _remove_sides(hydraulics: Plain, name: str) -> None:
    """Remove what an override of a quantity replaces: of both sides each side's value,
    of one side the value of both, which the other side keeps."""
    replaced = {*TARGETS.get(name, (name,))}
    for other in [*hydraulics]:
        sides = {*TARGETS.get(other, (other,))}
        if other != name and sides & replaced:
            value = hydraulics.pop(other)
            hydraulics.update(dict.fromkeys(sides - replaced, value))


def _same_key(mapping: Plain, key: str, names: Sequence[str]) -> Any:
    """Return the key by which a mapping has a setting, such as a joint's name for its
    number; or the key."""
    if key in mapping:
        return key
    joint = meant(key, names)
    same = (other for other in mapping if meant(other, names) == joint)
    return next(same, key)


def validate(
    values: Plain,
    kind: type[S],
    source: str,
    lines: Lines | None = None,
    overridden: Mapping[str, str] | None = None,
    folder: Path | None = None,
) -> S:
    """Check a mapping against `kind` and report its faults with their places,
    of many the first four.

    Files that the settings name are first looked up in `folder`. `overridden` are the
    keys that `--set` gave, by those that they replace.
    """
    try:
        return kind.model_validate(values, context={"folder": folder, "source": source})
    except ValidationError as error:
        faults = sorted(error.errors(), key=_rank)
    problems = dict[str, str]()
    for fault in faults:
        key, problem = _explained(fault, kind)
        override = _override_of(key, overridden or {})
        if override is not None and overridden:
            name = key[len(override) + 1 :]
            # the message shows the value, which its place in a list does not
            if name.isdecimal():
                name = ""
            where = f"--set {overridden[override]}"
        else:
            names_itself = fault["type"] in ("extra_forbidden", "missing")
            name = "" if names_itself else _shown(key)[1:-1]
            where = source + _line_of(key, lines or {})
        # a value that is none of several types has a fault for each; they are one
        # problem
        problems.setdefault(where, f"{name}: {problem}" if name else problem)
    (where, what), *others = problems.items()
    further = [
        f"{place.removeprefix(f'{source}, ')}: {problem}" for place, problem in others
    ]
    hint = f"also {listed(further, 3)}" if further else ""
    raise SettingsError(what, where, hint)


def _override_of(key: str, overridden: Mapping[str, str]) -> str | None:
    """Return the overridden key in which a fault may lie: its own, one above it,
    or one below it."""
    for override in sorted(overridden):
        if f"{key}.".startswith(f"{override}.") or override.startswith(f"{key}."):
            return override
    return None


def _line_of(key: str, lines: Lines) -> str:
    """Return the line of a setting in words; where it has none,
    that of the mapping that lacks it."""
    parts = tuple(key.split("."))
    for end in range(len(parts), 0, -1):
        if parts[:end] in lines:
            return f", line {lines[parts[:end]]}"
    return ""


def parse_override(text: str) -> tuple[str, Any]:
    """Split `key=value`; the value is read as YAML."""
    if len(text) > MOST_BYTES:
        what = f"is larger than {MOST_BYTES >> 10} KiB, too large for a setting"
        raise SettingsError(what, f"--set {text[:LONGEST_SHOWN]}...")
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise SettingsError(
            "needs key=value", f"--set {text}", "for example --set search.seed=3"
        )
    return key.strip(), read_document(value, f"--set {text}")[0]


def _rank(fault: Any) -> int:
    """Order faults: a setting that does not exist first, for it may be why another is
    missing.

    Of a value of several types, the one that it has not comes last.
    """
    if fault["type"] == "extra_forbidden":
        return 0
    one_of_several = any(map(_is_type, fault["loc"]))
    return 2 if one_of_several and fault["type"].endswith("_type") else 1


def _is_type(part: Any) -> bool:
    """Return whether pydantic means a type by a part of a place, not a setting."""
    return isinstance(part, str) and (
        part.startswith("constrained-") or part.endswith("]")
    )


def _explained(fault: Any, kind: type[Settings]) -> tuple[str, str]:
    """Return the dotted key of a setting, and what is wrong with it,
    from one of pydantic's faults."""
    key = ".".join(str(part) for part in fault["loc"] if not _is_type(part))
    if fault["type"] == "missing":
        return key, f"setting {key!r} is missing"
    if fault["type"] == "extra_forbidden":
        return key, f"unknown setting {_shown(key)}{_choice(fault['loc'], kind)}"
    problem = _problem(fault)
    if not isinstance(fault["input"], dict):
        return key, f"{problem} (given: {_shown(fault['input'])})"
    # a check of several settings begins its message with the one that is wrong
    name, colon, rest = problem.partition(": ")
    if colon and name.replace(".", "").isidentifier():
        return f"{key}.{name}".strip("."), rest
    return key, problem


def _choice(location: Sequence[Any], kind: type[Settings]) -> str:
    """Return which settings there are where an unknown one stands, or the one that it
    resembles."""
    *outer, unknown = location
    settings: Any = kind
    for part in outer:
        field = getattr(settings, "model_fields", {}).get(str(part))
        settings = field and field.annotation
    allowed = [*getattr(settings, "model_fields", ())]
    # a misspelt setting is more likely than one that was never there
    near = difflib.get_close_matches(str(unknown), allowed, n=1)
    if near:
        return f"; did you mean {near[0]!r}?"
    return f"; allowed here: {', '.join(allowed)}" if allowed else ""


def _problem(fault: Any) -> str:
    """Return what is wrong, in YAML's words where pydantic's are Python's."""
    family = fault["type"].partition("_")[0]
    if family in _PLAIN:
        return _PLAIN[family]
    message = str(fault["msg"]).removeprefix("Value error, ")
    message = message.replace("Input should", "must")
    return message[:1].lower() + message[1:]


def _shown(value: object) -> str:
    """Return a value as YAML writes it, shortened where it is long."""
    text = repr(value)
    if isinstance(value, tuple):
        text = f"[{', '.join(map(_shown, value))}]"
    elif text in _YAML_WORDS:
        text = _YAML_WORDS[text]
    if len(text) <= LONGEST_SHOWN:
        return text
    return f"{text[: LONGEST_SHOWN - 4]}...{text[-1]}"
