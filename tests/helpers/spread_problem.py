"""A small problem to spread over workers, compared bit for bit with the same one in
this process."""

from typing import Any

import numpy as np
from made_logs import step_log

from hydroid import load_settings
from hydroid.log import Log
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings

PASSIVE = {
    "outputs": [2, 3],
    "simulation.other_joints": "passive",
    "objective.segments": 3,
}


def arguments(
    config: str = "article-mech", **changes: Any
) -> tuple[FitSettings, list[Log]]:
    settings = load_settings(
        config, (PASSIVE if config == "article-mech" else {}) | changes
    )
    pose = settings.arm.pose("study")
    return settings, [step_log(pose, [60.0, -80.0]), step_log(pose, {3: [30.0]})]


def random_candidates(problem: Problem, n: int) -> np.ndarray:
    """Random candidates; where joints are passive the last one diverges."""
    rng = np.random.default_rng(1)
    theta = problem.parameters.from_unit(
        rng.random((n, int(problem.parameters.free.sum())))
    )
    if problem.settings.stage == "mech":
        theta[-1, problem.parameters.names.index("D")] = 0.0
        theta[-1, problem.parameters.names.index("S")] = 1e9
    return theta


def assert_same(spread: Problem, plain: Problem, theta: np.ndarray) -> None:
    np.testing.assert_array_equal(spread.evaluate(theta), plain.evaluate(theta))
    np.testing.assert_array_equal(
        spread.output_errors(theta), plain.output_errors(theta)
    )
