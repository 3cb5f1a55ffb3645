"""Sensitivities held to laws, the prior of open start angles, and residuals of logs whose start is wrong."""

from dataclasses import replace

import numpy as np
import pytest
from made_logs import TRUTH, noisy, simulate_log, stepped

from hydroid import load_settings
from hydroid.log import Log
from hydroid.posterior.linear import Linear, linearised, sensor_noise, start_deviations, with_open_start
from hydroid.problem.free_start import StartSlopes
from hydroid.problem.problem import Problem

THETA, NOISE = np.array(list(TRUTH.values())), np.radians(0.1)


@pytest.fixture(scope="module")
def problem(study_log: Log) -> Problem:
    settings = load_settings("article-mech", {"simulation.other_joints": "locked"})
    return Problem(settings, [simulate_log(settings, study_log, TRUTH)])


@pytest.fixture(scope="module")
def effects(problem: Problem) -> Linear:
    return linearised(problem, THETA)


def test_a_slope_is_what_simulate_shows_for_one_percent(problem: Problem, effects: Linear, study_log: Log):
    for name in ("K", "M3"):
        up, down = (
            simulate_log(problem.settings, study_log, TRUTH | {name: f * TRUTH[name]}).angle[:, 1]
            for f in (1.005, 0.995)
        )
        slope = -0.01 * effects.slopes[list(TRUTH).index(name)]
        assert slope == pytest.approx(up - down, abs=1e-3 * np.abs(slope).max())


def noisy_log(level_deg: float = 0.1) -> Log:
    settings = load_settings("article-mech")
    values = settings.parameter_set().mapping(settings.parameter_set().start)
    return noisy(stepped(settings, values, [60.0, -40.0, 80.0]), level_deg, 2, exact_start=False)


def test_a_reading_has_the_noise_of_the_residual_but_not_the_error_of_the_model():
    log = noisy_log()
    assert sensor_noise(log, 2, NOISE) == NOISE
    assert np.degrees(sensor_noise(log, 2, 0.1)) == pytest.approx(0.2)
    loud = noisy_log(0.5)
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
