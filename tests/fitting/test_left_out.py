"""Parts left out: fits predict what they have not seen, and what is missing gains by
more than its error."""

from dataclasses import replace

import numpy as np
import pytest
from made_logs import FAST, fast_arm, noisy, stepped

from hydroid.arrays import Array
from hydroid.fitting.left_out import (
    BLOCK,
    COMPARED,
    LEAST_BLOCKS,
    LeftOut,
    blocks,
    gain,
    is_better,
    not_fitted,
    predict_blocks,
    refit,
)
from hydroid.fitting.refinement import Refinement, refine_from_afar
from hydroid.fitting.step import Step
from hydroid.log import Log
from hydroid.posterior.error_model import Likelihood, make_likelihood
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings

LEVELS = [60.0, -80.0, 30.0, 0.0, -40.0, 70.0, -60.0, 20.0]
ONE = fast_arm([2], "K", "D")
MORE = fast_arm([2], "K", "D", "S")
"""with the stiffness free, too"""


def log_of(seed: int, stiffness: float = 1.0) -> Log:
    levels = LEVELS[seed % 8 :] + LEVELS[: seed % 8]
    truth = FAST | {"S": stiffness * FAST["S"]}
    exact = replace(stepped(MORE, truth, levels), source=f"log_{seed}.csv")
    return noisy(exact, 0.1, seed, exact_start=False)


def predicted(settings: FitSettings, logs: list[Log]) -> LeftOut:
    problem = Problem(settings, logs)
    return refit(problem, problem.parameters.vector(FAST, "truth"))


def refined(likelihood: Likelihood, theta: Array) -> Refinement:
    return refine_from_afar(
        likelihood, theta, COMPARED, lambda *_: False, {}, Step("compared")
    )


def test_blocks_are_spans_of_time_and_no_two_logs_share_one():
    logs = [log_of(seed) for seed in range(2)]
    number = blocks(Problem(ONE, logs))
    each = [number[: len(logs[0].time)], number[len(logs[0].time) :]]
    assert not {*each[0].tolist()} & {*each[1].tolist()}
    for log, own in zip(logs, each, strict=True):
        assert all(np.ptp(log.time[own == one]) <= BLOCK for one in np.unique(own))


def test_short_logs_have_as_many_blocks_as_a_standard_error_needs():
    number = blocks(Problem(ONE, [log_of(0).first(1.0)]))
    assert np.ptp(np.bincount(number)) <= 1
    assert number.max() + 1 == LEAST_BLOCKS


def test_a_block_is_predicted_as_by_a_fit_without_it():
    """To first order: what is left of each change is small beside it."""
    problem = Problem(MORE, [log_of(0)])
    truth = problem.parameters.vector(FAST, "truth")
    likelihood = make_likelihood(problem)
    end = refined(likelihood, truth)
    all_of_it = problem.parameters.from_unit(end.point)
    found = predict_blocks(problem, end)
    number = blocks(problem)
    for block in range(number.max() + 1):
        out = number == block
        rest = replace(likelihood, shown=likelihood.shown.without(out))
        alone = problem.parameters.from_unit(refined(rest, truth).point)
        change = np.log(alone / all_of_it)
        assert (
            np.linalg.norm(np.log(found.thetas[block] / alone))
            < 0.2 * np.linalg.norm(change) + 1e-5
        )
        errors = problem.output_errors(found.thetas[block][None])[0]
        np.testing.assert_allclose(found.errors[out], errors[out], atol=1e-4)


def test_a_parameter_beside_which_nothing_can_be_simulated_is_held():
    problem = Problem(MORE, [log_of(seed) for seed in range(2)])
    likelihood = make_likelihood(problem)
    end = refined(likelihood, problem.parameters.vector(FAST, "truth"))
    jacobian = end.jacobian.copy()
    jacobian[3:, 1] = np.nan
    left_out = predict_blocks(problem, replace(end, jacobian=jacobian))
    held = np.where(np.arange(3) == 1, 0.0, end.jacobian)
    expected = predict_blocks(problem, replace(end, jacobian=held))
    np.testing.assert_array_equal(left_out.judged, expected.judged)
    assert np.ptp(left_out.thetas[:, 1]) == 0.0
    assert (np.ptp(left_out.thetas[:, [0, 2]], axis=0) > 0.0).all()


@pytest.mark.parametrize("stiffness", [1.3, 0.7])
def test_a_term_that_is_missing_gains_by_more_than_its_uncertainty(stiffness: float):
    logs = [log_of(seed, stiffness) for seed in range(3)]
    without, with_it = predicted(ONE, logs), predicted(MORE, logs)
    rise, error = gain(with_it, without)
    assert is_better(with_it, without)
    assert rise > 3 * error > 0
    assert not is_better(without, with_it)
    assert gain(without, with_it)[0] < 0


@pytest.mark.parametrize(
    ("fits", "most"), [(2, 1), pytest.param(20, 4, marks=pytest.mark.slow)]
)
def test_a_term_that_is_not_there_gains_nothing_that_is_certain(fits: int, most: int):
    """It is named in 5 % of the cases, and three standard deviations of that many."""
    named = 0
    for seed in range(0, 3 * fits, 3):
        logs = [log_of(seed + i) for i in range(3)]
        named += is_better(predicted(MORE, logs), predicted(ONE, logs))
    assert named <= most


def white(problem: Problem, scale: Array) -> LeftOut:
    """Return predictions with white errors of a standard deviation at each sample
    [rad], (R,)."""
    noise = np.random.default_rng(0).normal(size=problem.measured.size)
    return not_fitted(problem, problem.parameters.start, scale * noise)


def test_the_gain_is_the_logarithm_of_the_scales_of_errors_by_blocks():
    problem = Problem(ONE, [log_of(seed) for seed in range(3)])
    samples = problem.measured.size
    ones = np.ones(samples)
    before, after = (white(problem, sd * ones) for sd in (0.01, 0.007))
    rise, error = gain(after, before)
    assert gain(before, after) == pytest.approx((-rise, error))
    # of white errors each sample counts as one
    assert rise == pytest.approx(samples * np.log(0.01 / 0.007), rel=0.05)
    assert error < 0.2 * rise


def test_one_block_that_errs_much_counts_by_the_logarithm_of_that():
    problem = Problem(ONE, [log_of(seed) for seed in range(3)])
    number = blocks(problem)
    wrong = np.where(number == 1, 10.0, 1.0)
    # it predicts all blocks better, but one so much worse that squares say the contrary
    before = white(problem, 0.01 * np.ones(number.size))
    after = white(problem, 0.005 * wrong)
    worse = np.log(5.0) * np.sum(number == 1)
    better = np.log(2.0) * np.sum(number != 1)
    assert gain(after, before)[0] == pytest.approx(better - worse, rel=0.3)


def test_what_diverges_is_worse_and_one_that_does_not_is_better():
    log = log_of(0).first(1.0)
    problem = Problem(ONE, [log])
    theta = problem.parameters.start
    noise = np.random.default_rng(1).normal(0.0, 0.01, len(log.time))
    low, lost = (not_fitted(problem, theta, factor * noise) for factor in (1.0, np.inf))
    assert is_better(low, lost)
    assert not is_better(lost, low)
    assert not is_better(lost, lost)
