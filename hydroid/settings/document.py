"""YAML text -> plain values: what a file of settings can hold, and no more.

Words are read as YAML 1.2 reads them. Version 1.1, PyYAML's own, takes 010 for 8, 1:30 for 90 and 1e3 for
text; here they are 10, text and 1000. There are mappings, lists, text, numbers, true, false and null.
"""

import re
from typing import Any

import yaml

from hydroid.errors import SettingsError

MOST_NODES = (
    20_000  # aliases counted as often as they are used, so that a few lines cannot stand for billions
)
DEEPEST = 40
_TAG = "tag:yaml.org,2002:"
_TYPES = {_TAG + name for name in ("map", "seq", "str", "int", "float", "bool", "null")}


class _Loader(yaml.SafeLoader):
    """A safe loader without the special words of YAML 1.1: merge keys, dates, base 60, octal, yes and no."""

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
        Its value, and the line [1-based] on which each key or item stands, by its path.

    Raises:
        SettingsError: not YAML, a key that stands there twice or is no plain word, another type, or too much.
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
            problem = "it is nested too deeply" if deep else "a value that its type cannot hold"
        raise SettingsError(f"is not YAML ({problem})", where=where) from None


def read_value(text: str, source: str) -> Any:
    """Read one value, such as that of a `--set`; raises as `read_document`."""
    return read_document(text, source)[0]


def _collect_lines(
    node: yaml.Node, path: tuple[str, ...], lines: dict[tuple[str, ...], int], source: str
) -> None:
    line = node.start_mark.line + 1
    where = f"{source}, line {line}"
    if len(lines) >= MOST_NODES:
        raise SettingsError(f"holds more than {MOST_NODES} values", where=source)
    if len(path) > DEEPEST:
        raise SettingsError(f"is nested more than {DEEPEST} deep", where=where)
    if node.tag not in _TYPES:
        raise SettingsError(f"a value of type {node.tag.removeprefix(_TAG)!r} is not allowed", where=where)
    if isinstance(node, yaml.ScalarNode) and not _is_text(node.value):
        raise SettingsError("a text holds characters that cannot be shown", where=where)
    lines.setdefault(path, line)
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise SettingsError("a key must be a plain word", where=f"{source}, line {line}")
            here = (*path, _spelt(key))
            if here in lines:
                where = f"{source}, line {key.start_mark.line + 1}"
                raise SettingsError(f"{'.'.join(here)} stands there twice", where=where)
            lines[here] = key.start_mark.line + 1
            _collect_lines(value, here, lines, source)
    elif isinstance(node, yaml.SequenceNode):
        for index, value in enumerate(node.value):
            _collect_lines(value, (*path, str(index)), lines, source)


def _is_text(value: str) -> bool:
    return all(c.isprintable() or c in "\t\n" for c in value)


def _spelt(key: yaml.ScalarNode) -> str:
    """The key in one spelling: 02 and 2 are the same joint."""
    return str(int(key.value)) if key.tag == f"{_TAG}int" else str(key.value)
