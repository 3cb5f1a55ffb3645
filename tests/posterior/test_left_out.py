"""The error on a log that is left out: as refits without it find, and none where there is one log."""

import numpy as np
import pytest
from linear_problem import DEG, THETA, Linear, least_squares, slow

from hydroid.posterior.covariance import uncertainty
from hydroid.posterior.left_out import left_out_errors


def problem_of(logs: int, differ: float) -> tuple[Linear, np.ndarray]:
    rng = np.random.default_rng(7)
    columns = np.hstack([slow(3, 400, seed=g) for g in range(logs)])
    truth = THETA * (1 + differ * rng.normal(size=(logs, 3)))
    measured = np.hstack([t @ columns[:, g * 400 : (g + 1) * 400] for g, t in enumerate(truth)])
    measured += rng.normal(0, 0.1 * DEG, measured.size)
    theta = least_squares(columns, measured)
    return Linear(columns, measured, theta, weights=(1.0,) * logs), theta


@pytest.mark.parametrize("differ", [0.0, 0.05])
def test_the_error_is_that_of_a_fit_without_the_log(differ: float):
    problem, theta = problem_of(4, differ)
    found = left_out_errors(problem, uncertainty(problem, theta))
    errors = []
    for g in range(4):
        own = np.arange(1600) // 400 == g
        theta = least_squares(problem.columns[:, ~own], problem.measured[~own])
        errors.append(np.sqrt(np.mean((problem.measured - theta @ problem.columns)[own] ** 2)))
    np.testing.assert_allclose(found[2], errors, rtol=1e-4)


def test_one_log_says_nothing_of_another():
    problem, theta = problem_of(1, 0.0)
    assert left_out_errors(problem, uncertainty(problem, theta)) == {}
