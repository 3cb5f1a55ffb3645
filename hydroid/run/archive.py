"""Trees of dataclasses, mappings, sequences and arrays as npz without pickle, checked when read."""

import hashlib
import io
import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np


def pack(tree: object, *, compressed: bool = True) -> bytes:
    """Return a tree as npz: its arrays as they are, and what is left as JSON under `content`.

    A digest of the file follows its last byte: a zip's own checks leave its headers out.
    """
    arrays: dict[str, np.ndarray] = {}

    def plain(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            arrays[name := f"a{len(arrays)}"] = value
            return {"array": name}
        if is_dataclass(value):
            return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
        if isinstance(value, Mapping):
            return {str(key): plain(one) for key, one in value.items()}
        if isinstance(value, tuple | list):
            return [plain(one) for one in value]
        return value.item() if isinstance(value, np.generic) else value

    content = np.frombuffer(json.dumps(plain(tree)).encode(), dtype=np.uint8)
    buffer, save = io.BytesIO(), np.savez_compressed if compressed else np.savez
    save(buffer, content=content, **arrays)  # pyright: ignore[reportArgumentType]
    return buffer.getvalue() + hashlib.sha256(buffer.getvalue()).digest()


def unpack(file: Path) -> Any:
    """Read a tree that `pack` made, its dataclasses as mappings and its sequences as lists.

    Raises:
        ValueError: the file is damaged. OSError: it cannot be read.
    """
    packed = file.read_bytes()
    data, digest = packed[:-32], packed[-32:]
    if hashlib.sha256(data).digest() != digest:
        raise ValueError("checksum")
    arrays = np.load(io.BytesIO(data), allow_pickle=False)

    def filled(value: Any) -> Any:
        if isinstance(value, dict):
            if value.keys() == {"array"}:
                return arrays[value["array"]]
            return {key: filled(one) for key, one in value.items()}
        return [filled(one) for one in value] if isinstance(value, list) else value

    return filled(json.loads(arrays["content"].tobytes()))
