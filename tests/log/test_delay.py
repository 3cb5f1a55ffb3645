from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from log_files import RIG, RIG_RANGES

from hydroid.log import JointMotion, Log, read_log
from hydroid.log.repair import hold
from hydroid.settings.log import LogSettings


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


def test_noise_alone_has_no_delay() -> None:
    log = rig("rig_shoulder_1")
    rng = np.random.default_rng(7)
    for _ in range(10):
        noise = rng.normal(size=log.angle.shape)
        assert JointMotion(replace(log, angle=noise), 2).lag is None
    assert JointMotion(log, 1).lag is None
