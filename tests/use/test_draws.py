"""Draws have the posterior's mean and covariance, keep within bounds, and are as likely
as they should be."""

import numpy as np
import pytest
from made_logs import TRUTH
from small_fits import study

from hydroid.errors import RunError, SettingsError
from hydroid.identified_model import IdentifiedModel, start_values
from hydroid.posterior.posterior import NORMAL, Posterior
from hydroid.posterior.uncertainty import uncertainty
from hydroid.search.axes import Box
from hydroid.use.draws import DriftingAngles, draw, on_their_level, within


def posterior(room: float, p: int = 4, quantile: float = NORMAL) -> Posterior:
    """With correlated parameters whose bounds are `room` relative changes away, to both
    sides."""
    covariance = (
        0.01
        * (0.7 + 0.3 * np.eye(p))
        * np.outer(np.arange(1, p + 1), np.arange(1, p + 1))
    )
    root = np.linalg.cholesky(np.linalg.inv(covariance)).T
    at = np.full(p, 2.0)
    box = Box(
        at, at - 2.0 * room, at + 2.0 * room, np.full(p, 2.0), np.ones(p, dtype=bool)
    )
    return Posterior(box, root, quantile)


def test_without_bounds_draws_have_the_mean_and_the_covariance():
    known = posterior(room=1e3)
    drawn = within(known, 4000, np.random.default_rng(0))
    sd = known.deviations
    np.testing.assert_allclose(drawn.mean(axis=0) / sd, 0.0, atol=5 / np.sqrt(4000))
    scaled = np.cov(drawn.T) / np.outer(sd, sd)
    np.testing.assert_allclose(scaled, known.covariance / np.outer(sd, sd), atol=0.08)
    wider = within(
        posterior(room=1e3, quantile=2 * NORMAL), 4000, np.random.default_rng(0)
    )
    np.testing.assert_allclose(wider, 2.0 * drawn)  # as the intervals are


def test_with_bounds_draws_are_those_of_the_gaussian_that_lie_inside():
    known = posterior(room=0.1)
    drawn = within(known, 4000, np.random.default_rng(0))
    assert np.abs(drawn).max() <= 0.1 + 1e-9
    rng = np.random.default_rng(1)
    many = rng.multivariate_normal(np.zeros(4), known.covariance, 200_000)
    inside = many[(np.abs(many) <= 0.1).all(axis=1)]
    np.testing.assert_allclose(drawn.std(axis=0), inside.std(axis=0), rtol=0.06)
    np.testing.assert_allclose(np.corrcoef(drawn.T), np.corrcoef(inside.T), atol=0.08)


def test_a_draw_is_no_less_likely_than_the_gaussian_has_it():
    problem = study()
    theta = problem.parameters.vector(TRUTH, "test")
    known = uncertainty(problem, theta)
    one = known.posterior
    changes = within(one, 30, np.random.default_rng(0))
    moved = on_their_level(one, changes, problem)
    likelihood = known.likelihood
    wide = one.quantile / NORMAL
    cost = 0.5 * np.sum(likelihood.rows(one.box.points(moved)) ** 2, axis=1)
    least = 0.5 * np.sum(likelihood.rows(one.box.at[None]) ** 2)
    level = 0.5 * np.sum((changes @ one.root.T) ** 2, axis=1)
    assert np.all(cost - least <= level * (1.0 + 1e-6) + 1e-6 * wide)
    assert np.all(np.abs(moved) <= np.abs(changes).max() + 1e-12)


def test_what_is_no_fit_has_no_draws():
    model = start_values(study().settings)
    assert isinstance(model, IdentifiedModel)
    with pytest.raises(RunError, match="no covariance"):
        draw(model, 3)


def test_angles_drift_as_the_error_model_says():
    """Variance: growth with time and with the way, and that of the lasting error once
    it is there."""
    numbers = np.array([[1e-6, 2e-6, 3e-5, 4e-6, 0.1], [0.0, 0.0, 0.0, 0.0, 0.0]])
    drifting, rng = DriftingAngles(numbers, 20_000, 0.1), np.random.default_rng(0)
    way = np.tile([0.02, 0.02], (20_000, 1))
    error = np.zeros((20_000, 2))
    for _ in range(50):
        error = drifting.step(-way, rng)
    expected = 2e-6 * 5.0 + 3e-5 * 50 * 0.02 + 4e-6
    assert error[:, 0].var() == pytest.approx(expected, rel=0.05)
    assert not error[:, 1].any()
    assert drifting.noise(rng)[:, 0].std() == pytest.approx(1e-3, rel=0.05)
    drifting.reset(np.arange(10_000))
    after = drifting.step(0.0 * way, rng)
    assert after[:10_000, 0].var() < 0.2 * after[10_000:, 0].var()


def test_fewer_than_one_is_refused():
    with pytest.raises((SettingsError, RunError)):
        draw(start_values(study().settings), 0)
