"""YAML -> checked settings: every refusal names the file, the line, the setting and what is allowed."""

from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from hydroid.errors import SettingsError


class Settings(BaseModel):
    """Base of all settings: frozen, and an unknown key is an error rather than a silent default."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


S = TypeVar("S", bound=Settings)


def read_yaml(path: Path) -> tuple[dict[str, Any], dict[tuple[str, ...], int]]:
    """Read a mapping and the line on which each of its keys stands.

    Returns:
        The mapping, and lines [1-based] by key path.

    Raises:
        SettingsError: unreadable, not UTF-8, not YAML, not a mapping, or a key that stands there twice.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(f"cannot be read ({_reason(error)})", where=str(path)) from None
    try:
        node = yaml.compose(text, Loader=yaml.SafeLoader)
        values = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError, TypeError) as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{path}, line {mark.line + 1}" if mark else str(path)
        problem = getattr(error, "problem", None) or type(error).__name__
        raise SettingsError(f"is not YAML ({problem})", where=where) from None
    if not isinstance(values, dict):
        raise SettingsError("must be a mapping of settings", where=str(path), cure="write `key: value` lines")
    lines: dict[tuple[str, ...], int] = {}
    _collect_lines(node, (), lines, str(path))
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
    return validate(values, kind, str(path), lines, set(overrides or {}))


def validate(
    values: dict[str, Any],
    kind: type[S],
    source: str,
    lines: dict[tuple[str, ...], int] | None = None,
    overridden: set[str] | None = None,
) -> S:
    """Check a mapping against `kind`; report the first fault with its place."""
    try:
        return kind.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        loc = tuple(str(part) for part in first["loc"])
        where = f"{source}{_line(loc, lines or {})}"
        key = ".".join(loc)
        # the fault may lie in the override, below it, or in what it is a part of
        guilty = [
            o for o in sorted(overridden or ()) if f"{key}.".startswith(f"{o}.") or o.startswith(f"{key}.")
        ]
        if guilty:
            where = f"--set {guilty[0]}"
        more = error.error_count() - 1
        cure = f"and {more} more fault{'s' if more > 1 else ''} in this file" if more else ""
        raise SettingsError(_explain(key, first, kind), where=where, cure=cure) from None


def parse_override(text: str) -> tuple[str, Any]:
    """Split `key=value`; the value is read as YAML.

    Raises:
        SettingsError: no `=` or no key, or a value that is not YAML.
    """
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise SettingsError("needs key=value", where=f"--set {text}", cure="for example --set search.seed=3")
    try:
        return key.strip(), yaml.safe_load(value)
    except yaml.YAMLError:
        raise SettingsError(f"value {value!r} is not YAML", where=f"--set {text}") from None


def _set(values: dict[str, Any], key: str, value: Any) -> None:
    *folders, last = key.split(".")
    for folder in folders:
        inner = values.setdefault(folder, {})
        if not isinstance(inner, dict):
            raise SettingsError(f"{folder} holds no settings below it", where=f"--set {key}")
        values = inner
    values[last] = value


def _explain(key: str, fault: Any, kind: type[BaseModel]) -> str:
    """One fault of pydantic's in the words of this program."""
    if fault["type"] == "extra_forbidden":
        allowed = _allowed(kind, fault["loc"][:-1])
        return f"unknown setting {key!r}" + (f", allowed here: {allowed}" if allowed else "")
    if fault["type"] == "missing":
        return f"setting {key!r} is missing"
    message = str(fault["msg"]).removeprefix("Value error, ")
    shown = repr(fault["input"])
    given = f" (given: {shown if len(shown) < 60 else shown[:57] + '...'})"
    return f"{key or 'settings'}: {message[:1].lower()}{message[1:]}{given}"


def _allowed(kind: type[BaseModel], loc: tuple[Any, ...]) -> str:
    """Names of the settings at `loc`, where the path can be followed through nested classes."""
    for part in loc:
        field = kind.model_fields.get(str(part))
        inner = field.annotation if field else None
        if not (isinstance(inner, type) and issubclass(inner, BaseModel)):
            return ""
        kind = inner
    return ", ".join(kind.model_fields)


def _collect_lines(node: Any, path: tuple[str, ...], lines: dict[tuple[str, ...], int], source: str) -> None:
    lines[path] = node.start_mark.line + 1
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            here = (*path, str(key.value))
            if here in lines:
                where = f"{source}, line {key.start_mark.line + 1}"
                raise SettingsError(f"{'.'.join(here)} stands there twice", where=where)
            _collect_lines(value, here, lines, source)
            lines[here] = key.start_mark.line + 1
    elif isinstance(node, yaml.SequenceNode):
        for index, value in enumerate(node.value):
            _collect_lines(value, (*path, str(index)), lines, source)


def _line(loc: tuple[str, ...], lines: dict[tuple[str, ...], int]) -> str:
    """The line of the deepest part of `loc` that the file contains."""
    for end in range(len(loc), 0, -1):
        if loc[:end] in lines:
            return f", line {lines[loc[:end]]}"
    return ""


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or "it is not UTF-8 text"
