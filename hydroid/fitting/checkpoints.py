"""Checkpoints of a fit: arrays by the name of what is under way, stored every few
seconds.

A run folder keeps them in a file (`run.archive`); elsewhere a plain dict will do. Of a
search they are the objectives of all candidates simulated so far: none is simulated
twice, also not by a resumed run.
"""

import time
from collections.abc import Callable, Generator, MutableMapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydroid.arrays import Array
from hydroid.errors import RunError
from hydroid.problem.problem import Problem

SAVE_EVERY = 5.0
"""seconds between checkpoints: a lost one costs no more"""
SHARE = 0.05
"""of the time that writing them takes at most: the Jacobians of a large fit are
hundreds of MB"""

Arrays = dict[str, NDArray[Any]]
Checkpoints = MutableMapping[str, Arrays]


@contextmanager
def saving(
    checkpoints: Checkpoints, name: str
) -> Generator[Callable[[Callable[[], Arrays]], None]]:
    """Yield a function that takes how the newest state is stored.

    A state is stored every SAVE_EVERY seconds, or more seldom where that takes long,
    and the last one where the block ends, also by an interrupt.
    """
    pending = None
    saved = time.monotonic()
    wait = SAVE_EVERY

    def keep(state: Callable[[], Arrays]) -> None:
        nonlocal saved, pending, wait
        pending = state
        begun = time.monotonic()
        if begun - saved > wait:
            checkpoints[name] = state()
            pending = None
            saved = time.monotonic()
            wait = max(SAVE_EVERY, (saved - begun) / SHARE)

    try:
        yield keep
    finally:
        # by an interrupt, too: a resumed run goes on from there
        if pending is not None:
            checkpoints[name] = pending()


class Memo:
    """Evaluates each candidate once: identical chromosomes are not simulated again.

    A search is deterministic. So its memo is all that a checkpoint needs: a resumed
    search begins anew, and gets what is stored until it asks for the first candidate
    that is not.

    Attributes:
        infeasible: candidates whose simulation diverged.
        elsewhere: candidates that a local method simulated on its way to those
            evaluated here.
        stored: objectives of the resumed run's candidates that have not been asked for
            yet.
    """

    def __init__(self, problem: Problem, stored: Arrays | None = None) -> None:
        self.problem = problem
        self.infeasible = 0
        self.elsewhere = 0
        self._values: dict[bytes, Array] = {}
        """objectives of each candidate, overall last, shape (S + 1,)"""
        self.stored: dict[bytes, Array] = {}
        if stored:
            for theta, values in zip(stored["theta"], stored["values"], strict=True):
                self.stored[theta.tobytes()] = values.copy()

    @property
    def simulated(self) -> int:
        """Candidates simulated so far, those of a run that this one resumes
        included."""
        return len(self._values) + self.elsewhere

    @property
    def best(self) -> Array:
        """The candidate with the lowest overall objective, shape (P,)."""
        best = min(self._values, key=lambda key: self._values[key][-1])
        # its key is the candidate, byte by byte
        return np.frombuffer(best)

    def evaluate(self, theta: Array) -> Array:
        """Evaluate theta as `Problem.evaluate` does, simulating what is new in it.
        Raises RunError: a resumed search does not repeat itself.
        """
        new = dict[bytes, Array]()
        for row in theta:
            key = row.tobytes()
            if key not in self._values:
                new[key] = row
        values = {key: self.stored.pop(key) for key in new if key in self.stored}
        unknown = [row for key, row in new.items() if key not in values]
        if unknown:
            values |= self._simulated(unknown)
        for key in new:
            # the order in which they were asked for is that of the checkpoint
            self._values[key] = values[key]
            if not np.isfinite(values[key][-1]):
                self.infeasible += 1
        return np.array([self._values[row.tobytes()] for row in theta])

    def _simulated(self, unknown: Sequence[Array]) -> dict[bytes, Array]:
        """Return the objectives of candidates that are not stored, by their bytes."""
        if self.stored:
            what = "the search cannot be continued: its library does not repeat what it did before"
            hint = (
                "use the versions that the run began with, or begin another with --out"
            )
            raise RunError(what, hint=hint)
        rows = self.problem.evaluate(np.array(unknown))
        # a candidate with one infinite objective is infeasible: none of its objectives
        # may win
        rows[~np.isfinite(rows).all(axis=1)] = np.inf
        return {one.tobytes(): row for one, row in zip(unknown, rows, strict=True)}

    def arrays(self) -> Arrays:
        """Return all candidates and their objectives, overall last: shapes (m, P) and
        (m, S + 1)."""
        return {
            "theta": np.array([np.frombuffer(key) for key in self._values]),
            "values": np.array(list(self._values.values())),
        }
