"""Uncertainty by laws: closed forms of linear problems, known noise, how often intervals cover the truth."""

from dataclasses import replace

import numpy as np
import pytest
from linear_problem import AR1, DEG, THETA, Linear, ar1, least_squares, slow
from scipy.linalg import toeplitz

from hydroid.posterior.identifiability import THRESHOLD, profile
from hydroid.posterior.linear import linearised
from hydroid.posterior.noise import MIN_LEVEL, Noise, channel_noise, fit_noise
from hydroid.posterior.uncertainty import Flag, uncertainty, uncertainty_from


def flags(found):
    return [status.flag for status in found.status]


def white_problem(**how):
    columns, rng = slow(3), np.random.default_rng(1)
    measured = THETA @ columns + rng.normal(0, 0.1 * DEG, columns.shape[1])
    return Linear(columns, measured, THETA, **how), least_squares(columns, measured)


def test_a_given_white_noise_gives_the_textbook_covariance():
    problem, theta = white_problem(noise_deg=0.2)
    found = uncertainty(problem, theta)
    expected = (0.2 * DEG) ** 2 * np.linalg.inv(problem.columns @ problem.columns.T)
    np.testing.assert_allclose(found.standard_deviation, np.sqrt(np.diag(expected)), rtol=1e-7)
    outer = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    sign = np.sign(np.outer(theta, theta))  # relative changes of a negative parameter count the other way
    relative = found.posterior.covariance / np.outer(found.relative, found.relative)
    np.testing.assert_allclose(relative * np.abs(sign), expected / outer, atol=1e-6)
    assert problem.simulated == 1 + 3 + 2 * 3  # by each parameter, and one round along the axes


def test_the_sandwich_is_right_where_weights_and_noise_do_not_match():
    weights, levels = (1.0, 5.0), np.array([0.1, 0.4]) * DEG
    columns, rng = slow(3), np.random.default_rng(2)
    scatter = np.repeat(levels, 500)
    problem = Linear(columns, THETA @ columns + rng.normal(0, scatter), THETA, weights=weights)
    weight = problem.weight
    bread = np.linalg.inv(columns * weight**2 @ columns.T)
    expected = bread @ (columns * weight**4 * scatter**2 @ columns.T) @ bread
    at = linearised(problem, THETA)
    noise = tuple(Noise(500, w * s, np.empty(0), given=True) for w, s in zip(weights, levels, strict=True))
    found = uncertainty_from(problem, at, noise)
    np.testing.assert_allclose(found.standard_deviation, np.sqrt(np.diag(expected)), rtol=1e-6)


def test_an_exact_null_direction_has_no_interval_and_leaves_the_others_theirs():
    columns = slow(4)
    columns[1], columns[2] = 2 * columns[0], 0.0  # a and b trade, c does nothing
    theta = np.array([1.0, 2.0, 3.0, 4.0])
    rng = np.random.default_rng(3)
    problem = Linear(columns, theta @ columns + rng.normal(0, 0.1 * DEG, 1000), theta, noise_deg=0.1)
    found = uncertainty(problem, theta)
    assert flags(found) == [Flag.UNIDENTIFIABLE, Flag.UNIDENTIFIABLE, Flag.NO_EFFECT, Flag.IDENTIFIABLE]
    assert np.isinf(found.interval[:3]).all()
    assert profile(problem, found, "a").interval == (-np.inf, np.inf)
    pair = columns[[0, 3]]
    expected = 0.1 * DEG * np.sqrt(np.linalg.inv(pair @ pair.T)[1, 1])
    assert found.standard_deviation[3] == pytest.approx(expected, rel=1e-6)
    fixed = Linear(columns, problem.measured, theta, fixed="b", noise_deg=0.1)
    expected = [Flag.IDENTIFIABLE, Flag.FIXED, Flag.NO_EFFECT, Flag.IDENTIFIABLE]
    assert flags(uncertainty(fixed, theta)) == expected


def test_a_prior_is_one_more_measurement():
    columns = slow(3)
    columns[1] = columns[0]
    theta, rng = np.array([1.0, 2.0, 4.0]), np.random.default_rng(4)
    measured = theta @ columns + rng.normal(0, 0.1 * DEG, 1000)
    known = {"sum": {"of": ["a", "c"], "value": 5.0, "sd": 0.05}}
    problem = Linear(columns, measured, theta, known=known, noise_deg=0.1)
    found = uncertainty(problem, theta)
    prior = np.array([[1.0, 0.0, 1.0]]) / 0.05
    information = columns @ columns.T / (0.1 * DEG) ** 2 + prior.T @ prior
    # the residual's level, which weighs the prior, is the noise to about 2 %
    expected = np.sqrt(np.diag(np.linalg.inv(information)))
    np.testing.assert_allclose(found.standard_deviation, expected, rtol=1e-3)
    assert flags(found) == [Flag.IDENTIFIABLE] * 3
    assert flags(uncertainty(Linear(columns, measured, theta), theta))[0] is Flag.UNIDENTIFIABLE


def test_a_bound_takes_the_interval():
    problem, theta = white_problem(noise_deg=0.1)
    at = theta.copy()
    at[2] = problem.parameters.upper[2]
    found = uncertainty(problem, at)
    status = found.status[2]
    assert (status.flag, status.at_bound) == (Flag.IDENTIFIABLE, "upper")
    held = uncertainty(Linear(problem.columns, problem.measured, THETA, fixed="c", noise_deg=0.1), at)
    np.testing.assert_allclose(found.relative[:2], held.relative[:2], rtol=1e-6)  # it is held there
    assert np.isnan(found.interval[2]).all()
    assert np.isfinite(found.interval[:2]).all()
    # a tenth of a standard deviation off, it is free
    at[2] -= 0.11 * held.standard_deviation.min() + 0.11 * uncertainty(problem, theta).standard_deviation[2]
    assert uncertainty(problem, at).status[2].at_bound is None


