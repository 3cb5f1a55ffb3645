"""YAML text -> plain values: mappings, lists, text, numbers, true, false and null, and nothing else.

Scalars are read as YAML 1.2 defines them. PyYAML's own rules, those of YAML 1.1, read 010 as 8, 1:30 as 90
and 1e3 as text; here they are 10, text and 1000.
"""

import re
from typing import Any

import yaml

from hydroid.errors import SettingsError

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


def read_document(text: str, source: str) -> tuple[Any, dict[tuple[str, ...], int]]:
    """Read one YAML document.

    Returns:
        Its value, and the line [1-based] of each key or item, by its path.

    Raises:
        SettingsError: not YAML, a key that occurs twice or is not plain text, another type, or too much.
    """
    lines: dict[tuple[str, ...], int] = {}
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
        raise SettingsError(f"is not YAML ({problem})", where=where) from None


def read_value(text: str, source: str) -> Any:
    """Read one value, such as the one of an override; raises as `read_document`."""
    return read_document(text, source)[0]


def _collect_lines(
    node: yaml.Node, path: tuple[str, ...], lines: dict[tuple[str, ...], int], source: str
) -> None:
    line = node.start_mark.line + 1
    where = f"{source}, line {line}"
    if len(lines) >= MAX_NODES:
        raise SettingsError(f"holds more than {MAX_NODES} values", where=source)
    if len(path) > MAX_DEPTH:
        raise SettingsError(f"is nested more than {MAX_DEPTH} deep", where=where)
    if node.tag not in _TYPES:
        raise SettingsError(f"a value of type {node.tag.removeprefix(_TAG)!r} is not allowed", where=where)
    if isinstance(node, yaml.ScalarNode) and not _is_text(node.value):
        raise SettingsError("a text contains characters that cannot be printed", where=where)
    lines.setdefault(path, line)
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise SettingsError("a key must be plain text or a number", where=f"{source}, line {line}")
            here = (*path, _spelt(key))
            if here in lines:
                where = f"{source}, line {key.start_mark.line + 1}"
                raise SettingsError(f"{'.'.join(here)} occurs twice", where=where)
            lines[here] = key.start_mark.line + 1
            _collect_lines(value, here, lines, source)
    elif isinstance(node, yaml.SequenceNode):
        for index, value in enumerate(node.value):
            _collect_lines(value, (*path, str(index)), lines, source)


def _is_text(value: str) -> bool:
    return all(c.isprintable() or c in "\t\n" for c in value)


def _spelt(key: yaml.ScalarNode) -> str:
    """The key in one spelling, since 02 and 2 are the same joint."""
    return str(int(key.value)) if key.tag == f"{_TAG}int" else str(key.value)
