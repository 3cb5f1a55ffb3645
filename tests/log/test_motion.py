"""What a log says of a joint's motion, on motions whose answer is known."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from conftest import noisy, step_log
from log_files import RIG, RIG_RANGES

from hydroid.log import JointMotion, Log, read_log
from hydroid.log.repair import hold
from hydroid.settings.log import LogSettings

PERIOD = 0.02


def joint_log(dead=0.0, lag=0.0, speed=0.5):
    """A joint whose speed [rad/s] follows its command above a dead band [%], after a lag [s]."""
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


def test_half_a_second_of_slow_motion_makes_no_dead_band():
    """Nothing is commanded between rest and 30 %, and the joint barely has time to start there."""
    log = joint_log()
    command = np.where(np.abs(log.command) > 45, log.command, 0.0)
    speed = 0.005 * command
    command[2000:2029], speed[2000:2029] = 32.0, 0.095 * 0.5
    angle = PERIOD * np.cumsum(speed, axis=0)
    assert JointMotion(replace(log, command=command, angle=angle), 1).dead_band <= 5


@cache
def rig(name: str) -> Log:
    return read_log(RIG / f"{name}.csv", LogSettings(), RIG_RANGES)[0]


def shifted(log: Log, by: float) -> Log:
    """The command logged `by` [s] earlier than it acts."""
    return replace(log, command=hold(log.time, log.command, log.time + by, log.period))


@pytest.mark.parametrize("name", ["rig_shoulder_1", "rig_shoulder_2", "rig_all_joints_1"])
@pytest.mark.parametrize("samples", [-30, -10, 0, 25, 100])
def test_the_lag_follows_a_shift_to_the_sample(name: str, samples: int) -> None:
    log = rig(name)
    for joint in (np.flatnonzero(log.driven) + 1).tolist():
        own = JointMotion(log, joint).lag
        moved = JointMotion(shifted(log, samples * log.period), joint).lag
        assert own is not None
        assert moved is not None
        assert 0 < own < 0.06
        assert moved - own == pytest.approx(samples * log.period, abs=0.011)


def spring_arm(command: np.ndarray, delay: int = 0, noise_deg: float = 0.05) -> Log:
    """8 q̈ + 231.8 q̇ + 53.4 q = 0.2 u: the article's shoulder without gravity, as a log of one joint."""
    q = np.zeros(len(command))
    position, speed, h = 0.0, 0.0, 0.001
    for k in range(len(q)):
        q[k] = position
        u = command[k - delay] if k >= delay else 0.0
        for _ in range(10):
            speed = (speed + h / 8 * (0.2 * u - 53.4 * position)) / (1 + h * 231.8 / 8)
            position += h * speed
    q += np.deg2rad(noise_deg) * np.random.default_rng(5).normal(size=len(q))
    time = np.arange(len(q), dtype=float) * 0.01
    return Log("spring", time, command[:, None], q[:, None], 0.01)


TIME = np.arange(3000) * 0.01
STEPS = np.repeat(np.random.default_rng(6).uniform(-100, 100, 20), 150)
SINES = 40 * np.sin(0.6 * TIME) + 30 * np.sin(2.1 * TIME + 1) + 20 * np.sin(4.5 * TIME + 2)


@pytest.mark.parametrize("command", [STEPS, SINES], ids=["steps", "sines"])
@pytest.mark.parametrize("delay", [0, 30])
def test_a_spring_that_turns_the_velocity_ahead_does_not_mislead(command: np.ndarray, delay: int) -> None:
    lag = JointMotion(spring_arm(command, delay), 1).lag
    assert lag is not None
    assert 0 <= lag - 0.01 * delay <= 0.06


@pytest.mark.parametrize(
    "command",
    [60 * np.sin(0.6 * TIME), np.full(3000, 40.0), STEPS[:250]],
    ids=["one sine", "constant", "short"],
)
def test_a_log_that_cannot_tell_raises_no_alarm(command: np.ndarray) -> None:
    lag = JointMotion(spring_arm(command, delay=30), 1).lag
    assert lag is None or 0 <= lag <= 0.1


POSE = np.deg2rad([0.0, 25.0, -60.0, 0.0, 0.0, 0.0, 20.0])


def steps(levels: list[float], seed: int = 0) -> Log:
    return noisy(step_log(POSE, levels), 0.1, seed, exact_start=False)


def test_a_rest_before_the_first_command_averages_the_noise():
    errors = [steps([0.0, 50.0], seed).start[1] - POSE[1] for seed in range(300)]
    assert np.std(errors) == pytest.approx(np.deg2rad(0.1) / np.sqrt(101), rel=0.2)


def test_a_log_that_begins_with_a_command_starts_at_its_first_sample():
    log = steps([50.0, 0.0])
    assert np.array_equal(log.start, log.angle[0])


@pytest.mark.parametrize(("levels", "moves"), [([0.0, 50.0], 101), ([0.0] * 5, 300)])
def test_rest_ends_with_the_first_command_or_after_two_seconds(levels: list[float], moves: int):
    log = step_log(POSE, levels)
    moving = log.angle.copy()
    moving[moves:, 1] += 1.0
    assert replace(log, angle=moving).start == pytest.approx(POSE, abs=1e-15)
