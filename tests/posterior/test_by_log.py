"""Covariance by log against statsmodels, and of noise that is not white, on linear
problems."""

import numpy as np
import pytest
import statsmodels.api as sm
from linear_problem import AR1, DEG, THETA, Linear, ar1, least_squares, slow, white
from scipy.signal import fftconvolve
from scipy.stats import t as student

from hydroid.posterior.by_log import by_log
from hydroid.posterior.uncertainty import uncertainty

LEVEL = 0.5 * DEG


def several(logs, rng, *, alike=False, spread=0.0, samples=400):
    """Logs of slow signals, and a truth that differs from log to log by a part
    `spread`."""
    seeds = (
        [rng.integers(1 << 30)] * logs if alike else rng.integers(1 << 30, size=logs)
    )
    factors = np.ones(logs) if alike else rng.uniform(0.5, 2.0, logs)
    columns = np.hstack(
        [f * slow(3, samples, seed=s) for f, s in zip(factors, seeds, strict=True)]
    )
    truth = THETA[:, None] * (1 + spread * rng.normal(size=(3, logs)))
    measured = np.sum(np.repeat(truth, samples, axis=1) * columns, axis=0)
    measured += rng.normal(0, LEVEL, measured.size)
    problem = Linear(columns, measured, THETA, logs=logs)
    return (
        problem,
        least_squares(columns, measured),
        np.repeat(np.arange(logs), samples),
    )


def test_logs_that_excite_alike_give_the_cluster_sandwich_of_statsmodels():
    problem, theta, groups = several(
        5, np.random.default_rng(1), alike=True, spread=0.02
    )
    found = by_log(problem, uncertainty(problem, theta, numbers=white(0.5)))
    fit = sm.OLS(problem.measured, problem.columns.T).fit(
        cov_type="cluster", cov_kwds={"groups": groups}
    )
    count = len(groups)
    # its correction for the parameters is of samples
    expected = fit.bse * np.sqrt((count - 3) / (count - 1))
    np.testing.assert_allclose(found.relative * np.abs(theta), expected, rtol=1e-6)
    # the weak prior has a part in it
    np.testing.assert_allclose(found.freedom, 4, rtol=1e-7)
    half = student.ppf(0.975, 4) * expected
    np.testing.assert_allclose(
        found.interval, np.stack([theta - half, theta + half], axis=1), rtol=1e-6
    )


def test_one_log_has_no_spread_and_a_log_alone_leaves_a_parameter_unknown():
    rng = np.random.default_rng(4)
    problem, theta, groups = several(3, rng)
    problem.columns[2, groups > 0] = 0.0  # only the first log shows c
    found = by_log(problem, uncertainty(problem, theta, numbers=white(0.5)))
    assert np.isinf(found.relative[2])
    assert np.isfinite(found.relative[:2]).all()
    alone, theta, _ = several(1, rng)
    assert np.isnan(
        by_log(alone, uncertainty(alone, theta, numbers=white(0.5))).relative
    ).all()


@pytest.mark.parametrize("logs", [3, 8])
def test_intervals_by_log_hold_where_the_logs_differ_and_the_pooled_ones_do_not(logs):
    rng, hits, pooled, named = np.random.default_rng(5), [], [], []
    for _ in range(150):
        problem, theta, _ = several(logs, rng, spread=0.05)
        known = uncertainty(problem, theta, numbers=white(0.5))
        found = by_log(problem, known)
        for each, ends in ((hits, found.interval), (pooled, known.interval)):
            each.append((ends[:, 0] <= THETA) & (ends[:, 1] >= THETA))
        named.append(bool(found.differing))
    assert np.mean(hits) > 0.93
    assert np.mean(pooled) < 0.5
    assert np.mean(named) > 0.9


def test_few_right_models_are_said_to_differ():
    rng, named = np.random.default_rng(6), 0
    for _ in range(200):
        problem, theta, _ = several(4, rng)
        found = by_log(problem, uncertainty(problem, theta, numbers=white(0.5)))
        named += bool(found.differing)
    assert named <= 18  # 5 % and three standard deviations


def test_the_sandwich_of_slow_noise_is_that_of_its_covariance():
    columns, rng = slow(3, 20_000, seed=7), np.random.default_rng(11)
    measured = THETA @ columns + ar1(rng, 20_000, AR1, 0.1 * DEG)
    found = uncertainty(
        Linear(columns, measured, THETA, stage="mech"), least_squares(columns, measured)
    )
    autocovariance = (0.1 * DEG) ** 2 * AR1 ** np.abs(np.arange(-1000, 1001))
    noise = np.array([fftconvolve(row, autocovariance, mode="same") for row in columns])
    bread = np.linalg.inv(columns @ columns.T)
    expected = np.sqrt(np.diag(bread @ columns @ noise.T @ bread))
    np.testing.assert_allclose(found.standard_deviation, expected, rtol=0.15)
    # and not that of white noise, which is a fifth of it
    white_noise = found.linear.white.deviations * np.abs(found.theta)
    assert (white_noise < 0.3 * expected).all()


@pytest.mark.parametrize("spread", [0.0, 0.05])
def test_the_error_on_a_log_left_out_is_that_of_a_fit_without_it(spread):
    problem, theta, groups = several(4, np.random.default_rng(7), spread=spread)
    found, errors = by_log(problem, uncertainty(problem, theta, numbers=white(0.5))), []
    for log in range(4):
        own = groups == log
        theta = least_squares(problem.columns[:, ~own], problem.measured[~own])
        errors.append(
            np.sqrt(np.mean((problem.measured - theta @ problem.columns)[own] ** 2))
        )
    np.testing.assert_allclose(np.radians(found.left_out["q2"]), errors, rtol=1e-4)
