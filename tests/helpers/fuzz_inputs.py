"""Damaged files, from a generator's seed: bytes, lines, tokens, and the trees of YAML, JSON and XML."""

import codecs
import copy
import re
from collections.abc import Callable
from random import Random
from typing import Any
from xml.etree import ElementTree

TOKENS = (
    *(
        "",
        "0",
        "-0",
        "1e308",
        "-1e308",
        "1e999",
        "1e-320",
        "nan",
        "inf",
        "-inf",
        ".nan",
        ".inf",
        "-.inf",
        "1e3",
    ),
    *("true", "false", "null", "yes", "off", "~", "0x1F", "010", "1_0", "1,5", "1:30", "2024-01-01", "1.5.2"),
    *("9" * 30, "9" * 400, "9" * 5000, "0x" + "f" * 6000, "a" * 5000, "٣", "é", "\u2028", "\x1b[31m", "\x85"),
    *(
        '"',
        "'",
        '""',
        '"\n"',
        '"\\ud800"',
        '"\\0"',
        "\x00",
        "\ufeff",
        "\\",
        "#",
        "%",
        "%s%n",
        "{joint}",
        "{",
        "}",
    ),
    *(
        "[",
        "]",
        "[[[[",
        "- ",
        ": ",
        ", ",
        ";",
        "\t",
        "\n",
        "\r",
        "&a",
        "*a",
        "&a [*a]",
        "<<: *a",
        "|",
        ">",
        "?",
    ),
    *("../../etc/passwd", "/etc/passwd", "/", ".", "..", "~root", "file:///etc/passwd", "http://localhost/x"),
    *("<script>alert(1)</script>", "<b>&amp;", "]]>", "<!--", "&x;", "!!python/object/apply:os.mkdir [made]"),
    *("!!python/name:os.system", "!!set {a, b}", "!!binary aGk=", "!!int x", "=1+1", "sep=;", "# "),
)
VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -0.0, 1, -1, 2, 1.5, 1e308, -1e308, 1e-320, 10**18, 10**30, 10**320),
    *(
        float("nan"),
        float("inf"),
        "",
        "x",
        "1",
        "1e3",
        "nan",
        "../../etc",
        "a" * 300,
        "a" * 5000,
        "\x1b[0m",
        "<b>",
    ),
    *(
        "{joint}",
        "\ud800",
        "\0",
        [],
        {},
        [0, 0],
        [1, 2],
        [2, 1],
        [1] * 100,
        {"x": 1},
        [[1], [2]],
        {1: {2: 3}},
        [None],
    ),
)
WORDS = (
    "linear",
    "rotary",
    "equal",
    "times",
    "ratio",
    "of",
    "fixed",
    "link1",
    "gain",
    "hyd",
    "mech",
    "1",
    "99",
)


def damage(rng: Random, data: bytes, others: list[bytes]) -> bytes:
    """One to four edits of the bytes, most of them at a token or a line."""
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        data = rng.choice(_EDITS)(rng, data, others)
    return data


def _flip(rng: Random, data: bytes, others: list[bytes]) -> bytes:
    out = bytearray(data or b"\0")
    for _ in range(rng.choice((1, 1, 8))):
        out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)
    return bytes(out)


def _cut(rng: Random, data: bytes, others: list[bytes]) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def _remove(rng: Random, data: bytes, others: list[bytes]) -> bytes:
    start = rng.randrange(len(data) + 1)
    return data[:start] + data[start + rng.choice((1, 2, 9, 100)) :]


def _insert(rng: Random, data: bytes, others: list[bytes]) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + _token(rng) + data[at:]


def _replace(rng: Random, data: bytes, others: list[bytes]) -> bytes:
    words = [*re.finditer(rb"[A-Za-z0-9_.+-]+", data[:100_000])]
    if not words:
        return data
    word = rng.choice(words)
    return data[: word.start()] + _token(rng) + data[word.end() :]


def _nudge(rng: Random, data: bytes, others: list[bytes]) -> bytes:
    """A number a little different: the kind of fault that is accepted, and must come out as it stands."""
    numbers = [*re.finditer(rb"-?\d+\.?\d*", data[:100_000])]
    if not numbers:
        return data
    number = rng.choice(numbers)
    value = float(number[0][:30]) * rng.choice((-1, 0.1, 0.5, 1.01, 2, 1e3)) + rng.choice((0, 0, 1))
    return data[: number.start()] + f"{value:.6g}".encode() + data[number.end() :]


