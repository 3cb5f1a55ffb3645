"""Whether innovations are white, and for how long what is left of an error lasts."""

import numpy as np
import pytest
import statsmodels.api as sm
from linear_problem import ar1
from made_errors import DRIFTING, course_of, model_of_errors

from hydroid.log import Log
from hydroid.posterior.whiteness import (
    autocorrelation,
    cross_correlation,
    lasting,
    residual_tests,
)

SAMPLES, PERIOD = 2000, 0.05
LOGS = model_of_errors([course_of(SAMPLES), course_of(SAMPLES, SAMPLES)], DRIFTING)


def test_white_innovations_are_called_white():
    rng = np.random.default_rng(0)
    said = [lasting(LOGS, rng.normal(size=2 * SAMPLES))[2] for _ in range(100)]
    assert np.count_nonzero(said) <= 5


@pytest.mark.parametrize("time", [0.3, 1.0])
@pytest.mark.parametrize("white", [0.0, 1.0])
def test_a_first_order_process_lasts_for_its_time_constant(time: float, white: float):
    """However much white noise is added."""
    rng, phi = np.random.default_rng(1), float(np.exp(-PERIOD / time))
    said = []
    for _ in range(30):
        row = np.concatenate([ar1(rng, SAMPLES, phi, 1.0) for _ in range(2)])
        said.append(lasting(LOGS, row + rng.normal(0.0, max(white, 1e-9), len(row)))[2])
    assert np.mean(said) == pytest.approx(time, rel=0.2)
    assert np.all((np.array(said) > 0.5 * time) & (np.array(said) < 2 * time))


def test_what_is_not_white_at_the_first_lag_alone_lasts_a_sample():
    new = np.random.default_rng(2).normal(size=2 * SAMPLES + 1)
    assert lasting(LOGS, new[1:] - 0.8 * new[:-1])[2] == pytest.approx(PERIOD)


def test_the_time_is_that_between_samples_that_count():
    """A log at 10 Hz on a grid of 20 Hz."""
    rng, phi = np.random.default_rng(3), float(np.exp(-2 * PERIOD / 1.0))
    used = np.arange(2 * SAMPLES) % 2 == 0
    slower = model_of_errors([course_of(2 * SAMPLES, used=used)], DRIFTING)
    row = np.zeros(2 * SAMPLES)
    row[used] = ar1(rng, SAMPLES, phi, 1.0)
    assert lasting(slower, row)[2] == pytest.approx(1.0, rel=0.3)


def test_the_autocorrelation_is_that_of_statsmodels_and_logs_do_not_touch():
    rng = np.random.default_rng(4)
    row = ar1(rng, SAMPLES, 0.9, 1.0)
    row -= row.mean()
    expected = sm.tsa.acf(row, nlags=40)[1:]
    np.testing.assert_allclose(autocorrelation([row], 40), expected, rtol=1e-9)
    # an end and a beginning that are alike are no correlation
    ends = [np.append(np.zeros(50), 1.0), np.append(1.0, np.zeros(50))]
    np.testing.assert_array_equal(autocorrelation(ends, 5), 0.0)


def driven_log(command: np.ndarray) -> Log:
    """A log that drives the second joint; what it measures plays no role here."""
    commands = np.column_stack([np.zeros(len(command)), command])
    return Log(
        "made",
        PERIOD * np.arange(len(command)),
        commands,
        np.zeros_like(commands),
        PERIOD,
    )


def test_what_answers_to_a_command_later_is_found_at_its_delay_and_nowhere_else():
    rng = np.random.default_rng(5)
    commands = [rng.normal(size=SAMPLES) for _ in range(2)]
    late = 7
    rows = [rng.normal(size=SAMPLES) for _ in range(2)]
    for row, command in zip(rows, commands, strict=True):
        row[late:] += 0.5 * command[:-late]
    test = residual_tests(
        LOGS, np.concatenate(rows), [driven_log(command) for command in commands]
    )[2]
    found = test.command_lags[np.argmax(test.with_command)]
    assert found == pytest.approx(late * PERIOD)
    assert test.with_command.max() == pytest.approx(0.5 / np.sqrt(1.25), abs=0.05)
    assert test.bound == pytest.approx(1.96 / np.sqrt(2 * SAMPLES), rel=1e-3)
    others = np.delete(test.with_command, np.argmax(test.with_command))
    assert np.mean(np.abs(others) > test.bound) < 0.15


def test_of_white_innovations_five_percent_lie_outside_either_bound():
    rng = np.random.default_rng(6)
    outside = []
    for _ in range(40):
        logs = [
            driven_log(np.repeat(rng.normal(size=SAMPLES // 20), 20)) for _ in range(2)
        ]
        outside.append(
            residual_tests(LOGS, rng.normal(size=2 * SAMPLES), logs)[2].outside
        )
    assert np.mean(outside, axis=0) == pytest.approx([0.05, 0.05], abs=0.02)


def test_a_command_that_never_changes_correlates_with_nothing():
    row = np.random.default_rng(7).normal(size=SAMPLES)
    np.testing.assert_array_equal(
        cross_correlation([row], [np.full(SAMPLES, 30.0)], 5), 0.0
    )
