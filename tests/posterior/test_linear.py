"""Sensitivities, held to laws."""

import numpy as np
import pytest
from conftest import TRUTH

from hydroid import load_settings
from hydroid.log import Log
from hydroid.posterior.linear import Linear, linearised
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem

THETA = np.array(list(TRUTH.values()))


def make_problem(log: Log, **changes: object) -> Problem:
    """Noise-free data at the truth."""
    settings = load_settings("article-mech", {"simulation.other_joints": "locked"} | changes)
    return Problem(settings, [simulate_log(settings, log, TRUTH, "truth")])


@pytest.fixture(scope="module")
def problem(study_log: Log) -> Problem:
    return make_problem(study_log)


@pytest.fixture(scope="module")
def effects(problem: Problem) -> Linear:
    return linearised(problem, THETA)


def test_a_slope_is_what_simulate_shows_for_one_percent(problem: Problem, effects: Linear, study_log: Log):
    for name in ("K", "M3"):
        up, down = (
            simulate_log(problem.settings, study_log, TRUTH | {name: f * TRUTH[name]}, "t").angle[:, 1]
            for f in (1.005, 0.995)
        )
        slope = -0.01 * effects.slopes[list(TRUTH).index(name)]
        assert slope == pytest.approx(up - down, abs=1e-3 * np.abs(slope).max())


def test_a_parameter_without_effect_has_a_slope_of_zero(effects: Linear):
    assert effects.slopes.any(axis=1).tolist() == [name != "M1" for name in TRUTH]
