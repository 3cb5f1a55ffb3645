"""MATLAB files of version 5 to 7 as bytes, looked through before scipy reads them.

A variable is an element: a tag of kind and size, and its content, which for a matrix is
elements again. scipy crashes on kinds of numbers that do not exist, and unpacks a
variable of any size.
"""

import struct
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO, NoReturn, Protocol

MATRIX = 14
COMPRESSED = 15
"""kinds of elements that hold others"""
NUMBERS = (1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18)
"""kinds of elements that hold numbers or text"""
HOLDERS = (1, 2, 3, 16, 17)
"""classes of matrices that hold others: cells, structs, objects, functions, opaque
ones"""
DEEPEST = 100
PIECE = 1 << 16


class _Bytes(Protocol):
    def read(self, size: int, /) -> bytes: ...

    def skip(self, size: int, /) -> None: ...


class _Plain:
    """Bytes that stand in the file."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def read(self, size: int, /) -> bytes:
        return self._file.read(size)

    def skip(self, size: int, /) -> None:
        self._file.seek(size, 1)


class _Compressed:
    """The next bytes of the file, unpacked piece by piece."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file = file
        self._left = size
        self._unpacker = zlib.decompressobj()
        self._ready = b""

    def read(self, size: int, /) -> bytes:
        while len(self._ready) < size and (piece := self._unpacked()):
            self._ready += piece
        data = self._ready[:size]
        self._ready = self._ready[size:]
        return data

    def skip(self, size: int, /) -> None:
        while size > 0 and (piece := self.read(min(size, PIECE))):
            size -= len(piece)

    def _unpacked(self) -> bytes:
        while True:
            packed = self._unpacker.unconsumed_tail
            if not packed:
                packed = self._file.read(min(self._left, PIECE))
                self._left -= len(packed)
            if not packed:
                return b""
            if data := self._unpacker.decompress(packed, PIECE):
                return data


def large_variables(path: Path, names: Sequence[str], most: int) -> list[str]:
    """Return the variables of a file, by `names` in its order, that unpack to more than
    `most` bytes.

    Version 4 has no compressed ones, and the file's size is that of the others.

    Raises:
        ValueError: an element of another variable is damaged.
    """
    with path.open("rb") as file:
        head = file.read(128)
        if head[126:] not in (b"IM", b"MI"):
            return []
        # the letters tell in which order the writer's machine stores bytes
        order = "<" if head[126:] == b"IM" else ">"
        sizes = list[int]()
        while len(tag := file.read(8)) == 8:
            kind, size = struct.unpack(f"{order}2I", tag)
            end = file.tell() + size
            data = _Compressed(file, size) if kind == COMPRESSED else _Plain(file)
            if kind == COMPRESSED:
                # a file that was cut off ends within the tag
                inner = data.read(8).ljust(8, b"\0")
                kind, size = struct.unpack(f"{order}2I", inner)
            sizes.append(size)
            if kind == MATRIX and size <= most:
                _look_through(data, size, order, depth=1)
            file.seek(end)
    return [name for name, size in zip(names, sizes, strict=False) if size > most]


def _look_through(data: _Bytes, size: int, order: str, depth: int) -> None:
    """Read the tags of all elements in a matrix of some bytes."""
    holds = False
    first = True
    while size > 0:
        kind, length, used = _tag(data, order)
        size -= used
        if size < 0:
            _refuse("an element is longer than what holds it")
        if kind == MATRIX and holds and depth < DEEPEST:
            _look_through(data, length, order, depth + 1)
        elif kind not in NUMBERS:
            _refuse(f"an element is of kind {kind}")
        elif first and used > 8:
            # the first element of a matrix tells its class in its lowest byte
            content = data.read(used - 8)
            word = content[:4].ljust(4, b"\0")
            (flags,) = struct.unpack(f"{order}I", word)
            holds = flags & 0xFF in HOLDERS
        else:
            data.skip(used - 8)
        first = False


def _tag(data: _Bytes, order: str) -> tuple[int, int, int]:
    """Read a tag: the kind, the length of the content, and of both with their padding
    [bytes].

    Up to four bytes of content stand in the tag.
    """
    tag = data.read(8)
    if len(tag) < 8:
        _refuse("it ends within a variable")
    kind, length = struct.unpack(f"{order}2I", tag)
    length_in_tag = kind >> 16
    if length_in_tag:
        return kind & 0xFFFF, length_in_tag, 8
    padded = -(-length // 8) * 8
    return kind, length, 8 + padded


def _refuse(what: str) -> NoReturn:
    raise ValueError(f"damaged: {what}")
