"""An estimation problem whose sets are simulated by workers; no bit of a result depends on their number."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from hydroid.execution import Executor, Work
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.problem.problem import Evaluation, Problem
from hydroid.settings.fit import FitSettings


@dataclass(frozen=True)
class Chunk:
    """What one worker is given: some of the parameter sets, shape (m, P), and what of them is wanted."""

    wanted: Literal["evaluate", "residuals"]
    theta: Array


class SpreadProblem(Problem):
    """A problem like any other whose `evaluate` and `residuals` run on workers.

    The sets are cut into as many chunks as there are workers: each chunk costs a start of its own, and every
    set takes the same number of steps, so that finer ones would gain nothing (docs/scaling.md). A set that
    kills its workers is infeasible, as one that diverges is; the others of its chunk are not.

    Args:
        settings: the fit's settings; a worker has `simulation.threads` threads, one where that is 0.
        logs: one or more records.
        executor: the workers. They get the compiled problem, and need no file of it.
    """

    def __init__(self, settings: FitSettings, logs: Sequence[Log], executor: Executor) -> None:
        super().__init__(settings, logs)
        threads = settings.simulation.threads or 1
        simulation = settings.simulation.model_copy(update={"threads": threads})
        theirs = Problem(settings.model_copy(update={"simulation": simulation}), logs)
        self._executor, self._work = executor, Work(partial(_compute, theirs))

    def freed(self) -> "SpreadProblem":
        """Return the same problem, on the same workers, with every parameter free that has bounds."""
        return SpreadProblem(super().freed().settings, self.logs, self._executor)

    def evaluate(self, theta: Array) -> Evaluation:
        """Simulate theta, shape (n, P), on the workers and measure it."""
        segments = np.full((len(theta), len(self.bounds)), np.inf)
        overall = np.full(len(theta), np.inf)
        for rows, part in self._spread("evaluate", theta):
            segments[rows], overall[rows] = part.segments, part.overall
        return Evaluation(segments, overall)

    def residuals(self, theta: Array) -> Array:
        """Weighted output errors of (17) [rad], shape (n, R), from the workers; NaN where diverged."""
        errors = np.full((len(theta), len(self.measured)), np.nan)
        for rows, part in self._spread("residuals", theta):
            errors[rows] = part
        return errors

    def _spread(self, wanted: Literal["evaluate", "residuals"], theta: Array) -> Iterator[tuple[slice, Any]]:
        """What became of the sets, some rows at a time; rows that cannot be computed never come."""
        edges = np.linspace(0, len(theta), min(self._executor.workers, len(theta)) + 1).astype(int).tolist()
        waiting = [slice(*edge) for edge in pairwise(edges)]
        while waiting:
            parts = self._executor.map(self._work, [Chunk(wanted, theta[rows]) for rows in waiting])
            failed = [rows for rows, part in zip(waiting, parts, strict=True) if part is None]
            yield from ((rows, part) for rows, part in zip(waiting, parts, strict=True) if part is not None)
            # one set of these killed the workers: each alone tells which
            crowds = [range(rows.start, rows.stop) for rows in failed if rows.stop > rows.start + 1]
            waiting = [slice(i, i + 1) for crowd in crowds for i in crowd]


def _compute(problem: Problem, chunk: Chunk) -> Evaluation | Array:
    """Compute a chunk in a worker."""
    return problem.evaluate(chunk.theta) if chunk.wanted == "evaluate" else problem.residuals(chunk.theta)
