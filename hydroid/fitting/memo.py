"""Objectives of all candidates simulated so far, so that none is simulated twice."""

import numpy as np

from hydroid.parameters import Array
from hydroid.problem.problem import Evaluation, Problem


class Memo:
    """Evaluates each candidate once: identical chromosomes are not simulated again."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self._values: dict[bytes, Array] = {}
        """objectives of each candidate, overall last, shape (S + 1,)"""
        self.infeasible = 0
        """candidates whose simulation diverged"""

    @property
    def simulated(self) -> int:
        """Candidates simulated so far."""
        return len(self._values)

    @property
    def best(self) -> Array:
        """The candidate with the lowest overall objective, shape (P,)."""
        return np.frombuffer(min(self._values, key=lambda key: float(self._values[key][-1])))

    def evaluate(self, theta: Array) -> Evaluation:
        """Evaluate theta, shape (n, P), simulating what is new in it."""
        new = {row.tobytes(): row for row in theta if row.tobytes() not in self._values}
        if new:
            result = self.problem.evaluate(np.array(list(new.values())))
            values = np.column_stack([result.segments, result.overall])
            # a candidate with one infinite objective is infeasible: none of its objectives may win
            failed = ~np.isfinite(values).all(axis=1)
            values[failed] = np.inf
            self.infeasible += int(failed.sum())
            self._values.update(zip(new, values, strict=True))
        values = np.array([self._values[row.tobytes()] for row in theta])
        return Evaluation(values[:, :-1].copy(), values[:, -1].copy())

    def arrays(self) -> tuple[Array, Array]:
        """Return all candidates and their objectives, overall last: shapes (m, P) and (m, S + 1)."""
        return np.array([np.frombuffer(key) for key in self._values]), np.array(list(self._values.values()))

    def restore(self, theta: Array, values: Array) -> None:
        """Restore what `arrays` returned."""
        self._values = {row.tobytes(): v.copy() for row, v in zip(theta, values, strict=True)}
        self.infeasible = int(np.sum(~np.isfinite(values[:, -1])))
