"""A search's state as a file: whole, checked before it is believed, and the one before it kept."""

import hashlib
import io
import json
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import RunError
from hydroid.files import undisturbed, write_atomic
from hydroid.fitting.search import Checkpoint, SearchState
from hydroid.problem.problem import Memo
from hydroid.search.algorithm import Population

PREVIOUS, DAMAGED = "checkpoint.previous.npz", "checkpoint.damaged.npz"
"""names of the checkpoint before the newest, and of a newest one that turned out to be damaged"""

_log = logging.getLogger(__name__)


def write_checkpoint(file: Path, state: SearchState, memo: Memo, run: str) -> None:
    """Write the checkpoint of a run, by its id, as npz without pickle; the one before it becomes PREVIOUS.

    Raises:
        RunError: it cannot be written. Both that were there before are as they were.
    """
    with undisturbed():
        write_atomic(file, _content(state, memo, run), keep=file.with_name(PREVIOUS))


def _content(state: SearchState, memo: Memo, run: str) -> bytes:
    theta, values = memo.arrays()
    arrays: dict[str, Any] = {
        "chromosomes": state.population.chromosomes,
        "objectives": state.population.objectives,
        "history": state.history,
        "memo_theta": theta,
        "memo_values": values,
        "rng": np.frombuffer(json.dumps(state.rng).encode(), dtype=np.uint8),
        "run": np.frombuffer(run.encode(), dtype=np.uint8),
    }
    buffer = io.BytesIO()
    np.savez(buffer, checksum=np.frombuffer(_checksum(arrays), dtype=np.uint8), **arrays)
    return buffer.getvalue()


def read_checkpoint(file: Path, run: str) -> Checkpoint | None:
    """Read a run's newest checkpoint that is whole; None where it was stopped before its first.

    A damaged one is put aside as DAMAGED with a warning, and the one before it is taken: what the search did
    since is done again, to the same bits.

    Raises:
        RunError: none is whole, or it is that of another run.
    """
    previous = file.with_name(PREVIOUS)
    if not file.exists():
        return _read(previous, run) if previous.exists() else None
    try:
        return _read(file, run)
    except RunError as error:
        if not previous.exists():
            raise
        earlier = _read(previous, run)
        _log.warning("%s: %s; going on from the checkpoint before it", error.where, error.what)
        file.replace(file.with_name(DAMAGED))
        return earlier


def _read(file: Path, run: str) -> Checkpoint:
    try:
        with np.load(file, allow_pickle=False) as data:
            arrays: dict[str, NDArray[Any]] = {name: data[name] for name in data.files}
        if arrays.pop("checksum").tobytes() != _checksum(arrays):
            raise ValueError("checksum")
        population = Population(arrays["chromosomes"], arrays["objectives"])
        state = SearchState(population, json.loads(arrays["rng"].tobytes()), arrays["history"])
        memo, owner = (arrays["memo_theta"], arrays["memo_values"]), arrays["run"].tobytes().decode()
    except Exception as error:  # a damaged zip fails in many ways; all mean the same to the user
        hint = "remove the run's checkpoints to begin again from the seed"
        raise RunError(f"is damaged ({type(error).__name__})", where=str(file), hint=hint) from None
    if owner != run:
        raise RunError("is another run's", where=str(file), hint="put the run's own checkpoint back")
    return Checkpoint(state, memo)


def _checksum(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Of names, types, shapes and contents: the zip's own CRC is not looked at where a header lies."""
    digest = hashlib.sha256()
    for name, array in sorted(arrays.items()):
        digest.update(f"{name} {array.dtype.str} {array.shape};".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.digest()
