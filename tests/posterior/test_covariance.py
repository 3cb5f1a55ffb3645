"""Uncertainty by laws: closed forms of linear problems, and how often intervals cover
the truth."""

import numpy as np
import pytest
from linear_problem import (
    AR1,
    DEG,
    THETA,
    Linear,
    ar1,
    dense_covariance,
    least_squares,
    most_likely,
    slow,
    white,
)
from scipy.stats import t as student

from hydroid.posterior.identifiability import THRESHOLD, profile
from hydroid.posterior.uncertainty import Flag, uncertainty


def flags(found):
    return [status.flag for status in found.status]


def white_problem(**how):
    columns, rng = slow(3), np.random.default_rng(1)
    measured = THETA @ columns + rng.normal(0, 0.1 * DEG, columns.shape[1])
    return Linear(columns, measured, THETA, **how), least_squares(columns, measured)


def test_a_given_white_noise_gives_the_textbook_covariance():
    problem, theta = white_problem()
    found = uncertainty(problem, theta, numbers=white(0.2))
    expected = (0.2 * DEG) ** 2 * np.linalg.inv(problem.columns @ problem.columns.T)
    np.testing.assert_allclose(
        found.standard_deviation, np.sqrt(np.diag(expected)), rtol=1e-7
    )
    outer = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    # relative changes of a negative parameter count the other way
    sign = np.sign(np.outer(theta, theta))
    relative = found.posterior.covariance / np.outer(found.relative, found.relative)
    np.testing.assert_allclose(relative * np.abs(sign), expected / outer, atol=1e-6)
    # by each parameter, and one round along the axes
    assert problem.simulated == 1 + 3 + 2 * 3


@pytest.mark.parametrize("stage", ["mech", "hyd"])
def test_the_covariance_is_that_of_least_squares_so_weighed_by_the_errors_as_they_are(
    stage,
):
    """The sandwich (H. White, 1980), by matrices; stage 1 weighs errors as white
    noise."""
    columns, rng = slow(3, 400), np.random.default_rng(2)
    drift = np.cumsum(rng.normal(0, 0.02 * DEG, 400))
    measured = THETA @ columns + drift + ar1(rng, 400, AR1, 0.1 * DEG)
    problem = Linear(columns, measured, THETA, logs=2, stage=stage)
    found = uncertainty(problem, least_squares(columns, measured))
    errors = dense_covariance(problem, found.errors.numbers[0])
    weights = np.eye(400)
    if stage == "hyd":
        filtered = found.likelihood.errors.innovations(np.eye(400))
        weights = filtered @ filtered.T
    bread = np.linalg.inv(columns @ weights @ columns.T)
    expected = bread @ columns @ weights @ errors @ weights @ columns.T @ bread
    np.testing.assert_allclose(
        found.standard_deviation, np.sqrt(np.diag(expected)), rtol=1e-5
    )


def test_white_noise_has_as_many_degrees_of_freedom_as_samples():
    """Its variance is known to 2 / T of its square (Satterthwaite), and what lasts
    counts less often."""
    columns, rng = slow(3), np.random.default_rng(12)
    quantiles = []
    for phi in (0.0, AR1):
        measured = THETA @ columns + ar1(rng, 1000, phi, 0.1 * DEG)
        problem = Linear(columns, measured, THETA)
        theta = least_squares(columns, measured)
        numbers = white(0.1) if phi == 0.0 else None
        found = uncertainty(problem, theta, numbers=numbers)
        quantiles.append(found.posterior.quantile)
    assert quantiles[0] == pytest.approx(student.ppf(0.975, 1000), rel=1e-3)
    # what the errors of 0.15 s leave of 10 s is some tens of independent samples
    assert student.ppf(0.975, 100) < quantiles[1] < student.ppf(0.975, 5)


def test_an_exact_null_direction_has_no_interval_and_leaves_the_others_theirs():
    columns = slow(4)
    columns[1], columns[2] = 2 * columns[0], 0.0  # a and b trade, c does nothing
    theta = np.array([1.0, 2.0, 3.0, 4.0])
    rng = np.random.default_rng(3)
    problem = Linear(columns, theta @ columns + rng.normal(0, 0.1 * DEG, 1000), theta)
    found = uncertainty(problem, theta, numbers=white(0.1))
    assert flags(found) == [
        Flag.UNIDENTIFIABLE,
        Flag.UNIDENTIFIABLE,
        Flag.NO_EFFECT,
        Flag.IDENTIFIABLE,
    ]
    assert np.isinf(found.interval[:3]).all()
    assert profile(problem, found, "a").interval == (-np.inf, np.inf)
    pair = columns[[0, 3]]
    expected = 0.1 * DEG * np.sqrt(np.linalg.inv(pair @ pair.T)[1, 1])
    assert found.standard_deviation[3] == pytest.approx(expected, rel=1e-6)
    fixed = Linear(columns, problem.measured, theta, fixed="b")
    expected = [Flag.IDENTIFIABLE, Flag.FIXED, Flag.NO_EFFECT, Flag.IDENTIFIABLE]
    assert flags(uncertainty(fixed, theta, numbers=white(0.1))) == expected


