"""Open start angles: what a wrong start does to a response is taken out of the residuals."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import step_log

from hydroid import load_settings
from hydroid.log import Log
from hydroid.prediction import simulate_log
from hydroid.problem.free_start import StartSlopes, open_joints
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
    StartSlopes(0, slice(5, 35), (2, 3), slopes).opened(weights).close(closed)
    values, axes = np.linalg.eigh(np.eye(40) + effect.T @ effect)
    np.testing.assert_allclose(closed, rows @ (axes / np.sqrt(values)) @ axes.T, atol=1e-12)


@pytest.mark.parametrize("config", ["article-mech", "fit-hyd"])
def test_the_slopes_are_what_a_wrong_start_does(config: str):
    log, wrong = clean_log(config), np.radians(0.2)
    problem = Problem(load_settings(config, {"free_start": "auto"}), [log])
    theta = problem.parameters.start
    (slopes,) = problem.start_slopes(theta)
    angle = log.angle.copy()
    angle[0, 1] += wrong
    off = Problem(problem.settings, [replace(log, angle=angle)]).residuals(theta[None])[0]
    right = problem.residuals(theta[None])[0]
    effect = wrong * slopes.slopes[slopes.joints.index(2)]
    assert np.linalg.norm((off - right - effect)[1:]) < 0.1 * np.linalg.norm(effect)


def test_a_start_that_the_log_shows_is_not_open():
    rng = np.random.default_rng(1)
    log = step_log(load_settings("article-mech").arm.pose("study"), [0.0, 0.0, 0.0, 50.0])
    rest = int(np.argmax(log.command.any(axis=1)))
    assert rest > 100
    assert open_joints(log, [2], "auto") == []
    noisy = replace(log, angle=log.angle + rng.normal(0, 1e-3, log.angle.shape))
    assert open_joints(noisy, [2], "auto") == []
    drifting = replace(log, angle=log.angle + 1e-3 * log.time[:, None])
    assert open_joints(drifting, [2], "auto") == [2]
    assert open_joints(log, [2], True) == [2]
    moving = replace(log, command=np.roll(log.command, -rest, axis=0))
    assert open_joints(moving, [2], "auto") == [2]
    assert open_joints(moving, [2], False) == []


def test_joints_that_follow_the_log_have_no_start_of_their_own():
    settings = load_settings("article-mech", {"free_start": True, "simulation.other_joints": "measured"})
    problem = Problem(settings, [clean_log("article-mech")])
    (slopes,) = problem.start_slopes(problem.parameters.start)
    assert slopes.joints == (2,)


def test_only_logs_that_do_not_show_their_start_are_differentiated_by_it():
    settings = load_settings("article-mech", {"free_start": "auto"})
    log, rest = clean_log("article-mech"), np.zeros((100, 7))
    shown = replace(
        log,
        time=0.01 * np.arange(len(log.time) + 100),
        command=np.vstack([rest, log.command]),
        angle=np.vstack([rest + log.angle[0], log.angle]),
    )
    problem = Problem(settings, [shown, log])
    assert [slopes.log for slopes in problem.start_slopes(problem.parameters.start)] == [1]