def test_parameters_that_trade_have_their_interval_though_the_response_is_rough():
    """Two nearly equal effects, and a response in steps of 1e-5 rad, as where oil cavitates."""
    columns, rng = slow(3), np.random.default_rng(4)
    columns[1] = columns[0] + 1e-2 * slow(1, seed=9)[0]
    measured = THETA @ columns + rng.normal(0, 0.05 * DEG, columns.shape[1])
    problem, theta = Linear(columns, measured, THETA), least_squares(columns, measured)
    expected = uncertainty(problem, theta).standard_deviation
    smooth = problem.residuals
    problem.residuals = lambda t: np.round(smooth(t) / 1e-5) * 1e-5
    np.testing.assert_allclose(uncertainty(problem, theta).standard_deviation, expected, rtol=0.05)


@pytest.mark.parametrize("reflection", [[], [-AR1], [0.5, -0.3, 0.8]])
def test_the_covariance_of_rows_is_that_of_the_whole_matrix(reflection):
    noise = Noise(61, 2.0, np.array(reflection))
    covariance, rows = toeplitz(noise.autocovariance), slow(3, 61)
    np.testing.assert_allclose(noise.covariance_of(rows), rows @ covariance @ rows.T, rtol=1e-9)


def test_a_first_order_process_has_the_textbook_autocovariance():
    noise = Noise(200, 3.0, np.array([-AR1]))
    np.testing.assert_allclose(noise.autocovariance, 9 * AR1 ** np.arange(200), rtol=1e-9)
    assert noise.correlation_time == pytest.approx(15, abs=1)
    # the variance of the mean of 200 such samples, directly
    variance = toeplitz(noise.autocovariance).mean()
    assert noise.effective_sample_size == pytest.approx(9 / variance)
    assert Noise(200, 3.0, np.empty(0)).effective_sample_size == 200


def test_a_known_process_is_found():
    rng = np.random.default_rng(5)
    series = ar1(rng, 20_000, AR1, 0.1 * DEG)
    noise = fit_noise(series)
    assert 1 <= len(noise.reflection) <= 8
    assert -noise.reflection[0] == pytest.approx(AR1, abs=0.005)
    assert noise.level == pytest.approx(0.1 * DEG, rel=0.05)
    assert len(fit_noise(rng.normal(size=20_000)).reflection) <= 8


def test_noise_is_taken_from_settings_residual_or_floor():
    problem, _ = white_problem()
    (channel,) = problem.channels
    how, rng = problem.settings.objective, np.random.default_rng(6)
    residual = rng.normal(0, 0.3 * DEG, 1000)
    quiet = channel_noise(channel, 1e-6 * residual, how)
    assert quiet.level == pytest.approx(MIN_LEVEL["angle"])
    assert quiet.correlation_time == 0
    # a slow residual just below the smallest level stays slow
    slow_residual = ar1(rng, 1000, AR1, 0.04 * DEG)
    assert channel_noise(channel, slow_residual, how).correlation_time > 5
    given = channel_noise(channel, residual, how.model_copy(update={"noise_deg": {2: 0.7}}))
    assert (given.given, given.level) == (True, pytest.approx(0.7 * DEG))
    stated = how.model_copy(update={"noise_deg": 0.7})
    weighted = channel_noise(replace(channel, weight=3.0), residual, stated)
    assert weighted.level == pytest.approx(2.1 * DEG)


@pytest.mark.slow
@pytest.mark.parametrize("phi", [0.0, AR1, float(np.exp(-0.01 / 4.0))])
def test_intervals_cover_the_truth_as_often_as_they_say(phi):
    """400 linear fits, noise estimated from the residual each time; a binomial 95 % is 0.93 to 0.97."""
    samples = 1500 if phi <= AR1 else 7500  # nineteen correlation times of the slowest noise
    columns, hits, rng = slow(3, samples, seed=7), [], np.random.default_rng(8)
    deviations, estimates = [], []
    for _ in range(400):
        measured = THETA @ columns + ar1(rng, samples, phi, 0.1 * DEG)
        theta = least_squares(columns, measured)
        found = uncertainty(Linear(columns, measured, THETA), theta)
        hits.append((found.interval[:, 0] <= THETA) & (found.interval[:, 1] >= THETA))
        deviations.append(found.standard_deviation)
        estimates.append(theta)
    cover = np.mean(hits, axis=0)
    assert (cover > 0.92).all(), cover
    assert (cover < 0.985).all(), cover
    np.testing.assert_allclose(np.mean(deviations, axis=0), np.std(estimates, axis=0), rtol=0.1)


def test_the_profile_of_a_linear_problem_is_its_interval_and_one_from_no_optimum_says_so():
    problem, theta = white_problem(noise_deg=0.1)
    found = uncertainty(problem, theta)
    one, deviation = profile(problem, found, "b"), found.standard_deviation[1]
    assert not one.better_optimum
    half = np.sqrt(THRESHOLD) * deviation
    np.testing.assert_allclose(one.interval, [theta[1] - half, theta[1] + half], rtol=1e-4)
    off = profile(problem, uncertainty(problem, theta + np.array([0.0, 2 * deviation, 0.0])), "b")
    # two standard deviations of the parameter by itself, or a little less of it with the others
    assert off.better_optimum
    assert off.lowest < -3.0
