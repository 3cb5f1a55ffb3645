"""YAML -> checked settings; every error names the file, the line, the setting and what is allowed."""

import difflib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar

from pydantic import BaseModel, BeforeValidator, Field, ValidationError, ValidationInfo, model_validator

from hydroid.errors import SettingsError
from hydroid.files import Plain
from hydroid.settings.document import Lines, read_document, read_yaml
from hydroid.words import listed

_PLAIN = {
    "dict": "must be a mapping of settings",
    "list": "must be a list in brackets, [a, b]",
    "model": "must be a mapping of settings",
    "tuple": "must be a list in brackets, [a, b]",
}
"""what a fault means in YAML, by the start of pydantic's name for it; its own words say the others"""


def _with_tuples(values: Any) -> Any:
    """Take YAML's lists for tuples, which frozen settings hold."""
    if isinstance(values, dict):
        return {key: _with_tuples(value) for key, value in values.items()}
    return tuple(_with_tuples(value) for value in values) if isinstance(values, list) else values


class Settings(BaseModel):
    """Base of all settings: frozen; an unknown key is an error, and so is true for a number or "3" for 3."""

    model_config = {"frozen": True, "extra": "forbid", "allow_inf_nan": False, "strict": True}

    _of_yaml = model_validator(mode="before")(_with_tuples)

    @classmethod
    def names_of_joints(cls, values: Plain, folder: Path) -> tuple[str, ...]:
        """Return the names of the joints that values of a file in a folder are about, if any."""
        return ()

    def changed(self, changes: Mapping[str, Any]) -> Self:
        """Return the settings with values replaced by dotted key, such as `search.seed`; none is checked."""
        settings = self
        for key, value in changes.items():
            name, _, inner = key.partition(".")
            within = getattr(settings, name).changed({inner: value}) if inner else value
            settings = settings.model_copy(update={name: within})
        return settings


def _number_of(key: Any, info: ValidationInfo) -> Any:
    """Take a joint's name, or its number as text, as JSON and `--set` spell it, for its number from 1."""
    if not isinstance(key, str):
        return key
    if key.isascii() and key.isdecimal():
        return int(key)
    arm = (info.context or {}).get("arm")
    names = arm.joint_names if arm else ()
    if key in names:
        return names.index(key) + 1
    raise ValueError(f"no joint {key!r}" + (f"; the arm's joints: {', '.join(names)}" if names else ""))


JointNumber = Annotated[int, BeforeValidator(_number_of), Field(ge=1)]
"""of a joint of the arm, from 1; in a file its name will do"""


def meant(key: Any, names: Sequence[str]) -> Any:
    """Return the number of the joint that a key means, by its number or its name; any other key itself."""
    if isinstance(key, str) and key.isascii() and key.isdecimal():
        return int(key)
    return names.index(key) + 1 if key in names else key


def each_once(joints: Any, names: Sequence[str]) -> None:
    """Raise ValueError where a joint occurs twice among joints, such as by its number and its name."""
    taken = set[Any]()
    for key in joints:
        if (joint := meant(key, names)) in taken:
            raise ValueError(f"joint {key} occurs twice")
        taken.add(joint)


def _each_once(joints: Any, info: ValidationInfo) -> Any:
    arm = (info.context or {}).get("arm")
    if isinstance(joints, dict | tuple) and all(isinstance(key, str | int) for key in joints):
        each_once(joints, arm.joint_names if arm else ())
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
    given = dict[str, str]()
    names = kind.names_of_joints(values | dict(overrides or {}), path.parent) if overrides else ()
    for key, value in (overrides or {}).items():
        (*folders, last), place, parts = key.split("."), values, list[str]()
        for folder in folders:
            parts.append(part := _same_key(place, folder, names))
            place = place.setdefault(part, {})
            if not isinstance(place, dict):
                raise SettingsError(f"{folder} has no settings below it", f"--set {key}")
        parts.append(part := _same_key(place, last, names))
        place[part] = value
        given[".".join(map(str, parts))] = key
    return validate(values, kind, str(path), lines, given, path.parent)


def _same_key(place: Plain, key: str, names: Sequence[str]) -> Any:
    """Return the key by which a mapping has a setting, such as a joint's name for its number; or the key."""
    if key in place:
        return key
    return next((one for one in place if meant(one, names) == meant(key, names)), key)


