"""A run's checkpoints as a file: whole, checked before it is believed, and the one before it kept."""

import logging
from collections import UserDict
from pathlib import Path

from hydroid.errors import RunError
from hydroid.files import undisturbed, write_atomic
from hydroid.fitting.checkpoints import Arrays
from hydroid.run.archive import pack, unpack

_log = logging.getLogger(__name__)


class CheckpointFile(UserDict[str, Arrays]):
    """Checkpoints by name; every change is written to one file.

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
        # sorted: what a run ends with does not depend on where it was interrupted
        tree = {part: dict(sorted(self.data[part].items())) for part in sorted(self.data)}
        with undisturbed():
            packed = pack({"run": self._run, "parts": tree}, compressed=False)
            write_atomic(self._file, packed, keep=self._previous)

    def _read(self, file: Path, *before: Path) -> dict[str, Arrays]:
        """Read a file; where it is damaged, the one before it."""
        try:
            content = unpack(file)
        except (ValueError, OSError) as error:
            if not before:
                hint = "remove the run's checkpoints to begin again from the seed"
                what = f"is damaged ({type(error).__name__})"
                raise RunError(what, where=str(file), hint=hint) from None
            earlier = self._read(*before)
            _log.warning("%s: is damaged; going on from the checkpoint before it", file)
            file.replace(file.with_suffix(f".damaged{file.suffix}"))
            return earlier
        if content["run"] != self._run:
            raise RunError("is another run's", where=str(file), hint="put the run's own checkpoint back")
        return content["parts"]
