"""What a log says of a joint's motion, on motions whose answer is known."""

from dataclasses import replace

import numpy as np
import pytest
from made_logs import noisy, step_log

from hydroid.log import JointMotion, Log
from hydroid.log.motion_checks import check_motion
from hydroid.log.table import Signal

PERIOD = 0.02


def joint_log(dead=0.0, lag=0.0, speed=0.5):
    """A joint whose speed [rad/s] follows its command above a dead band [%], after a
    lag [s]."""
    rng = np.random.default_rng(0)
    command = np.repeat(rng.uniform(-100, 100, 100), 40)
    command[:50] = 0
    late = round(lag / PERIOD)
    above = np.sign(command) * np.maximum(np.abs(command) - dead, 0) / (100 - dead)
    turn = np.concatenate([np.zeros(late), above])[: len(command)]
    angle = speed * PERIOD * np.concatenate([[0], np.cumsum(turn)[:-1]])
    time = PERIOD * np.arange(len(command))
    return Log("a", time, command[:, None], angle[:, None], PERIOD)


@pytest.mark.parametrize("dead", [0.0, 20.0, 50.0])
def test_a_dead_band_and_a_lag_are_found(dead):
    motion = JointMotion(joint_log(dead=dead, lag=0.1), 1)
    assert motion.dead_band == pytest.approx(dead + 5, abs=6)
    assert motion.likely_lag == pytest.approx(0.1, abs=0.03)


def test_the_speed_is_that_of_fast_motion():
    assert 0.4 < JointMotion(joint_log(), 1).speed < 0.5


def test_a_joint_that_rests_most_of_the_time_is_as_fast():
    moving = joint_log()
    rest = 30 * len(moving.time)
    noise = 2e-4 * np.random.default_rng(1).normal(size=(rest, 1))
    angle = np.concatenate([moving.angle, moving.angle[-1:] + noise])
    command = np.concatenate([moving.command, np.zeros((rest, 1))])
    time = PERIOD * np.arange(len(command))
    resting = JointMotion(replace(moving, time=time, command=command, angle=angle), 1)
    assert resting.speed == pytest.approx(JointMotion(moving, 1).speed, rel=0.2)
    # the noise is no motion that nobody has asked for
    assert sum(resting.unasked) < 1.0


@pytest.mark.parametrize(("speed", "said"), [(-0.1, True), (0.0, False)])
def test_an_arm_that_sinks_is_named(speed, said):
    """By 0.1 deg/s, after a motion and before another one."""
    moving = joint_log(lag=0.1)
    samples = round(30 / PERIOD)
    times = PERIOD * np.arange(samples)
    noise = 2e-4 * np.random.default_rng(1).normal(size=samples)
    rest = moving.angle[-1] + np.radians(speed) * times + noise
    onwards = moving.angle + rest[-1] - moving.angle[0]
    angle = np.concatenate([moving.angle, rest[:, None], onwards])
    command = np.concatenate([moving.command, 0 * rest[:, None], moving.command])
    time = PERIOD * np.arange(len(command))
    log = replace(moving, time=time, command=command, angle=angle)
    way, seconds = JointMotion(log, 1).sinking
    assert way == pytest.approx(speed * seconds, abs=0.1)
    assert seconds == pytest.approx(30, abs=4)
    signals = [
        Signal("u", "command", joint=1),
        Signal("q", "angle", joint=1, unit="deg"),
    ]
    kinds = [one.kind for one in check_motion(log, signals, [1], [], 0.0)]
    assert ("sinks" in kinds) == said


def test_the_noise_of_a_coil_is_no_command_that_asks_for_a_motion():
    full = joint_log()
    noise = 0.3 * np.random.default_rng(1).random(full.command.shape)
    # the coil of the other direction is not logged
    half = replace(full, command=full.command.clip(0) + noise)
    signals = [
        Signal("u_boom_a", "command", joint=1),
        Signal("q", "angle", joint=1, unit="deg"),
    ]
    kinds = [one.kind for one in check_motion(half, signals, [1], [], 0.0)]
    assert "half a command" in kinds


