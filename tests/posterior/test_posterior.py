"""The posterior against closed forms: linear quantities, ratios, directions that
nothing measures."""

import numpy as np
import pytest
from scipy.stats import norm

from hydroid.posterior.posterior import WEAK_PRIOR, Posterior, regular
from hydroid.posterior.uncertainty import Flag, ParameterStatus, Source, flag_of
from hydroid.search.axes import Box

THETA = np.array([2.0, 5.0, 0.1])
# of relative changes
COVARIANCE = np.array([[0.04, 0.03, 0.0], [0.03, 0.09, -0.01], [0.0, -0.01, 0.01]])
Z = float(norm.ppf(0.975))


def posterior(rows: np.ndarray, fixed: int = 0, lower=0.01, upper=100.0) -> Posterior:
    varied = np.arange(3) >= fixed
    box = Box(THETA, lower * THETA, upper * THETA, np.abs(THETA), varied)
    return Posterior(box, regular(np.vstack([rows, np.eye(3 - fixed) / WEAK_PRIOR])))


def known(covariance: np.ndarray = COVARIANCE, **how) -> Posterior:
    return posterior(np.linalg.cholesky(np.linalg.inv(covariance)).T, **how)


def test_the_interval_of_a_linear_quantity_is_the_textbooks():
    weights = np.array([[3.0, -1.0, 10.0], [0.0, 2.0, 0.0]]).T
    found = known().propagate(lambda theta: theta @ weights, positive=False)
    slopes = weights * THETA[:, None]
    sd = np.sqrt(np.diag(slopes.T @ COVARIANCE @ slopes))
    np.testing.assert_allclose(found.sd, sd, rtol=1e-3)
    ends = np.stack([found.value - Z * found.sd, found.value + Z * found.sd], 1)
    np.testing.assert_allclose(found.interval, ends)


def test_a_ratio_has_a_multiplicative_interval_that_its_inverse_shares():
    def ratios(theta: np.ndarray) -> np.ndarray:
        return np.stack([theta[:, 0] / theta[:, 1], theta[:, 1] / theta[:, 0]], axis=1)

    found = known().propagate(ratios, positive=True)
    sd = np.sqrt(COVARIANCE[0, 0] + COVARIANCE[1, 1] - 2 * COVARIANCE[0, 1])
    np.testing.assert_allclose(
        found.interval[0], 0.4 * np.exp([-Z * sd, Z * sd]), rtol=1e-3
    )
    np.testing.assert_allclose(
        found.interval[0], 1 / found.interval[1, ::-1], rtol=1e-3
    )


def test_only_the_direction_that_nothing_measures_makes_a_quantity_unknown():
    # a and b may grow together
    root = np.array([[20.0, -20.0, 0.0], [0.0, 0.0, 10.0], [0.0, 0.0, 0.0]])

    def quantities(theta: np.ndarray) -> np.ndarray:
        a, b, c = theta.T
        return np.stack([a / b, a, b, c, a * c / b, a * b], axis=1)

    found = posterior(root).propagate(quantities, positive=True)
    assert np.isfinite(found.sd).tolist() == [True, False, False, True, True, False]
    np.testing.assert_allclose(found.sd[0], found.value[0] / 20, rtol=1e-5)
    assert found.interval[1].tolist() == [0.0, np.inf]
    signed = posterior(root).propagate(quantities, positive=False)
    assert signed.interval[1].tolist() == [-np.inf, np.inf]


def test_a_first_order_interval_wider_than_the_value_says_nothing():
    wide = known(np.diag([1.1, 0.9, 0.01]) ** 2).propagate(
        lambda theta: theta, positive=True
    )
    assert np.isfinite(wide.sd).tolist() == [False, True, True]
    assert wide.interval[0].tolist() == [0.0, np.inf]


def test_a_quantity_that_no_free_parameter_changes_is_given():
    held = known(COVARIANCE[1:, 1:], fixed=1)
    found = held.propagate(lambda theta: theta, positive=True)
    assert found.given.tolist() == [True, False, False]
    concerned = held.propagate(lambda theta: theta, True, np.array([True, True, False]))
    assert concerned.given.tolist() == [True, False, True]
    np.testing.assert_allclose(concerned.interval[1], found.interval[1])


def test_a_measurement_adds_its_information_and_some_of_the_parameters_keep_their_covariance():
    before, row = known(), np.array([[3.0, -1.0, 2.0]])
    expected = np.linalg.inv(np.linalg.inv(before.covariance) + row.T @ row)
    np.testing.assert_allclose(before.add(row).covariance, expected, rtol=1e-9)
    some = before.marginal(np.array([True, False, True]))
    np.testing.assert_allclose(some.covariance, before.covariance[::2, ::2], rtol=1e-9)


@pytest.mark.parametrize(
    ("sd", "share", "flag", "source"),
    [
        (0.1, 0.95, Flag.IDENTIFIABLE, Source.DATA),
        (0.2, 0.5, Flag.IDENTIFIABLE, Source.BOTH),
        (0.3, 0.25, Flag.WEAK, Source.BOTH),
        (0.35, 0.02, Flag.UNIDENTIFIABLE, Source.PRIOR),
        (0.01, 0.0, Flag.UNIDENTIFIABLE, Source.PRIOR),
        (WEAK_PRIOR, 0.0, Flag.UNIDENTIFIABLE, None),
    ],
)
def test_the_flag_tells_what_the_logs_alone_determine(sd, share, flag, source):
    assert flag_of(sd, share) is flag
    assert ParameterStatus(flag, share=share, known=sd <= 1).source is source


def test_a_quantity_that_a_change_takes_away_is_not_known_and_spoils_no_other():
    def quantities(theta: np.ndarray) -> np.ndarray:
        # the second one has no value beside the estimate
        lost = np.where(theta[:, 0] == THETA[0], theta[:, 0], np.nan)
        return np.stack([theta[:, 0], lost], axis=1)

    found = known().propagate(quantities, positive=True)
    assert np.isfinite(found.sd).tolist() == [True, False]
    # the prior's share of it is asked of these slopes again
    sd = known().sd(found.slopes)
    np.testing.assert_allclose(sd[0], found.sd[0])
    assert np.isnan(sd[1])
