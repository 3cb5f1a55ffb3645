"""The score test: exact on linear problems, at its nominal rate where nothing is missing."""

import numpy as np
import pytest
from hydroid.posterior.noise import Noise, fit_noise
from linear_problem import ar1
from numpy.testing import assert_allclose

from hydroid.advice.growth import Explained, holm

SAMPLES = 1000


def fitted(rng, noise: np.ndarray, slopes: np.ndarray, known: float | None = None) -> Explained:
    """What a linear least-squares fit of `slopes`, (p, R), leaves of a row; of known or estimated noise."""
    effects = np.linalg.qr(slopes.T)[0].T
    residual = noise - effects.T @ (effects @ noise)

    def noise_of(row: np.ndarray) -> list[Noise]:
        white = Noise(len(row), known or 0.0, np.empty(0), given=True)
        return [white if known else fit_noise(row)]

    return Explained(effects, residual, noise_of, [slice(0, len(noise))], 1.0)


def test_the_statistic_of_a_linear_problem_is_that_of_regression():
    rng = np.random.default_rng(1)
    slopes, change, noise = rng.normal(size=(4, SAMPLES)), rng.normal(size=SAMPLES), rng.normal(size=SAMPLES)
    score = fitted(rng, noise, slopes, known=1.0).score(change)
    # regression with the change as one more column: its coefficient over its standard deviation
    design = np.vstack([slopes, change]).T
    coefficient = np.linalg.lstsq(design, -noise)[0][-1]
    deviation = np.sqrt(np.linalg.inv(design.T @ design)[-1, -1])
    assert_allclose(score.amount, coefficient, rtol=1e-9)
    assert_allclose(score.statistic, coefficient / deviation, rtol=1e-9)
    assert_allclose(score.strength, 1 / deviation, rtol=1e-9)


def test_correlated_noise_widens_the_statistic_as_its_covariance_says():
    rng = np.random.default_rng(2)
    process = Noise(SAMPLES, 1.0, np.array([-0.9]), given=True)
    slopes, noise = np.ones((1, SAMPLES)), ar1(rng, SAMPLES, 0.9, 1.0)
    change = np.sin(np.arange(SAMPLES) / 50)
    explained = fitted(rng, noise, slopes)
    explained = Explained(explained.effects, explained.residual, lambda row: [process], explained.rows, 1.0)
    row = change - change.mean()
    variance = process.covariance_of(row[None])[0, 0]
    assert_allclose(explained.score(change).statistic, -row @ noise / np.sqrt(variance), rtol=1e-6)


@pytest.mark.parametrize("phi", [0.0, 0.9, 0.98])
@pytest.mark.parametrize("period", [5, 100])
def test_the_rate_is_nominal_where_nothing_is_missing(phi: float, period: int):
    """At 5 % of each of 400 records; slow noise may make it rarer, never more than twice as frequent."""
    rng = np.random.default_rng(5)
    change = np.sign(np.sin(2 * np.pi * np.cumsum(rng.uniform(0.5, 1.5, SAMPLES)) / period))
    slopes = np.vstack([np.ones(SAMPLES), np.cos(np.arange(SAMPLES) / 30), rng.normal(size=SAMPLES)])
    named = [
        fitted(rng, noise, slopes).score(change).chance(one_sided=False) < 0.05
        for noise in (ar1(rng, SAMPLES, phi, 1.0) for _ in range(400))
    ]
    assert 0.005 <= np.mean(named) <= 0.10


def test_holm_keeps_what_bonferroni_keeps_and_stops_at_the_first_that_fails():
    assert holm([0.001, 0.2, 0.02, 0.026], 0.05).tolist() == [True, False, False, False]
    assert holm([0.001, 0.2, 0.016, 0.024], 0.05).tolist() == [True, False, True, True]
    assert holm([], 0.05).tolist() == []
