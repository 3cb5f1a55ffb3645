"""What a refinement has simulated, row by row on the disk, so that a killed one goes on where it was.

A refinement has no state that could be stored: MuJoCo's least squares keeps its own. But it is a function of the
residuals that it is told. A run that is continued asks the same questions again, the journal gives
the answers it has, and the refinement is bit for bit where it stood.
"""

import hashlib
import json
import logging
import struct
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import IO

import numpy as np

from hydroid.files import write_atomic
from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.search.least_squares import Ending, Refinement
from hydroid.settings.search import RefinementSettings

LARGEST = 2**30
"""bytes of residuals kept at most: a refinement that simulates more repeats the rest of it"""

_RECORD = struct.Struct("<16s16scQ")  # checksum of what follows, question, kind, length of the answer
_ROWS, _REFINEMENT = b"r", b"p"

_log = logging.getLogger(__name__)


class Journal:
    """Residuals of the refinement under way, and the results of those that have ended.

    A file of records, each with a checksum, to which residuals are appended. What follows the first damaged
    record, such as a half-written last one, is forgotten. A refinement's result replaces its residuals.

    Args:
        file: is made with the first record.
    """

    def __init__(self, file: Path) -> None:
        self._path = file
        self._rows: dict[bytes, tuple[int, int]] = {}  # where an answer stands in the file, and its length
        self._ended: dict[bytes, bytes] = {}
        self._end = 0
        self._file: IO[bytes] | None = None
        self._full = False
        if file.exists():
            self._read()

    def residuals(self, problem: Problem) -> Callable[[Array], Array]:
        """The problem's residuals, theta (n, P) -> (n, R), simulated where the journal has no answer."""
        about = problem.measured.tobytes()

        def recall(theta: Array) -> Array:
            question = _hash(about, theta.tobytes())
            rows = self._recall(question)
            if rows is not None:
                return rows.reshape(len(theta), -1)
            rows = problem.residuals(theta)
            self._append(question, rows)
            return rows

        return recall

    def refined(self, question: bytes) -> tuple[Refinement, int] | None:
        """What a refinement that has ended found, and its number of simulations; None for one that has not."""
        answer = self._ended.get(question)
        if answer is None:
            return None
        values = json.loads(answer)
        simulated = values.pop("simulated")
        fields = {"point": np.array(values.pop("point")), "ending": Ending[values.pop("ending")]}
        return Refinement(**fields, **values), simulated

    def end(self, question: bytes, refinement: Refinement, simulated: int) -> None:
        """Keep what a refinement found, and forget the residuals.

        Raises:
            RunError: the journal cannot be written.
        """
        values = asdict(refinement) | {"point": refinement.point.tolist(), "ending": refinement.ending.name}
        self._ended[question] = json.dumps(values | {"simulated": simulated}).encode()
        content = b"".join(_record(key, _REFINEMENT, answer) for key, answer in self._ended.items())
        self.close()
        write_atomic(self._path, content)
        self._rows, self._end, self._full = {}, len(content), False

    def close(self) -> None:
        """Close the file; the next record opens it again."""
        if self._file is not None:
            self._file.close()
        self._file = None

    def _recall(self, question: bytes) -> Array | None:
        if question not in self._rows:
            return None
        offset, length = self._rows[question]
        try:
            file = self._open()
            file.seek(offset)
            content = file.read(length)
        except OSError:
            return None
        return np.frombuffer(content).copy() if len(content) == length else None

    def _append(self, question: bytes, rows: Array) -> None:
        record = _record(question, _ROWS, np.ascontiguousarray(rows).tobytes())
        if self._full:
            return
        try:
            if self._end + len(record) > LARGEST:
                raise OSError(0, f"{LARGEST >> 20} MiB are enough")
            file = self._open()
            file.seek(self._end)  # over what an interrupt has left of a record
            if file.write(record) < len(record):
                raise OSError(0, "the disk is full")
        except OSError as error:
            self._full = True
            _log.warning(
                "%s: no more is kept of this refinement (%s); if stopped, it repeats the rest",
                self._path,
                error.strerror,
            )
            return
        self._rows[question] = (self._end + _RECORD.size, rows.nbytes)
        self._end += len(record)

    def _open(self) -> IO[bytes]:
        if self._file is None:
            self._path.touch()
            self._file = self._path.open("r+b", buffering=0)
            self._file.truncate(self._end)
        return self._file

    def _read(self) -> None:
        """Take in the records up to the first that is damaged."""
        with self._path.open("rb") as file:
            while len(head := file.read(_RECORD.size)) == _RECORD.size:
                checksum, question, kind, length = _RECORD.unpack(head)
                content = file.read(length) if length <= LARGEST else b""
                if len(content) < length or checksum != _hash(head[16:], content):
                    break
                if kind == _REFINEMENT:
                    self._ended[question] = content
                else:
                    self._rows[question] = (self._end + _RECORD.size, length)
                self._end = file.tell()
            lost = file.seek(0, 2) - self._end
        if lost:
            _log.info("%s: the last %d bytes are no whole records and are left out", self._path, lost)


def question_of(problem: Problem, theta: Array, settings: RefinementSettings) -> bytes:
    """What tells one refinement of a run from another: the data, what is free, where it starts, when it ends."""
    how = settings.model_dump_json().encode()
    return _hash(problem.measured.tobytes(), problem.parameters.free.tobytes(), theta.tobytes(), how)


def _record(question: bytes, kind: bytes, answer: bytes) -> bytes:
    after = question + kind + struct.pack("<Q", len(answer))
    return _hash(after, answer) + after + answer


def _hash(*parts: bytes) -> bytes:
    digest = hashlib.blake2b(digest_size=16)
    for part in parts:
        digest.update(part)
    return digest.digest()
