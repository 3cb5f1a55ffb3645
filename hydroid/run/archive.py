"""What a run stores as npz without pickle: trees of dataclasses, mappings and arrays,
and its checkpoints.

Every file is checked before it is believed.
"""

import hashlib
import io
import json
import math
import zlib
from collections import UserDict
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile

import numpy as np

from hydroid.errors import RunError
from hydroid.files import Plain, read_file, undisturbed, write_atomic
from hydroid.fitting.checkpoints import Arrays
from hydroid.progress import LOGGER

LARGEST = 2**32  # bytes that a file may unpack to


def pack(tree: object, *, compressed: bool = True) -> bytes:
    """Return a tree as npz: its arrays as they are, and what is left as JSON under
    `content`.

    A digest of the file follows its last byte: a zip's own checks leave its headers
    out.
    """
    arrays: dict[str, np.ndarray] = {}

    def plain(value: Any) -> Any:
        """Return what JSON takes in place of a value that it does not know."""
        if isinstance(value, np.ndarray):
            name = f"a{len(arrays)}"
            arrays[name] = value
            return {"array": name}
        if is_dataclass(value):
            return {field.name: getattr(value, field.name) for field in fields(value)}
        if isinstance(value, Mapping):
            return dict(value)
        return value.item()

    text = json.dumps(tree, default=plain)
    content = np.frombuffer(text.encode(), dtype=np.uint8)
    buffer = io.BytesIO()
    save = np.savez_compressed if compressed else np.savez
    save(buffer, content=content, **arrays)  # pyright: ignore[reportArgumentType]
    packed = buffer.getvalue()
    return packed + hashlib.sha256(packed).digest()


def unpack(file: Path) -> Any:
    """Read a tree that `pack` made, its dataclasses as mappings and its sequences as
    lists.

    Raises OSError: the file cannot be read. ValueError: it is not what `pack` writes,
    or unpacks to more than LARGEST.
    """
    packed = read_file(file)
    data = packed[:-32]
    digest = packed[-32:]
    if hashlib.sha256(data).digest() != digest:
        raise ValueError("checksum")
    try:
        arrays = _arrays(data)

        def filled(value: Plain) -> Any:
            if value.keys() == {"array"}:
                return arrays[value["array"]]
            return value

        return json.loads(arrays["content"].tobytes(), object_hook=filled)
    except (
        KeyError,
        TypeError,
        EOFError,
        NotImplementedError,
        RecursionError,
        BadZipFile,
        zlib.error,
    ):
        raise ValueError("content") from None


def _arrays(data: bytes) -> dict[str, np.ndarray]:
    """Return the arrays of an npz by name: numbers only,
    and none larger than the bytes that it has.

    `np.load` makes room for what an array's header says before it looks at its bytes.
    """
    arrays: dict[str, np.ndarray] = {}
    with ZipFile(io.BytesIO(data)) as archive:
        if sum(member.file_size for member in archive.infolist()) > LARGEST:
            raise ValueError("size")
        for member in archive.infolist():
            content = archive.read(member)
            header = io.BytesIO(content)
            if np.lib.format.read_magic(header) != (1, 0):
                raise ValueError("format")
            shape, columns_first, kind = np.lib.format.read_array_header_1_0(header)
            values = np.frombuffer(content, kind, offset=header.tell())
            if values.size != math.prod(shape):
                raise ValueError("shape")
            order = "F" if columns_first else "C"
            name = member.filename.removesuffix(".npy")
            # a copy: what stands on the bytes of the file cannot be written to
            arrays[name] = values.reshape(shape, order=order).copy(order="K")
    return arrays


class CheckpointFile(UserDict[str, Arrays]):
    """Checkpoints by name; every change is written to one file,
    which is made with the first of a run's id.

    The file before it is kept as `checkpoint.previous.npz`. Where the newest one is
    damaged, it is put aside as `checkpoint.damaged.npz` with a warning, and the one
    before it is taken: what the run did since is done again, to the same bits. Raises
    RunError: none is whole, or it is that of another run; on a change, it cannot be
    written, and both files are as they were.
    """

    def __init__(self, file: Path, run: str) -> None:
        super().__init__()
        self._file = file
        self._run = run
        self._previous = file.with_suffix(f".previous{file.suffix}")
        present = [path for path in (file, self._previous) if path.exists()]
        if present:
            self.data = self._read(*present)

    def __setitem__(self, name: str, arrays: Arrays) -> None:
        self.data[name] = arrays
        # sorted: what a run ends with does not depend on where it was interrupted
        tree = {
            part: dict(sorted(self.data[part].items())) for part in sorted(self.data)
        }
        with undisturbed():
            packed = pack({"run": self._run, "parts": tree}, compressed=False)
            write_atomic(self._file, packed, keep=self._previous)

    def _read(self, file: Path, *before: Path) -> dict[str, Arrays]:
        try:
            content = unpack(file)
            if not (isinstance(content, dict) and _are_parts(content.get("parts"))):
                raise ValueError("content")
        except (ValueError, OSError) as error:
            if not before:
                hint = "remove the run's checkpoints to begin again from the seed"
                raise RunError(
                    f"is damaged ({type(error).__name__})", file, hint
                ) from None
            earlier = self._read(*before)
            LOGGER.warning(
                "%s: is damaged; going on from the checkpoint before it", file
            )
            file.replace(file.with_suffix(f".damaged{file.suffix}"))
            return earlier
        if content.get("run") != self._run:
            raise RunError(
                "is another run's", file, "put the run's own checkpoint back"
            )
        return content["parts"]


def _are_parts(parts: Any) -> bool:
    """Return whether what a file holds are arrays by name, by part of a fit."""
    return isinstance(parts, dict) and all(map(_are_arrays, parts.values()))


def _are_arrays(arrays: Any) -> bool:
    """Return whether a value is arrays by name."""
    if not isinstance(arrays, dict):
        return False
    return all(isinstance(array, np.ndarray) for array in arrays.values())
