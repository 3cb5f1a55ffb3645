"""Damaged files from a seed: edits of bytes, lines and tokens."""

import codecs
import re
from collections.abc import Callable
from random import Random

NUMBERS = (
    """0 -0 1e308 -1e308 1e999 1e-320 nan inf -inf .nan .inf 1e3 0x1F 010 1_0 1,5 1:30 2024-01-01 1.5.2"""
)
MARKS = """true false null yes off ~ " ' "" [ ] [[[[ { } # % %s%n {joint} &a *a <<:*a | > ? ; =1+1 sep=;"""
TOKENS = (
    *("", *NUMBERS.split(), *MARKS.split()),
    *("9" * 30, "9" * 5000, "0x" + "f" * 6000, "a" * 5000, "٣", "é", "\u2028", "\x1b[31m", "\x85", "\x00"),
    *("&a [*a]", "- ", ": ", "\t", "\n", "\r", '"\\ud800"', "\ufeff", "\\", "# "),
    *("../../etc/passwd", "/", "..", "~root", "file:///etc/passwd", "<script>alert(1)</script>", "&x;"),
    *("!!python/object/apply:os.mkdir [made]", "!!python/name:os.system", "!!set {a, b}", "!!int x"),
)
Edit = Callable[[Random, bytes], bytes]


def damage(rng: Random, data: bytes) -> bytes:
    """Make one to four edits of the bytes, most of them at a token or a line."""
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        data = rng.choice(EDITS)(rng, data)
    return data


def _flip(rng: Random, data: bytes) -> bytes:
    out = bytearray(data or b"\0")
    for _ in range(rng.choice((1, 1, 8))):
        out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)
    return bytes(out)


def _cut(rng: Random, data: bytes) -> bytes:
    start = rng.randrange(len(data) + 1)
    return rng.choice((data[:start], data[:start] + data[start + rng.choice((1, 2, 9, 100)) :]))


def _insert(rng: Random, data: bytes) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.choice((_token(rng), rng.randbytes(rng.choice((1, 4, 64, 1000))))) + data[at:]


def _replace(rng: Random, data: bytes) -> bytes:
    """Replace a word by a token, or a number by one that differs a little."""
    words = [*re.finditer(rb"[A-Za-z0-9_.+-]+", data[:100_000])]
    if not words:
        return data
    word = rng.choice(words)
    new = _token(rng)
    if re.fullmatch(rb"-?\d{1,12}\.?\d*", word[0]) and rng.random() < 0.7:
        value = float(word[0]) * rng.choice((-1, 0.1, 0.5, 1.01, 2, 1e3)) + rng.choice((0, 0, 1))
        new = f"{value:.6g}".encode()
    return data[: word.start()] + new + data[word.end() :]


def _lines(rng: Random, data: bytes) -> bytes:
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


def _encode(rng: Random, data: bytes) -> bytes:
    text = data.decode("latin-1")
    encodings = ("utf-16", "utf-16-be", "utf-32")
    ends = (b"\r\n", b"\r")
    return rng.choice(
        (
            codecs.BOM_UTF8 + data,
            text.encode(rng.choice(encodings)),
            data.replace(b"\n", rng.choice(ends)),
            data.replace(b",", b";"),
            data.replace(b",", b"\t").replace(b".", b","),
        )
    )


def _token(rng: Random) -> bytes:
    return rng.choice(TOKENS).encode("utf-8", "surrogatepass")


EDITS: tuple[Edit, ...] = (_flip, _cut, _insert, _insert, *[_replace] * 6, _lines, _lines, _encode)
