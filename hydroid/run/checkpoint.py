"""A search's state as a file: whole, checked before it is believed, and the one before it kept."""

import hashlib
import io
import json
import logging
from collections import UserDict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import RunError
from hydroid.files import undisturbed, write_atomic
from hydroid.fitting.memo import Memo
from hydroid.fitting.search import Checkpoint, SearchState
from hydroid.search.algorithm import Population

PREVIOUS, DAMAGED = "checkpoint.previous.npz", "checkpoint.damaged.npz"
"""names of the checkpoint before the newest, and of a newest one that turned out to be damaged"""

ANOTHER = "is another run's"

Arrays = dict[str, NDArray[Any]]

_log = logging.getLogger(__name__)


def write_checkpoint(file: Path, state: SearchState, memo: Memo, run: str) -> None:
    """Write the checkpoint of a run, by its id, as npz without pickle; the one before it becomes PREVIOUS.

    Raises:
        RunError: it cannot be written. Both that were there before are as they were.
    """
    theta, values = memo.arrays()
    arrays = {
        "chromosomes": state.population.chromosomes,
        "objectives": state.population.objectives,
        "history": state.history,
        "memo_theta": theta,
        "memo_values": values,
        "rng": np.frombuffer(json.dumps(state.rng).encode(), dtype=np.uint8),
    }
    with undisturbed():
        write_atomic(file, _content(arrays, run), keep=file.with_name(PREVIOUS))


def read_checkpoint(file: Path, run: str) -> Checkpoint | None:
    """Read a run's newest checkpoint that is whole; None where it was stopped before its first.

    A damaged one is put aside as DAMAGED with a warning, and the one before it is taken: what the search did
    since is done again, to the same bits.

    Raises:
        RunError: none is whole, or it is that of another run.
    """
    previous = file.with_name(PREVIOUS)
    if not file.exists():
        return _search(previous, run) if previous.exists() else None
    try:
        return _search(file, run)
    except RunError as error:
        if not previous.exists():
            raise
        earlier = _search(previous, run)
        _log.warning("%s: %s; going on from the checkpoint before it", error.where, error.what)
        file.replace(file.with_name(DAMAGED))
        return earlier


class RefinementCheckpoints(UserDict[str, Arrays]):
    """How far the refinements of a run are, by name; every change is written to one file.

    A damaged file is put aside with a warning. The refinements are then done again, to the same bits.

    Args:
        file: is made with the first checkpoint.
        run: id of the run.

    Raises:
        RunError: the file is another run's; on a change, it cannot be written.
    """

    def __init__(self, file: Path, run: str) -> None:
        super().__init__()
        self._file, self._run = file, run
        if not file.exists():
            return
        try:
            arrays = _read(file, run)
        except RunError as error:
            if error.what == ANOTHER:
                raise
            _log.warning("%s: %s; its refinements are done again", error.where, error.what)
            file.replace(file.with_suffix(".damaged.npz"))
            return
        for key, array in arrays.items():
            name, _, part = key.partition("/")
            self.data.setdefault(name, {})[part] = array

    def __setitem__(self, name: str, arrays: Arrays) -> None:
        self.data[name] = arrays
        content = {f"{n}/{part}": a for n, several in self.data.items() for part, a in several.items()}
        with undisturbed():
            write_atomic(self._file, _content(content, self._run))


def _search(file: Path, run: str) -> Checkpoint:
    arrays = _read(file, run)
    try:
        population = Population(arrays["chromosomes"], arrays["objectives"])
        state = SearchState(population, json.loads(arrays["rng"].tobytes()), arrays["history"])
        return Checkpoint(state, (arrays["memo_theta"], arrays["memo_values"]))
    except (KeyError, ValueError) as error:
        raise _damaged(file, error) from None


def _content(arrays: Arrays, run: str) -> bytes:
    arrays = arrays | {"run": np.frombuffer(run.encode(), dtype=np.uint8)}
    buffer = io.BytesIO()
    np.savez(buffer, checksum=np.frombuffer(_checksum(arrays), dtype=np.uint8), **arrays)  # pyright: ignore
    return buffer.getvalue()


def _read(file: Path, run: str) -> Arrays:
    """Read arrays that `_content` made.

    Raises:
        RunError: the file is damaged, or another run's.
    """
    try:
        with np.load(file, allow_pickle=False) as data:
            arrays: Arrays = {name: data[name] for name in data.files}
        if arrays.pop("checksum").tobytes() != _checksum(arrays):
            raise ValueError("checksum")
        owner = arrays.pop("run").tobytes().decode()
    except Exception as error:  # a damaged zip fails in many ways; all mean the same to the user
        raise _damaged(file, error) from None
    if owner != run:
        raise RunError(ANOTHER, where=str(file), hint="put the run's own checkpoint back")
    return arrays


def _damaged(file: Path, error: Exception) -> RunError:
    hint = "remove the run's checkpoints to begin again from the seed"
    return RunError(f"is damaged ({type(error).__name__})", where=str(file), hint=hint)


def _checksum(arrays: Arrays) -> bytes:
    """Of names, types, shapes and contents: the zip's own CRC is not looked at where a header lies."""
    digest = hashlib.sha256()
    for name, array in sorted(arrays.items()):
        digest.update(f"{name} {array.dtype.str} {array.shape};".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.digest()
