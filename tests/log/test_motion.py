"""What a log says of a joint's motion, on motions whose answer is known."""

from dataclasses import replace

import numpy as np
import pytest

from hydroid.log import JointMotion, Log

PERIOD = 0.02


def log_of(dead=0.0, lag=0.0, sign=1.0, speed=0.5):
    """A joint whose speed [rad/s] follows its command above a dead band [%], after a lag [s]."""
    rng = np.random.default_rng(0)
    command = np.repeat(rng.uniform(-100, 100, 100), 40)
    command[:50] = 0
    late = round(lag / PERIOD)
    above = np.sign(command) * np.maximum(np.abs(command) - dead, 0) / (100 - dead)
    turn = np.concatenate([np.zeros(late), above])[: len(command)]
    angle = sign * speed * PERIOD * np.concatenate([[0], np.cumsum(turn)[:-1]])
    time = PERIOD * np.arange(len(command))
    return Log("a", time, command[:, None], angle[:, None], PERIOD)


@pytest.mark.parametrize("dead", [0.0, 20.0, 50.0])
def test_a_dead_band_is_found(dead):
    assert JointMotion(log_of(dead=dead, lag=0.1), 1).dead_band == pytest.approx(dead + 5, abs=6)


def test_the_speed_is_that_of_fast_motion():
    assert 0.4 < JointMotion(log_of(), 1).speed < 0.5


def test_half_a_second_of_slow_motion_makes_no_dead_band():
    """Nothing is commanded between rest and 30 %, and the joint barely has time to start there."""
    log = log_of()
    command = np.zeros_like(log.command)
    large = np.abs(log.command) > 45
    command[large] = log.command[large]
    command[2000:2029] = 32.0
    speed = 0.005 * command
    speed[2000:2029] = 0.095 * 0.5
    angle = PERIOD * np.cumsum(speed, axis=0)
    assert JointMotion(replace(log, command=command, angle=angle), 1).dead_band <= 5