def validate(
    values: Plain,
    kind: type[S],
    source: str,
    lines: Lines | None = None,
    overridden: Mapping[str, str] | None = None,
    folder: Path | None = None,
) -> S:
    """Check a mapping against `kind` and report its faults with their places, of many the first four.

    Files that the settings name are first looked up in `folder`. `overridden` are the keys that
    `--set` gave, by those that they replace.
    """
    try:
        return kind.model_validate(values, context={"folder": folder, "source": source})
    except ValidationError as error:
        faults = sorted(error.errors(), key=_rank)
    found = dict[str, str]()  # a value that is none of several types is one fault
    for fault in faults:
        key, problem = _explained(fault, kind)
        # the fault may lie in an override, below it, or in what it is a part of
        replaced = sorted(overridden or {})
        near = (o for o in replaced if f"{key}.".startswith(f"{o}.") or o.startswith(f"{key}."))
        if overridden and (at := next(near, None)):
            name, where = key[len(at) + 1 :], f"--set {overridden[at]}"
        else:
            named = fault["type"] in ("extra_forbidden", "missing")  # the problem names the setting
            parts = tuple(key.split("."))
            begins = (parts[:end] for end in range(len(parts), 0, -1))
            line = next((f", line {lines[part]}" for part in begins if lines and part in lines), "")
            name, where = "" if named else _shown(key)[1:-1], f"{source}{line}"
        found.setdefault(where, f"{name}: {problem}" if name else problem)
    (where, what), *others = found.items()
    also = listed([f"{place.removeprefix(f'{source}, ')}: {other}" for place, other in others], 3)
    raise SettingsError(what, where, also and f"also {also}")


def parse_override(text: str) -> tuple[str, Any]:
    """Split `key=value`; the value is read as YAML."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise SettingsError("needs key=value", f"--set {text}", "for example --set search.seed=3")
    return key.strip(), read_document(value, f"--set {text}")[0]


def _rank(fault: Any) -> int:
    """Order faults: a setting that does not exist first, for it may be why another is missing.

    Of a value of several types, the one that it has not comes last.
    """
    if fault["type"] == "extra_forbidden":
        return 0
    return 2 if fault["type"].endswith("_type") and any(map(_is_type, fault["loc"])) else 1


def _is_type(part: Any) -> bool:
    """Return whether pydantic means a type by a part of a place, not a setting."""
    return isinstance(part, str) and (part.startswith("constrained-") or part.endswith("]"))


def _explained(fault: Any, kind: type[Settings]) -> tuple[str, str]:
    """The dotted key of a setting, and what is wrong with it, from one of pydantic's faults."""
    key = ".".join(str(part) for part in fault["loc"] if not _is_type(part))
    if fault["type"] == "missing":
        return key, f"setting {key!r} is missing"
    if fault["type"] == "extra_forbidden":
        inner: Any = kind
        for part in fault["loc"][:-1]:
            field = getattr(inner, "model_fields", {}).get(str(part))
            inner = field and field.annotation
        allowed = [*getattr(inner, "model_fields", ())]
        near = difflib.get_close_matches(str(fault["loc"][-1]), allowed, n=1)
        choice = f"; did you mean {near[0]!r}?" if near else f"; allowed here: {', '.join(allowed)}"
        return key, f"unknown setting {_shown(key)}{choice if allowed else ''}"
    words = str(fault["msg"]).removeprefix("Value error, ").replace("Input should", "must")
    problem = _PLAIN.get(fault["type"].partition("_")[0], words[:1].lower() + words[1:])
    if isinstance(fault["input"], dict):  # a check of several settings names the one that is wrong
        name, colon, rest = problem.partition(": ")
        inner = name if colon and name.replace(".", "").isidentifier() else ""
        return (f"{key}.{inner}".strip("."), rest) if inner else (key, problem)
    return key, f"{problem} (given: {_shown(fault['input'])})"


def _shown(value: object) -> str:
    """A value as YAML writes it, shortened where it is long."""
    if isinstance(value, tuple):
        text = f"[{', '.join(map(_shown, value))}]"
    else:
        text = {"None": "null", "True": "true", "False": "false"}.get(repr(value), repr(value))
    return text if len(text) <= 60 else f"{text[:56]}...{text[-1]}"