def test_a_prior_is_one_more_measurement():
    columns = slow(3)
    columns[1] = columns[0]
    theta, rng = np.array([1.0, 2.0, 4.0]), np.random.default_rng(4)
    measured = theta @ columns + rng.normal(0, 0.1 * DEG, 1000)
    known = {"sum": {"of": ["a", "c"], "value": 5.0, "sd": 0.05}}
    problem = Linear(columns, measured, theta, known=known)
    found = uncertainty(problem, theta, numbers=white(0.1))
    prior = np.array([[1.0, 0.0, 1.0]]) / 0.05
    information = columns @ columns.T / (0.1 * DEG) ** 2 + prior.T @ prior
    expected = np.sqrt(np.diag(np.linalg.inv(information)))
    # and a weak one
    np.testing.assert_allclose(found.standard_deviation, expected, rtol=1e-4)
    assert flags(found) == [Flag.IDENTIFIABLE] * 3
    assert (
        flags(uncertainty(Linear(columns, measured, theta), theta, numbers=white(0.1)))[
            0
        ]
        is Flag.UNIDENTIFIABLE
    )


def test_a_bound_takes_the_interval():
    problem, theta = white_problem()
    at = theta.copy()
    at[2] = problem.parameters.upper[2]
    found = uncertainty(problem, at, numbers=white(0.1))
    status = found.status[2]
    assert (status.flag, status.at_bound) == (Flag.IDENTIFIABLE, "upper")
    held = uncertainty(
        Linear(problem.columns, problem.measured, THETA, fixed="c"),
        at,
        numbers=white(0.1),
    )
    # it is held there
    np.testing.assert_allclose(found.relative[:2], held.relative[:2], rtol=1e-6)
    assert np.isnan(found.interval[2]).all()
    assert np.isfinite(found.interval[:2]).all()
    # a tenth of a standard deviation off, it is free
    at[2] -= (
        0.11 * held.standard_deviation.min()
        + 0.11 * uncertainty(problem, theta, numbers=white(0.1)).standard_deviation[2]
    )
    assert uncertainty(problem, at, numbers=white(0.1)).status[2].at_bound is None


def test_parameters_that_trade_have_their_interval_though_the_response_is_rough():
    """Two nearly equal effects, and a response in steps of 1e-5 rad, as where oil
    cavitates."""
    columns, rng = slow(3), np.random.default_rng(4)
    columns[1] = columns[0] + 1e-2 * slow(1, seed=9)[0]
    measured = THETA @ columns + rng.normal(0, 0.05 * DEG, columns.shape[1])
    problem, theta = Linear(columns, measured, THETA), least_squares(columns, measured)
    expected = uncertainty(problem, theta, numbers=white(0.1)).standard_deviation
    smooth = problem.output_errors
    problem.output_errors = lambda t: np.round(smooth(t) / 1e-5) * 1e-5
    np.testing.assert_allclose(
        uncertainty(problem, theta, numbers=white(0.1)).standard_deviation,
        expected,
        rtol=0.05,
    )


TOO_WIDE = pytest.mark.xfail(
    strict=True,
    reason="in 20 s an error that lasts for 1 s passes for a drift now and then: intervals hold the truth as "
    "often as they say, but a few are so wide that their mean is not the scatter of the estimates",
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stage", "phi"),
    [
        ("hyd", 0.0),
        ("hyd", AR1),
        pytest.param("hyd", float(np.exp(-0.01 / 1.0)), marks=TOO_WIDE),
        ("mech", AR1),
    ],
    ids=["white", "0.15 s", "1 s", "stage 1"],
)
def test_intervals_cover_the_truth_as_often_as_they_say(stage, phi):
    """400 linear fits, errors estimated from the residual each time; a binomial 95 % is
    0.93 to 0.97."""
    samples = 800 if phi <= AR1 else 2000
    columns, hits, rng = slow(3, samples, seed=7), [], np.random.default_rng(8)
    deviations, estimates = [], []
    for _ in range(400):
        measured = THETA @ columns + ar1(rng, samples, phi, 0.1 * DEG)
        problem = Linear(columns, measured, THETA, stage=stage)
        theta, numbers = most_likely(problem, rounds=1 if stage == "mech" else 3)
        found = uncertainty(problem, theta, numbers=numbers)
        hits.append((found.interval[:, 0] <= THETA) & (found.interval[:, 1] >= THETA))
        deviations.append(found.standard_deviation)
        estimates.append(theta)
    cover = np.mean(hits, axis=0)
    assert (cover > 0.92).all(), cover
    assert (cover < 0.985).all(), cover
    np.testing.assert_allclose(
        np.mean(deviations, axis=0), np.std(estimates, axis=0), rtol=0.1
    )


def test_the_profile_of_a_linear_problem_is_its_interval_and_one_from_no_optimum_says_so():
    problem, theta = white_problem()
    found = uncertainty(problem, theta, numbers=white(0.1))
    one, deviation = profile(problem, found, "b"), found.standard_deviation[1]
    assert not one.better_optimum
    half = np.sqrt(THRESHOLD) * deviation
    np.testing.assert_allclose(
        one.interval, [theta[1] - half, theta[1] + half], rtol=1e-4
    )
    off = profile(
        problem,
        uncertainty(
            problem, theta + np.array([0.0, 2 * deviation, 0.0]), numbers=white(0.1)
        ),
        "b",
    )
    # two standard deviations of the parameter by itself, or a little less of it with
    # the others
    assert off.better_optimum
    assert off.lowest < -3.0
