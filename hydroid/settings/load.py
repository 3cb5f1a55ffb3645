"""YAML -> checked settings; every error names the file, the line, the setting and what is allowed."""

from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from hydroid.errors import SettingsError
from hydroid.settings.document import read_document, read_value
from hydroid.settings.messages import explain


class Settings(BaseModel):
    """Base of all settings: frozen; an unknown key is an error, and so is true for a number or "3" for 3."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)

    @model_validator(mode="before")
    @classmethod
    def _lists_are_tuples(cls, values: Any) -> Any:
        """Take YAML's lists for tuples, which frozen settings hold."""
        return _with_tuples(values)


def _with_tuples(values: Any) -> Any:
    if isinstance(values, dict):
        return {key: _with_tuples(value) for key, value in values.items()}
    return tuple(_with_tuples(value) for value in values) if isinstance(values, list) else values


def _number_of(key: Any) -> Any:
    """JSON and `--set` spell the number of a joint as text."""
    return int(key) if isinstance(key, str) and key.isascii() and key.isdecimal() else key


JointNumber = Annotated[int, BeforeValidator(_number_of), Field(ge=1)]
"""of a joint of the arm, from 1"""


S = TypeVar("S", bound=Settings)
MAX_BYTES = 2**18


def read_yaml(path: Path) -> tuple[dict[str, Any], dict[tuple[str, ...], int]]:
    """Read a mapping and the lines of its keys.

    Returns:
        The mapping, and lines [1-based] by key path.

    Raises:
        SettingsError: unreadable, not UTF-8, not YAML, not a mapping, or a key that occurs twice.
    """
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
        text = data.decode("utf-8-sig")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it is not UTF-8 text"
        raise SettingsError(f"cannot be read ({reason})", where=str(path)) from None
    if len(data) > MAX_BYTES:
        raise SettingsError(f"is larger than {MAX_BYTES >> 10} KiB, too large for settings", where=str(path))
    values, lines = read_document(text, str(path))
    if not isinstance(values, dict):
        raise SettingsError("must be a mapping of settings", where=str(path), hint="write `key: value` lines")
    return values, lines


def load(path: Path, kind: type[S], overrides: dict[str, Any] | None = None) -> S:
    """Read one YAML file as settings of type `kind`.

    Args:
        path: the file.
        kind: the settings class.
        overrides: values by dotted key, as `--set search.seed=3` gives them.

    Raises:
        SettingsError: a key or value that is not allowed, with file and line.
    """
    values, lines = read_yaml(path)
    for key, value in (overrides or {}).items():
        _set(values, key, value)
    return validate(values, kind, str(path), lines, set(overrides or {}), path.parent)


def validate(
    values: dict[str, Any],
    kind: type[S],
    source: str,
    lines: dict[tuple[str, ...], int] | None = None,
    overridden: set[str] | None = None,
    folder: Path | None = None,
) -> S:
    """Check a mapping against `kind` and report the first fault with its place.

    Files that the settings name are first looked up in `folder`.
    """
    try:
        return kind.model_validate(values, context={"folder": folder})
    except ValidationError as error:
        # a setting that does not exist may be why another is missing
        first, *others = sorted(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")
        loc = tuple(str(part) for part in first["loc"])
        more = f"{len(others)} more fault{'s' if len(others) > 1 else ''}"
        what, hint = explain(".".join(loc), first, kind), f"and {more} in this file" if others else ""
        where = _where(loc, source, lines, overridden)
        what = what.removeprefix(f"{where.removeprefix('--set ')}: ")  # the override is named already
        raise SettingsError(what, where=where, hint=hint) from None


def _where(
    loc: tuple[str, ...], source: str, lines: dict[tuple[str, ...], int] | None, overridden: set[str] | None
) -> str:
    key = ".".join(loc)
    # the fault may lie in the override, below it, or in what it is a part of
    related = [
        o for o in sorted(overridden or ()) if f"{key}.".startswith(f"{o}.") or o.startswith(f"{key}.")
    ]
    return f"--set {related[0]}" if related else f"{source}{_line(loc, lines or {})}"


def parse_override(text: str) -> tuple[str, Any]:
    """Split `key=value`; the value is read as YAML.

    Raises:
        SettingsError: no `=` or no key, or a value that is not YAML.
    """
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise SettingsError("needs key=value", where=f"--set {text}", hint="for example --set search.seed=3")
    return key.strip(), read_value(value, f"--set {text}")


def _set(values: dict[str, Any], key: str, value: Any) -> None:
    *folders, last = key.split(".")
    for folder in folders:
        inner = values.setdefault(folder, {})
        if not isinstance(inner, dict):
            raise SettingsError(f"{folder} has no settings below it", where=f"--set {key}")
        values = inner
    values[last] = value


def _line(loc: tuple[str, ...], lines: dict[tuple[str, ...], int]) -> str:
    """The line of the deepest part of `loc` that the file contains."""
    for end in range(len(loc), 0, -1):
        if loc[:end] in lines:
            return f", line {lines[loc[:end]]}"
    return ""
