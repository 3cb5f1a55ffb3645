"""Spread the simulation of candidates over Dask workers;
no bit of a result depends on their number."""

import logging
import pickle
import threading
from collections.abc import Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from functools import lru_cache
from importlib.metadata import version
from itertools import pairwise
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from hydroid.arrays import Array
from hydroid.errors import RunError

VERSIONS = {name: version(name) for name in ("hydroid", "mujoco", "numpy", "numba")}
"""packages whose versions decide the bits of a result"""

_log = logging.getLogger(__name__)
_lock = threading.Lock()


class DaskWorkers:
    """The workers of a scheduler, to which a client is connected, for a problem's
    candidates."""

    def __init__(self, client: Any) -> None:
        self.client = client
        self._sent: WeakKeyDictionary[object, Any] = WeakKeyDictionary()

    @property
    def count(self) -> int:
        """Workers connected now; 1 where there is none."""
        return max(1, len(self.client.nthreads()))

    def __call__(
        self, target: object, method: str, theta: Array, columns: int
    ) -> Array:
        """Apply `target.method`, which maps rows (m, P) to (m, columns), to theta, (n,
        P), on the workers.

        Each worker gets one chunk of the rows. When a worker dies, another one takes
        its chunk. The target can be pickled, and is sent once. The result, (n,
        columns), is in theta's order; NaN in the row of a candidate that kills its
        workers.

        Raises RunError: the scheduler is gone.
        """
        result = np.full((len(theta), columns), np.nan)
        try:
            # a task and no data: what a dead worker held is computed again;
            # once for all chunks, since a problem with its logs is large
            if target not in self._sent:
                self._sent[target] = self.client.submit(
                    bytes, pickle.dumps(target), pure=False
                )
            parts = self._parts(len(theta))
            chunks = self._map(target, method, [theta[part] for part in parts])
            for part, rows in zip(parts, chunks, strict=True):
                if rows is None:
                    self._one_by_one(target, method, theta, part, result)
                else:
                    result[part] = rows
        except Exception as error:  # many errors follow the loss of a scheduler
            is_loss = isinstance(error, OSError | CancelledError)
            if not is_loss and self.client.status == "running":
                raise
            words = " ".join(str(error).split()) or type(error).__name__
            hint = "start it again, and continue with --resume"
            raise RunError(f"the Dask scheduler is gone ({words})", hint=hint) from None
        return result

    def _parts(self, rows: int) -> list[slice]:
        """Return as many parts of rows as there are workers, all of like length."""
        edges = np.linspace(0, rows, min(self.count, rows) + 1).astype(int).tolist()
        return [slice(begin, end) for begin, end in pairwise(edges)]

    def _one_by_one(
        self, target: object, method: str, theta: Array, part: slice, result: Array
    ) -> None:
        """Try each candidate of a chunk alone that Dask has given up.

        It also gives up chunks that waited behind a killer.
        """
        for i in range(part.start, part.stop):
            (row,) = self._map(target, method, [theta[i : i + 1]])
            if row is None:
                words = "a candidate has killed worker after worker and counts as infeasible"
                _log.warning(words)
            else:
                result[i] = row[0]

    def _map(
        self, target: object, method: str, chunks: Sequence[Array]
    ) -> list[Array | None]:
        """Return results in the chunks' order; None for a chunk that Dask has given
        up."""
        from distributed.scheduler import KilledWorker

        where: Any = list(self.client.nthreads()) or None
        futures = [
            self.client.submit(
                _apply,
                self._sent[target],
                VERSIONS,
                method,
                chunk,
                pure=False,
                # one each; left to Dask, one may get two short ones
                workers=where and where[i % len(where)],
                allow_other_workers=where is not None,
            )
            for i, chunk in enumerate(chunks)
        ]
        try:
            self._wait(futures)
            if all(future.status == "finished" for future in futures):
                return self.client.gather(futures)
            results = list[Array | None]()
            for future in futures:
                is_killer = isinstance(future.exception(), KilledWorker)
                results.append(None if is_killer else future.result())
            return results
        finally:
            with suppress(Exception):  # the scheduler may be gone
                self.client.cancel(futures)

    def _wait(self, futures: Sequence[Any]) -> None:
        """Wait for tasks, and look from time to time whether there is anybody to do
        them."""
        import distributed

        while True:
            with suppress(TimeoutError):
                distributed.wait(futures, timeout=10.0)  # pyright: ignore[reportUnknownMemberType]
                return
            if self.client.status in ("closing", "closed"):
                raise ConnectionError("no answer")
            if not self.client.nthreads():
                _log.warning("the Dask scheduler has no workers; waiting for some")


def _apply(
    pickled: bytes, versions: dict[str, str], method: str, theta: Array
) -> Array:
    """Compute a chunk in a worker, one at a time however many threads it has."""
    for name, ours in versions.items():
        if VERSIONS[name] != ours:
            words = f"a Dask worker has {name} {VERSIONS[name]}, here is {ours}"
            raise RunError(
                words, hint="install the same everywhere: others may compute other bits"
            )
    with _lock:
        return getattr(_loaded(pickled), method)(theta)


@lru_cache(maxsize=8)
def _loaded(pickled: bytes) -> Any:
    return pickle.loads(pickled)
