"""A run's checkpoints as a file: whole, checked before it is believed, and the one before it kept."""

import hashlib
import io
import logging
from collections import UserDict
from pathlib import Path

import numpy as np

from hydroid.errors import RunError
from hydroid.files import undisturbed, write_atomic
from hydroid.fitting.checkpoints import Arrays

_log = logging.getLogger(__name__)


class CheckpointFile(UserDict[str, Arrays]):
    """Checkpoints by name; every change is written to one file, as npz without pickle.

    The file before it is kept as `checkpoint.previous.npz`. Where the newest one is damaged, it is put aside
    as `checkpoint.damaged.npz` with a warning, and the one before it is taken: what the run did since is done
    again, to the same bits.

    Args:
        file: is made with the first checkpoint.
        run: id of the run.

    Raises:
        RunError: none is whole, or it is that of another run; on a change, it cannot be written, and both
            files are as they were.
    """

    def __init__(self, file: Path, run: str) -> None:
        super().__init__()
        self._file, self._run = file, run
        self._previous = file.with_suffix(f".previous{file.suffix}")
        present = [path for path in (file, self._previous) if path.exists()]
        if present:
            self.data = self._read(*present)

    def __setitem__(self, name: str, arrays: Arrays) -> None:
        self.data[name] = arrays
        flat = {f"{n}/{part}": array for n, several in self.data.items() for part, array in several.items()}
        flat["run"] = np.array(self._run)
        buffer = io.BytesIO()
        with undisturbed():
            # sorted: what a run ends with does not depend on where it was interrupted
            np.savez(buffer, checksum=_checksum(flat), **dict(sorted(flat.items())))  # pyright: ignore
            write_atomic(self._file, buffer.getvalue(), keep=self._previous)

    def _read(self, file: Path, *before: Path) -> dict[str, Arrays]:
        """Read a file; where it is damaged, the one before it."""
        try:
            with np.load(file, allow_pickle=False) as data:
                flat: Arrays = {name: data[name] for name in data.files}
            if flat.pop("checksum") != _checksum(flat):
                raise ValueError("checksum")
        except Exception as error:  # a damaged zip fails in many ways; all mean the same to the user
            damage = f"is damaged ({type(error).__name__})"
            if not before:
                hint = "remove the run's checkpoints to begin again from the seed"
                raise RunError(damage, where=str(file), hint=hint) from None
            earlier = self._read(*before)
            _log.warning("%s: %s; going on from the checkpoint before it", file, damage)
            file.replace(file.with_suffix(f".damaged{file.suffix}"))
            return earlier
        if str(flat.pop("run")) != self._run:
            raise RunError("is another run's", where=str(file), hint="put the run's own checkpoint back")
        result: dict[str, Arrays] = {}
        for key, array in flat.items():
            name, _, part = key.partition("/")
            result.setdefault(name, {})[part] = array
        return result


def _checksum(arrays: Arrays) -> str:
    """Of names, types, shapes and contents: the zip's own CRC is not looked at where a header lies."""
    digest = hashlib.sha256()
    for name, array in sorted(arrays.items()):
        digest.update(f"{name} {array.dtype.str} {array.shape};".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
