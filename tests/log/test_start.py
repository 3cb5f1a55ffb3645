"""The start pose: what the arm shows while it rests."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import step_log

POSE = np.deg2rad([0.0, 25.0, -60.0, 0.0, 0.0, 0.0, 20.0])


def noisy(levels: list[float], seed: int = 0):
    log = step_log(POSE, levels)
    noise = np.random.default_rng(seed).normal(0.0, np.deg2rad(0.1), log.angle.shape)
    return replace(log, angle=log.angle + noise)


def test_a_rest_before_the_first_command_averages_the_noise():
    errors = [noisy([0.0, 50.0], seed).start[1] - POSE[1] for seed in range(300)]
    assert np.std(errors) == pytest.approx(np.deg2rad(0.1) / np.sqrt(101), rel=0.2)


def test_a_log_that_begins_with_a_command_starts_at_its_first_sample():
    log = noisy([50.0, 0.0])
    assert np.array_equal(log.start, log.angle[0])


def test_motion_does_not_count_as_rest():
    log = step_log(POSE, [0.0, 50.0])
    moving = log.angle.copy()
    moving[101:, 1] += 1.0
    assert replace(log, angle=moving).start == pytest.approx(POSE, abs=1e-15)


def test_a_log_without_commands_rests_two_seconds_at_most():
    log = step_log(POSE, [0.0] * 5)
    sinking = log.angle.copy()
    sinking[300:, 1] -= 0.1
    assert replace(log, angle=sinking).start == pytest.approx(POSE, abs=1e-15)