def test_a_command_without_its_direction_is_said():
    full = joint_log(lag=0.1)
    signals = [
        Signal("pwm", "command", joint=1),
        Signal("q", "angle", joint=1, unit="deg"),
    ]
    for command, said in ((np.abs(full.command), True), (full.command, False)):
        log = replace(full, command=command)
        kinds = [one.kind for one in check_motion(log, signals, [1], [], 0.0)]
        assert ("one sign" in kinds) == said


def test_half_a_second_of_slow_motion_makes_no_dead_band():
    """Nothing is commanded between rest and 30 %, and the joint barely has time to
    start there."""
    log = joint_log()
    command = np.where(np.abs(log.command) > 45, log.command, 0.0)
    speed = 0.005 * command
    command[2000:2029], speed[2000:2029] = 32.0, 0.095 * 0.5
    angle = PERIOD * np.cumsum(speed, axis=0)
    assert JointMotion(replace(log, command=command, angle=angle), 1).dead_band <= 5


@pytest.mark.parametrize("early", [0.1, 0.3])
def test_a_motion_before_its_command_is_told(early):
    log = joint_log(dead=10, lag=0.06)
    moved = replace(
        log, command=np.roll(log.command, round((0.06 + early) / PERIOD), axis=0)
    )
    assert JointMotion(moved, 1).ahead == pytest.approx(early, abs=0.021)
    assert JointMotion(log, 1).ahead == 0


POSE = np.deg2rad([0.0, 25.0, -60.0, 0.0, 0.0, 0.0, 20.0])


def steps(levels: list[float], seed: int = 0) -> Log:
    return noisy(step_log(POSE, levels), 0.1, seed, exact_start=False)


def test_a_rest_before_the_first_command_averages_the_noise():
    errors = [steps([0.0, 50.0], seed).start[1] - POSE[1] for seed in range(300)]
    assert np.std(errors) == pytest.approx(np.deg2rad(0.1) / np.sqrt(101), rel=0.2)


def test_a_log_that_begins_with_a_command_starts_at_its_first_sample():
    log = steps([50.0, 0.0])
    assert np.array_equal(log.start, log.angle[0])


@pytest.mark.parametrize(("drift", "rests"), [(0.0, True), (0.02, False)])
def test_the_noise_of_a_lever_is_rest_while_the_arm_stands(drift: float, rests: bool):
    """The lever then leaves 0 slowly: the arm rests until it does."""
    log = steps([0.0, 50.0])
    first = log.first_command
    noise = np.random.default_rng(0).normal(0, 0.3, log.command.shape)
    noise[first - 1] = 0.0
    command = np.where(log.command == 0, noise, log.command)
    command[first : first + 5, 1] = [0.4, 0.8, 1.2, 1.6, 2.0]
    angle = log.angle + drift * log.time[:, None]
    noisy_log = replace(log, command=command, angle=angle)
    assert noisy_log.first_command == (first if rests else 0)
    expected = log.start if rests else angle[0]
    assert np.array_equal(noisy_log.start, expected)


@pytest.mark.parametrize("full", [50.0, -50.0])
@pytest.mark.parametrize("beside", [0.8, -0.8])
def test_a_lever_that_rests_beside_zero_rests(full: float, beside: float):
    log = steps([0.0, full])
    command = np.where(log.command == 0, beside, log.command)
    at_rest = replace(log, command=command)
    assert at_rest.first_command == log.first_command > 0
    assert np.array_equal(at_rest.start, log.start)


@pytest.mark.parametrize(("levels", "moves"), [([0.0, 50.0], 101), ([0.0] * 5, 300)])
def test_rest_ends_with_the_first_command_or_after_two_seconds(
    levels: list[float], moves: int
):
    log = step_log(POSE, levels)
    moving = log.angle.copy()
    moving[moves:, 1] += 1.0
    assert replace(log, angle=moving).start == pytest.approx(POSE, abs=1e-15)
