"""The prior of open start angles, and fits of logs whose start is wrong."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import step_log

from hydroid import load_settings
from hydroid.log import Log
from hydroid.posterior.jacobian import jacobian
from hydroid.posterior.open_start import sensor_noise, start_deviations, with_open_start
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem

NOISE = np.radians(0.1)


def noisy_log(level: float = NOISE) -> Log:
    settings = load_settings("article-mech")
    values = settings.parameter_set().mapping(settings.parameter_set().start)
    log = simulate_log(settings, step_log(settings.arm.pose("study"), [60.0, -40.0, 80.0]), values, "start")
    return replace(log, angle=log.angle + np.random.default_rng(2).normal(0, level, log.angle.shape))


def test_a_reading_has_the_noise_of_the_residual_but_not_the_error_of_the_model():
    log = noisy_log()
    assert sensor_noise(log, 2, NOISE) == NOISE
    assert np.degrees(sensor_noise(log, 2, 0.1)) == pytest.approx(0.2)
    loud = noisy_log(np.radians(0.5))
    assert np.degrees(sensor_noise(loud, 2, 0.1)) == pytest.approx(0.5, rel=0.1)
    assert np.degrees(sensor_noise(replace(log, angle=log.angle[:2]), 2, 0.1)) == pytest.approx(0.2)


def test_every_joint_that_is_simulated_has_the_noise_of_its_own_sensor():
    log = noisy_log()
    deviations = start_deviations(log, (1, 2, 3), {2: NOISE})
    assert deviations[1] == NOISE
    assert np.all((deviations > 0.5 * NOISE) & (deviations <= NOISE))
    still = log.start + np.random.default_rng(5).normal(0, NOISE, log.angle.shape)
    rest = replace(log, angle=still, command=np.where(log.time[:, None] < 1.0, 0.0, log.command))
    assert start_deviations(rest, (2,), {2: NOISE})[0] < 0.2 * NOISE


def test_a_wrong_start_leaves_little_error_where_it_is_open():
    log, wrong = noisy_log(), np.random.default_rng(3).normal(0, 2 * NOISE, 7)
    angle = log.angle.copy()
    angle[0] += wrong
    held, opened = (
        Problem(load_settings("article-mech", {"free_start": free}), [replace(log, angle=angle)])
        for free in (False, True)
    )
    theta = held.parameters.start
    assert with_open_start(held, theta) is held
    squares = [np.sum(with_open_start(p, theta).residuals(theta[None])[0][1:] ** 2) for p in (held, opened)]
    more = np.array(squares) - len(log.time) * NOISE**2
    # each start angle leaves what its prior scores, in units of the noise
    assert more[1] < np.sum(wrong**2)
    assert more[0] > 5 * more[1]


def test_the_uncertainty_of_the_start_is_no_information_about_parameters():
    log = noisy_log()
    held, opened = (
        jacobian(Problem(load_settings("article-mech", {"free_start": free}), [log]), theta)
        for free in (False, True)
        for theta in [load_settings("article-mech").parameter_set().start]
    )
    lengths = [np.linalg.norm(at.slopes[:3], axis=1) for at in (held, opened)]
    assert np.all(lengths[1] < lengths[0])