def _lines(rng: Random, data: bytes, others: list[bytes]) -> bytes:
    lines = data.split(b"\n")
    at, to = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(4):
        case 0:
            del lines[at]
        case 1:
            lines.insert(to, lines[at])
        case 2:
            lines[at], lines[to] = lines[to], lines[at]
        case _:
            lines[at] = lines[at] * rng.choice((2, 3, 1000))
    return b"\n".join(lines)


def _encode(rng: Random, data: bytes, others: list[bytes]) -> bytes:
    text = data.decode("latin-1")
    match rng.randrange(8):
        case 0:
            return codecs.BOM_UTF8 + data
        case 1:
            return text.encode("utf-16")
        case 2:
            return text.encode("utf-16-be")
        case 3:
            return text.encode("utf-32")
        case 4:
            return data.replace(b"\n", b"\r\n")
        case 5:
            return data.replace(b"\n", b"\r")
        case 6:
            return data.replace(b",", b";")
        case _:
            return data.replace(b",", b"\t").replace(b".", b",")


def _splice(rng: Random, data: bytes, others: list[bytes]) -> bytes:
    other = rng.choice(others)
    return data[: rng.randrange(len(data) + 1)] + other[rng.randrange(len(other) + 1) :]


def _noise(rng: Random, data: bytes, others: list[bytes]) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.randbytes(rng.choice((1, 4, 64, 1000))) + data[at:]


def _token(rng: Random) -> bytes:
    return rng.choice(TOKENS).encode("utf-8", "surrogatepass")


_EDITS: tuple[Callable[[Random, bytes, list[bytes]], bytes], ...] = (
    *(_flip, _cut, _remove, _insert, _insert, _replace, _replace, _replace),
    *(_nudge, _nudge, _nudge, _lines, _lines, _encode, _splice, _noise),
)


def change_tree(rng: Random, tree: Any) -> Any:
    """A mapping with one to three of its values replaced, removed, renamed or added."""
    tree = copy.deepcopy(tree)
    for _ in range(rng.choice((1, 1, 2, 3))):
        holders = [*_holders(tree)]
        holder, key = rng.choice(holders) if holders else ({"x": 1}, "x")
        match rng.randrange(8):
            case 0:
                del holder[key]
            case 1 if isinstance(holder, dict):
                holder[rng.choice((*WORDS, key, 1, 1.5, None, True))] = holder.pop(key)
            case 2 if isinstance(holder, dict):
                holder[rng.choice(WORDS)] = copy.deepcopy(rng.choice(VALUES))
            case 3 if len(holders) > 1:
                holder[key] = copy.deepcopy(rng.choice([h[k] for h, k in holders]))
            case 4 | 5 if isinstance(holder[key], int | float) and abs(holder[key]) < 1e300:
                holder[key] = type(holder[key])(holder[key] * rng.choice((0.5, 2, -1, 3, 1.01, 1e6)))
            case _:
                holder[key] = copy.deepcopy(rng.choice((*VALUES, *WORDS)))
    return tree


def _holders(tree: Any) -> Any:
    """Every mapping or list of the tree with each of its keys or positions."""
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, value in items:
        yield tree, key
        yield from _holders(value)


def change_xml(rng: Random, text: str) -> str:
    """An XML document with attributes replaced, elements removed, copied or moved."""
    root = ElementTree.fromstring(text)
    for _ in range(rng.choice((1, 1, 2, 3))):
        parents = [e for e in root.iter() if len(e)]
        element = rng.choice([*root.iter()])
        parent = rng.choice(parents)
        child = rng.choice([*parent])
        match rng.randrange(6):
            case 0:
                parent.remove(child)
            case 1:
                parent.append(copy.deepcopy(child))
            case 2:
                rng.choice([e for e in root.iter() if e is not child]).append(copy.deepcopy(child))
            case 3:
                tag = rng.choice(
                    ("include", "mesh", "equality", "texture", "joint", "freejoint", "body", "plugin")
                )
                element.append(ElementTree.Element(tag, {"file": rng.choice(TOKENS[-24:]) or "x"}))
            case _ if element.attrib:
                name = rng.choice([*element.attrib])
                numbers = [
                    str(rng.choice((0, -1, 1e-9, 1e9, 0.5, "nan"))) for _ in element.attrib[name].split()
                ]
                element.attrib[name] = rng.choice((*TOKENS, *[" ".join(numbers)] * 40))
            case _:
                element.attrib[rng.choice(("name", "pos", "file", "class", "mass"))] = rng.choice(TOKENS)
    return re.sub(
        r"[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]", "", ElementTree.tostring(root, encoding="unicode")
    )
