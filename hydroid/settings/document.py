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
_PLAIN = {
    "mapping values are not allowed": "there is a second ': ' in this line, or the line is indented too far",
    "\\t": "a line is indented by a tab; use spaces",
    "expected ',' or ']'": "a list [a, b] is not closed with ']'",
    "expected ',' or '}'": "a mapping {a: 1} is not closed with '}'",
}
"""what the YAML reader stumbled over, by a part of its message"""
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
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{source}, line {mark.line + 1}, column {mark.column + 1}" if mark else source
        problem = str(getattr(error, "problem", None) or getattr(error, "reason", None))
        plain = next((words for part, words in _PLAIN.items() if part in problem), problem)
        raise SettingsError(f"is not YAML: {plain}", where=where) from None
    except RecursionError:
        raise SettingsError("is not YAML: it is nested too deeply", where=source) from None
    except (ValueError, KeyError):
        raise SettingsError("is not YAML: a value does not fit its type", where=source) from None


def _collect_lines(node: yaml.Node, path: tuple[str, ...], lines: Lines, source: str) -> None:
    """Check a node and what is in it, and note their lines."""
    where = f"{source}, line {node.start_mark.line + 1}"
    if len(lines) >= MAX_NODES:
        raise SettingsError(f"holds more than {MAX_NODES} values", where=source)
    if len(path) > MAX_DEPTH:
        raise SettingsError(f"is nested more than {MAX_DEPTH} deep", where=where)
    if node.tag not in _TYPES:
        raise SettingsError(f"a value of type {node.tag.removeprefix(_TAG)!r} is not allowed", where=where)
    if isinstance(node, yaml.ScalarNode) and not all(c.isprintable() or c in "\t\n" for c in node.value):
        raise SettingsError("a text contains characters that cannot be printed", where=where)
    lines.setdefault(path, node.start_mark.line + 1)
    items: list[tuple[str, yaml.Node]] = []
    if isinstance(node, yaml.SequenceNode):
        items = [(str(index), value) for index, value in enumerate(node.value)]
    for key, value in node.value if isinstance(node, yaml.MappingNode) else ():
        if not isinstance(key, yaml.ScalarNode):
            raise SettingsError("a key must be plain text or a number", where=where)
        # 02 and 2 are the same joint
        name = str(int(key.value)) if key.tag == f"{_TAG}int" else str(key.value)
        line = key.start_mark.line + 1
        if (*path, name) in lines:
            raise SettingsError(f"{'.'.join((*path, name))} occurs twice", where=f"{source}, line {line}")
        lines[*path, name] = line
        items.append((name, value))
    for name, value in items:
        _collect_lines(value, (*path, name), lines, source)
