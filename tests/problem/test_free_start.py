"""Open start angles: what a wrong start does to a response is taken out of the residuals."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import step_log

from hydroid import load_settings
from hydroid.log import Log
from hydroid.prediction import simulate_log
from hydroid.problem.free_start import StartSlopes, start_slopes
from hydroid.problem.problem import Problem

LEVELS = [60.0, -40.0, 80.0, -70.0]


def clean_log(config: str) -> Log:
    settings = load_settings(config)
    values = settings.parameter_set().mapping(settings.parameter_set().start)
    return simulate_log(settings, step_log(settings.arm.pose("study"), LEVELS), values, "start")


def test_an_open_start_whitens_the_residuals_for_a_random_start():
    """By T = (1 + B' B)^-1/2, rows B being what one standard deviation of each start angle does."""
    rng = np.random.default_rng(1)
    slopes, weights, rows = rng.normal(size=(2, 30)), np.array([0.5, 2.0]), rng.normal(size=(3, 40))
    effect = np.zeros((2, 40))
    effect[:, 5:35] = weights[:, None] * slopes
    closed = rows.copy()
    StartSlopes(0, slice(5, 35), (2, 3), slopes).opened(weights)(closed)
    values, axes = np.linalg.eigh(np.eye(40) + effect.T @ effect)
    np.testing.assert_allclose(closed, rows @ (axes / np.sqrt(values)) @ axes.T, atol=1e-12)


@pytest.mark.parametrize("config", ["article-mech", "fit-hyd"])
def test_the_slopes_are_what_a_wrong_start_does(config: str):
    log, wrong = clean_log(config), np.radians(0.2)
    problem = Problem(load_settings(config, {"free_start": True}), [log])
    theta = problem.parameters.start
    (slopes,) = start_slopes(problem, theta)
    angle = log.angle.copy()
    angle[0, 1] += wrong
    off = Problem(problem.settings, [replace(log, angle=angle)]).residuals(theta[None])[0]
    right = problem.residuals(theta[None])[0]
    effect = wrong * slopes.slopes[slopes.joints.index(2)]
    assert np.linalg.norm((off - right - effect)[1:]) < 0.1 * np.linalg.norm(effect)


def test_joints_that_follow_the_log_have_no_start_of_their_own():
    settings = load_settings("article-mech", {"free_start": True, "simulation.other_joints": "measured"})
    problem = Problem(settings, [clean_log("article-mech")])
    (slopes,) = start_slopes(problem, problem.parameters.start)
    assert slopes.joints == (2,)
