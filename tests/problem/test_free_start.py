"""Open start angles: what a wrong start does to a response is taken out of the residuals."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import step_log

from hydroid import load_settings
from hydroid.log import Log
from hydroid.prediction import simulate_log
from hydroid.problem.free_start import open_joints
from hydroid.problem.problem import Problem
from hydroid.uncertainty.jacobian import jacobian

LEVELS = [60.0, -40.0, 80.0, -70.0]
WRONG = np.radians(0.2)


def clean_log(config: str) -> Log:
    settings = load_settings(config)
    values = settings.parameter_set().mapping(settings.parameter_set().start)
    return simulate_log(settings, step_log(settings.arm.pose("study"), LEVELS), values, "start")


def with_wrong_start(log: Log) -> Log:
    angle = log.angle.copy()
    angle[0, 1] += WRONG
    return replace(log, angle=angle)


@pytest.mark.parametrize("config", ["article-mech", "fit-hyd"])
def test_a_wrong_start_leaves_no_error_where_it_is_open(config):
    log = clean_log(config)
    settings = load_settings(config, {"free_start": "auto"})
    problem = Problem(settings, [with_wrong_start(log)])
    theta = problem.parameters.start
    wrong = problem.output_errors(theta[None])[0]  # of the log without the error there is none
    opened = problem.with_open_start(theta)
    (start,) = opened.open_starts
    assert start.angles(wrong) == pytest.approx(-WRONG, rel=0.05)
    left = opened.residuals(theta[None])[0]
    assert np.linalg.norm(left[1:]) < 0.1 * np.linalg.norm(wrong[1:])


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


def test_a_fit_without_open_starts_is_the_same_problem():
    settings = load_settings("article-mech")
    problem = Problem(settings, [clean_log("article-mech")])
    assert problem.with_open_start(problem.parameters.start) is problem
    opened = Problem(load_settings("article-mech", {"free_start": True}), problem.logs)
    theta = problem.parameters.start
    # what a start angle can do, no parameter does
    (start,) = opened.with_open_start(theta).open_starts
    slopes = jacobian(opened, theta).slopes[opened.parameters.free]
    assert np.abs(slopes @ start.basis.T).max() < 1e-6 * np.linalg.norm(slopes)
