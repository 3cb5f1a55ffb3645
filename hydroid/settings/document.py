"""YAML text -> plain values: mappings, lists, text, numbers, true, false and null,
and nothing else.

Scalars are read as YAML 1.2 defines them. PyYAML's own rules, those of YAML 1.1, read
010 as 8, 1:30 as 90 and 1e3 as text; here they are 10, text and 1000.
"""

import re
from pathlib import Path
from typing import Any

import yaml

from hydroid.errors import SettingsError
from hydroid.files import read_file

Lines = dict[tuple[str, ...], int]  # line [1-based] of each key or item, by its path

MOST_BYTES = 2**18
MOST_VALUES = 20_000
"""in one document of settings"""
MOST_CHARACTERS = 2**20
"""of all texts in one document"""
DEEPEST = 40
"""lists and mappings inside each other"""
_PLAIN = {
    "mapping values are not allowed": (
        "there is a second ': ' in this line, or the line is indented too far"
    ),
    "\\t": "a line is indented by a tab; use spaces",
    "expected ',' or ']'": "a list [a, b] is not closed with ']'",
    "expected ',' or '}'": "a mapping {a: 1} is not closed with '}'",
}
"""what the YAML reader stumbled over, by a part of its message"""
_WORDS = {"": None, "~": None, "null": None, "true": True, "false": False}
_INTEGER = re.compile(r"[-+]?[0-9]{1,300}")  # longer ones are beyond any float
_NUMBER = re.compile(
    r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)(e[-+]?[0-9]+)?|[-+]?\.inf|\.nan", re.IGNORECASE
)


def read_yaml(path: Path, times: int = 1) -> tuple[dict[str, Any], Lines]:
    """Read a file that holds one mapping. It may be `times` as large as settings
    are."""
    most = times * MOST_BYTES
    try:
        data = read_file(path, most + 1)
        text = data.decode("utf-8-sig")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it is not UTF-8 text"
        raise SettingsError(f"cannot be read ({reason})", path) from None
    if len(data) > most:
        raise SettingsError(
            f"is larger than {most >> 10} KiB, too large for settings", path
        )
    values, lines = read_document(text, path, times)
    if not isinstance(values, dict):
        raise SettingsError(
            "must be a mapping of settings", path, "write `key: value` lines"
        )
    return values, lines


def read_document(text: str, source: object, times: int = 1) -> tuple[Any, Lines]:
    """Read one YAML document. It may hold `times` as many values as settings do."""
    reader = _Reader(source, times * MOST_VALUES)
    try:
        # every scalar is text
        node = yaml.compose(text, Loader=yaml.BaseLoader)
        value = None
        if node is not None:
            value = reader.value(node, ())
    except yaml.YAMLError as error:
        raise _not_yaml(error, source) from None
    except RecursionError:
        raise SettingsError("is not YAML: it is nested too deeply", source) from None
    return value, reader.lines


def _not_yaml(error: yaml.YAMLError, source: object) -> SettingsError:
    """Return what the YAML reader stumbled over, in plain words, and where."""
    mark = getattr(error, "problem_mark", None)
    where = source
    if mark:
        where = f"{source}, line {mark.line + 1}, column {mark.column + 1}"
    problem = getattr(error, "problem", None) or getattr(error, "reason", None)
    plain = next(
        (words for part, words in _PLAIN.items() if part in str(problem)), problem
    )
    return SettingsError(f"is not YAML: {plain}", where)


class _Reader:
    """Turns nodes into values, and notes the lines of all that is in them.

    What stands behind an alias counts whenever it is used: a few lines cannot expand to
    billions.
    """

    def __init__(self, source: object, most: int) -> None:
        self.lines: Lines = {}
        self._source = source
        self._most = most  # values
        self._characters = 0

    def value(self, node: yaml.Node, path: tuple[str, ...]) -> Any:
        """Return the value of a node at a path of keys."""
        if len(self.lines) >= self._most:
            raise SettingsError(f"holds more than {self._most} values", self._source)
        where = self._place(node)
        if len(path) > DEEPEST:
            raise SettingsError(f"is nested more than {DEEPEST} deep", where)
        kind = node.tag.removeprefix("tag:yaml.org,2002:")
        if kind not in ("str", "seq", "map"):
            raise SettingsError(f"a value of type {kind!r} is not allowed", where)
        self.lines.setdefault(path, node.start_mark.line + 1)
        if isinstance(node, yaml.ScalarNode):
            return self._scalar(node)
        if isinstance(node, yaml.SequenceNode):
            return [
                self.value(item, (*path, str(index)))
                for index, item in enumerate(node.value)
            ]
        return self._mapping(node, path)

    def _mapping(self, node: yaml.Node, path: tuple[str, ...]) -> dict[Any, Any]:
        values: dict[Any, Any] = {}
        for key, item in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise SettingsError(
                    "a key must be plain text or a number", self._place(key)
                )
            name = self._scalar(key)
            # paths hold text: 02 and 2 are the same joint
            item_path = (*path, str(name))
            if item_path in self.lines:
                raise SettingsError(
                    f"{'.'.join(item_path)} occurs twice", self._place(key)
                )
            self.lines[item_path] = key.start_mark.line + 1
            values[name] = self.value(item, item_path)
        return values

    def _place(self, node: yaml.Node) -> str:
        return f"{self._source}, line {node.start_mark.line + 1}"

    def _scalar(self, node: yaml.ScalarNode) -> Any:
        text = str(node.value)
        self._characters += len(text)
        if self._characters > MOST_CHARACTERS:
            raise SettingsError(
                f"holds more than {MOST_CHARACTERS} characters of text", self._source
            )
        if not all(letter.isprintable() or letter in "\t\n" for letter in text):
            raise SettingsError(
                "a text contains characters that cannot be printed", self._place(node)
            )
        # a plain scalar is neither quoted nor a block of text
        is_plain = node.style is None
        if is_plain:
            return _plain_value(text)
        return text


def _plain_value(text: str) -> Any:
    """Return what a plain scalar stands for by the rules of YAML 1.2."""
    word = text.lower()
    if word in _WORDS:
        return _WORDS[word]
    if _INTEGER.fullmatch(text):
        return int(text)
    if _NUMBER.fullmatch(text):
        # Python spells .inf and .nan without the point
        return float(re.sub(r"\.(?=[in])", "", word))
    return text
