"""The score test: exact on linear problems, at its nominal rate where nothing is
missing."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hydroid.advice.growth import Explained, holm

SAMPLES = 1000


def fitted(noise: np.ndarray, slopes: np.ndarray) -> Explained:
    """What a linear least-squares fit of `slopes`, (p, R), leaves of innovations."""
    effects = np.linalg.qr(slopes.T)[0].T
    left = noise - effects.T @ (effects @ noise)
    return Explained(effects, left, variance=lambda row: float(row @ row))


def test_the_statistic_of_a_linear_problem_is_that_of_regression():
    rng = np.random.default_rng(1)
    slopes, change, noise = (
        rng.normal(size=(4, SAMPLES)),
        rng.normal(size=SAMPLES),
        rng.normal(size=SAMPLES),
    )
    score = fitted(noise, slopes).score(change)
    # regression with the change as one more column: its coefficient over its standard
    # deviation
    design = np.vstack([slopes, change]).T
    coefficient = np.linalg.lstsq(design, -noise)[0][-1]
    deviation = np.sqrt(np.linalg.inv(design.T @ design)[-1, -1])
    assert_allclose(score.amount, coefficient, rtol=1e-9)
    assert_allclose(score.statistic, coefficient / deviation, rtol=1e-9)
    assert_allclose(score.strength, 1 / deviation, rtol=1e-9)
    # what the column saves of half the sum of squares
    left = [-noise - m @ np.linalg.lstsq(m, -noise)[0] for m in (slopes.T, design)]
    assert_allclose(
        score.gain, 0.5 * (left[0] @ left[0] - left[1] @ left[1]), rtol=1e-9
    )


@pytest.mark.parametrize("period", [5, 100])
def test_the_rate_is_nominal_where_nothing_is_missing(period: int):
    """At 5 % of each of 1,000 records: within four standard errors."""
    rng = np.random.default_rng(5)
    change = np.sign(
        np.sin(2 * np.pi * np.cumsum(rng.uniform(0.5, 1.5, SAMPLES)) / period)
    )
    slopes = np.vstack(
        [np.ones(SAMPLES), np.cos(np.arange(SAMPLES) / 30), rng.normal(size=SAMPLES)]
    )
    named = [
        fitted(rng.normal(size=SAMPLES), slopes).score(change).chance(one_sided=False)
        < 0.05
        for _ in range(1000)
    ]
    assert np.mean(named) == pytest.approx(0.05, abs=0.028)


def test_holm_keeps_what_bonferroni_keeps_and_stops_at_the_first_that_fails():
    assert holm([0.001, 0.2, 0.02, 0.026], 0.05).tolist() == [True, False, False, False]
    assert holm([0.001, 0.2, 0.016, 0.024], 0.05).tolist() == [True, False, True, True]
    assert holm([], 0.05).tolist() == []
