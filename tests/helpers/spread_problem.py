"""A small problem to spread over workers, and a candidate of it that kills whoever simulates it."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from conftest import step_log
from execution_work import die

from hydroid.execution import Executor, Work
from hydroid.jobs import load_settings
from hydroid.problem.problem import Problem

POISON = 1e-3
"""of the first parameter"""


def arguments(**changes: object) -> tuple[Any, ...]:
    """Arm, settings and logs of a problem with two outputs and two logs."""
    settings = load_settings(
        "article-mech",
        {"outputs": [2, 3], "simulation.other_joints": "passive", "objective.segments": {"equal": 3}}
        | changes,
    )
    pose = settings.arm.pose("study")
    return settings.arm, settings, [step_log(pose, [60.0, -80.0]), step_log(pose, [30.0], joint=3)]


def some_sets(problem: Problem, n: int) -> np.ndarray:
    """Random sets; the last one diverges where joints are passive."""
    rng = np.random.default_rng(1)
    theta = problem.parameters.from_unit(rng.random((n, int(problem.parameters.free.sum()))))
    if n > 1:
        theta[-1, problem.parameters.names.index("D")] = 0.0
        theta[-1, problem.parameters.names.index("S")] = 1e9
    return theta


def assert_same(spread: Problem, plain: Problem, theta: np.ndarray) -> None:
    """Every bit of objectives and residuals."""
    ours, theirs = spread.evaluate(theta), plain.evaluate(theta)
    np.testing.assert_array_equal(ours.segments, theirs.segments)
    np.testing.assert_array_equal(ours.overall, theirs.overall)
    np.testing.assert_array_equal(spread.residuals(theta), plain.residuals(theta))


class Poisoned:
    """An executor whose workers die of a certain candidate."""

    def __init__(self, executor: Executor) -> None:
        self.executor = executor

    @property
    def workers(self) -> int:
        return self.executor.workers

    def map(self, work: Work[Any, Any], chunks: Sequence[Any]) -> list[Any]:
        return self.executor.map(Work(Deadly(work.pickled)), chunks)


class Deadly:
    """Work that kills its worker where a chunk holds the candidate."""

    def __init__(self, pickled: bytes) -> None:
        self.pickled = pickled
        self.function: Callable[[Any], Any] | None = None

    def __call__(self, chunk: Any) -> Any:
        import pickle

        if np.any(chunk.theta[:, 0] == POISON):
            die()
        self.function = self.function or pickle.loads(self.pickled)
        return self.function(chunk)
