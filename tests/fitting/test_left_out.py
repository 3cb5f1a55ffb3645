"""Parts left out: fits predict what they have not seen, and what is missing gains by
more than its error."""

from dataclasses import replace

import numpy as np
import pytest
from made_logs import FAST, fast_arm, noisy, stepped

from hydroid.advice.suggestions import refitted
from hydroid.fitting.left_out import (
    BLOCK,
    LEAST_BLOCKS,
    LeftOut,
    blocks,
    gain,
    is_better,
    parts,
    predict_blocks,
    predict_parts,
)
from hydroid.log import Log
from hydroid.posterior.error_model import make_likelihood
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
    truth = problem.parameters.vector(FAST, "truth")
    return predict_parts(
        problem, np.tile(truth, (len(np.unique(parts(problem))), 1)), refitted
    )


def test_a_part_is_predicted_by_a_fit_that_has_not_seen_it():
    """A log that is another one changes its own prediction, and all fits but the one
    without it."""
    logs = [log_of(seed) for seed in range(3)]
    before = predicted(MORE, logs)
    after = predicted(MORE, [*logs[:2], replace(log_of(5, 1.3), source="log_2.csv")])
    np.testing.assert_array_equal(after.thetas[2], before.thetas[2])
    assert (after.thetas[:2] != before.thetas[:2]).any(axis=1).all()
    problem = Problem(MORE, logs)
    assert before.thetas.shape == (3, len(problem.parameters.names))
    for part in range(3):
        samples = parts(problem) == part
        errors = problem.output_errors(before.thetas[part][None])[0]
        np.testing.assert_allclose(before.errors[samples], errors[samples], atol=1e-12)


def test_of_one_log_the_halves_are_parts():
    log = log_of(0)
    before = predicted(MORE, [log])
    half, angle = len(log.time) // 2, log.angle.copy()
    # beyond what the way of the first half is measured from
    angle[half + 20 :, 1] += 0.1
    after = predicted(MORE, [replace(log, angle=angle)])
    np.testing.assert_allclose(after.thetas[1], before.thetas[1], rtol=1e-9)
    assert np.abs(after.thetas[0] / before.thetas[0] - 1).max() > 0.01


def test_more_than_three_logs_are_left_out_in_three_groups():
    number = parts(Problem(ONE, [log_of(seed) for seed in range(5)]))
    samples = len(log_of(0).time)
    assert number[::samples].tolist() == [0, 1, 2, 0, 1]


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
    end = refitted(likelihood, truth, 1)
    all_of_it = problem.parameters.from_unit(end.point)
    found = predict_blocks(likelihood, end)
    number = blocks(problem)
    for block in range(number.max() + 1):
        out = number == block
        rest = replace(likelihood, shown=likelihood.shown.without(out))
        alone = problem.parameters.from_unit(refitted(rest, truth, 1).point)
        change = np.log(alone / all_of_it)
        assert (
            np.linalg.norm(np.log(found.thetas[block] / alone))
            < 0.2 * np.linalg.norm(change) + 1e-5
        )
        errors = problem.output_errors(found.thetas[block][None])[0]
        np.testing.assert_allclose(found.errors[out], errors[out], atol=1e-4)


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


def test_the_gain_is_that_of_the_weighed_squares_and_its_error_that_of_the_blocks():
    problem = Problem(ONE, [log_of(seed) for seed in range(3)])
    rng = np.random.default_rng(0)
    theta = problem.parameters.start[None]
    before = LeftOut(problem, theta, rng.normal(0.0, 0.01, problem.measured.size))
    after = LeftOut(problem, theta, rng.normal(0.0, 0.007, problem.measured.size))
    levels = np.zeros(blocks(problem).max() + 1)
    for one in (before, after):
        weighing = make_likelihood(problem).estimated(one.errors).errors
        squares = weighing.innovations(np.stack([before.errors, after.errors])) ** 2
        levels += 0.5 * np.bincount(blocks(problem), 0.5 * (squares[0] - squares[1]))
    rise, error = gain(after, before)
    assert gain(before, after) == pytest.approx((-rise, error))
    assert rise == pytest.approx(levels.sum())
    assert rise > 0
    assert error == pytest.approx(np.sqrt(len(levels)) * np.std(levels, ddof=1))


def test_what_diverges_is_worse_and_one_that_does_not_is_better():
    log = log_of(0).first(1.0)
    problem = Problem(ONE, [log])
    theta = problem.parameters.start[None]
    noise = np.random.default_rng(1).normal(0.0, 0.01, len(log.time))
    low, lost = (LeftOut(problem, theta, factor * noise) for factor in (1.0, np.inf))
    assert is_better(low, lost)
    assert not is_better(lost, low)
    assert not is_better(lost, lost)
