"""YAML text -> plain values: mappings, lists, text, numbers, true, false and null, and nothing else.

Scalars are read as YAML 1.2 defines them. PyYAML's own rules, those of YAML 1.1, read 010 as 8, 1:30 as 90
and 1e3 as text; here they are 10, text and 1000.
"""

import re
from pathlib import Path
from typing import Any

import yaml

from hydroid.errors import SettingsError

Lines = dict[tuple[str, ...], int]
"""line [1-based] of each key or item, by its path"""

MAX_BYTES = 2**18
MAX_NODES = 20_000
"""aliases count as often as they are used, so that a few lines cannot expand to billions of values"""
MAX_DEPTH = 40
_TAG = "tag:yaml.org,2002:"
_TYPES = {_TAG + name for name in ("map", "seq", "str", "int", "float", "bool", "null")}


class _Loader(yaml.SafeLoader):
    """A safe loader without the extras of YAML 1.1: merge keys, dates, base 60, octal numbers, yes and no."""

    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012  # PyYAML's own name and type


for _name, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("int", r"[-+]?[0-9]{1,300}", list("-+0123456789")),  # longer ones are beyond any float
    ("float", r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?", list("-+.0123456789")),
    ("float", r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)", list("-+.")),
):
    _Loader.add_implicit_resolver(_TAG + _name, re.compile(rf"(?:{_pattern})\Z"), _first)
_Loader.add_constructor(_TAG + "int", lambda _, node: int(str(node.value)))


def read_yaml(path: Path) -> tuple[dict[str, Any], Lines]:
    """Read a file that holds one mapping.

    Raises:
        SettingsError: unreadable, not UTF-8, too large, not a mapping, or as `read_document`.
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


def read_document(text: str, source: str) -> tuple[Any, Lines]:
    """Read one YAML document.

    Raises:
        SettingsError: not YAML, a key that occurs twice or is not plain text, another type, or too much.
    """
    lines: Lines = {}
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        if node is None:
            return None, lines
        _collect_lines(node, (), lines, source)
        return loader.construct_document(node), lines
    except (yaml.YAMLError, ValueError, KeyError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{source}, line {mark.line + 1}, column {mark.column + 1}" if mark else source
        problem = getattr(error, "problem", None) or getattr(error, "reason", None)
        if not isinstance(error, yaml.YAMLError):
            deep = isinstance(error, RecursionError)
            problem = "it is nested too deeply" if deep else "a value does not fit its type"
        raise SettingsError(f"is not YAML: {_plainly(str(problem))}", where=where) from None


def _plainly(problem: str) -> str:
    """Say in plain words what the YAML reader stumbled over."""
    if problem.startswith("mapping values are not allowed"):
        return "there is a second ': ' in this line, or the line is indented too far"
    if "\\t" in problem:
        return "a line is indented by a tab; use spaces"
    if problem.startswith("expected ',' or ']'"):
        return "a list [a, b] is not closed with ']'"
    if problem.startswith("expected ',' or '}'"):
        return "a mapping {a: 1} is not closed with '}'"
    return problem


def _collect_lines(node: yaml.Node, path: tuple[str, ...], lines: Lines, source: str) -> None:
    """Check a node and what is in it, and note their lines."""
    line = node.start_mark.line + 1
    where = f"{source}, line {line}"
    if len(lines) >= MAX_NODES:
        raise SettingsError(f"holds more than {MAX_NODES} values", where=source)
    if len(path) > MAX_DEPTH:
        raise SettingsError(f"is nested more than {MAX_DEPTH} deep", where=where)
    if node.tag not in _TYPES:
        raise SettingsError(f"a value of type {node.tag.removeprefix(_TAG)!r} is not allowed", where=where)
    if isinstance(node, yaml.ScalarNode) and not all(c.isprintable() or c in "\t\n" for c in node.value):
        raise SettingsError("a text contains characters that cannot be printed", where=where)
    lines.setdefault(path, line)
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise SettingsError("a key must be plain text or a number", where=where)
            # 02 and 2 are the same joint
            here = (*path, str(int(key.value)) if key.tag == f"{_TAG}int" else str(key.value))
            place = key.start_mark.line + 1
            if here in lines:
                raise SettingsError(f"{'.'.join(here)} occurs twice", where=f"{source}, line {place}")
            lines[here] = place
            _collect_lines(value, here, lines, source)
    elif isinstance(node, yaml.SequenceNode):
        for index, value in enumerate(node.value):
            _collect_lines(value, (*path, str(index)), lines, source)
