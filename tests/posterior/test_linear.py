"""Sensitivities held to laws, and innovations of logs whose start is wrong."""

from dataclasses import replace

import numpy as np
import pytest
from made_logs import HYDRAULIC, TRUTH, noisy, simulate_log, stepped

from hydroid import load_settings
from hydroid.log import Log
from hydroid.posterior.error_model import likelihood_at
from hydroid.posterior.linear import Linear, linearised
from hydroid.problem.problem import Problem

THETA, NOISE = np.array(list(TRUTH.values())), np.radians(0.1)
WHITE = np.array([[NOISE**2, 0.0, 0.0, 0.0, 0.05]])  # numbers of an error model


@pytest.fixture(scope="module")
def problem(study_log: Log) -> Problem:
    settings = load_settings("article-mech", {"simulation.other_joints": "locked"})
    return Problem(settings, [simulate_log(settings, study_log, TRUTH)])


@pytest.fixture(scope="module")
def effects(problem: Problem) -> Linear:
    return linearised(likelihood_at(problem, THETA, WHITE), THETA)


def test_a_slope_is_what_simulate_shows_for_one_percent(
    problem: Problem, effects: Linear, study_log: Log
):
    for name in ("K", "M3"):
        up, down = (
            simulate_log(
                problem.settings, study_log, TRUTH | {name: f * TRUTH[name]}
            ).angle[:, 1]
            for f in (1.005, 0.995)
        )
        slope = -0.01 * NOISE * effects.slopes[list(TRUTH).index(name)]
        assert slope == pytest.approx(up - down, abs=1e-3 * np.abs(slope).max())


def test_a_wrong_start_counts_for_little_where_it_is_open():
    """An error of the start by twenty standard deviations of a reading."""
    settings = load_settings("article-hyd")
    truth = {name: HYDRAULIC[name] for name in settings.parameters if name in HYDRAULIC}
    log = noisy(
        stepped(settings, truth, [60.0, -40.0, 80.0]), 0.1, 2, exact_start=False
    )
    angle = log.angle.copy()
    angle[0, 1] += 2 * NOISE
    squares = []
    for free in (False, True):
        problem = Problem(
            settings.changed({"free_start": free}), [replace(log, angle=angle)]
        )
        theta = problem.parameters.vector(truth, "truth")
        innovations = likelihood_at(problem, theta, WHITE).innovations(theta[None])[0]
        squares.append(np.sum(innovations**2) - len(innovations))
    # the reading is off by two standard deviations: that is what it counts for
    assert squares[1] < 4.0 + 4 * np.sqrt(2 * len(log.time))
    assert squares[0] > 5 * max(squares[1], 1.0)
