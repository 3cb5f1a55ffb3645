from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from log_files import RIG, RIG_RANGES

from hydroid.log import JointMotion, Log, LogFinding, read_log, write_log
from hydroid.log.repair import hold
from hydroid.settings.log import LogSettings


@cache
def rig(name: str) -> Log:
    return read_log(RIG / f"{name}.csv", LogSettings(), RIG_RANGES)[0]


def shifted(log: Log, by: float) -> Log:
    """The command logged `by` [s] earlier than it acts."""
    return replace(log, command=hold(log.time, log.command, log.time + by, log.period))


def mentions(log: Log, folder: Path, settings: LogSettings | None = None) -> list[LogFinding]:
    write_log(folder / "log.csv", log, LogSettings())
    return read_log(folder / "log.csv", settings or LogSettings(), RIG_RANGES)[1]


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


def test_an_early_command_is_mentioned_and_the_setting_cures_it(tmp_path: Path) -> None:
    log = shifted(rig("rig_all_joints_1"), 0.3)
    (mention,) = mentions(log, tmp_path)
    assert mention.level == "note"
    assert "command of joints 1, 2, 3, 4, 5 and 6 looks 0.3" in mention.what
    delay = float(mention.hint.split("delay_s: ")[1].split()[0])
    assert delay == pytest.approx(0.33, abs=0.021)
    assert mentions(log, tmp_path, LogSettings(delay_s=delay)) == []


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


def stopping_joint(command: np.ndarray, stop_deg: float, delay: int, seed: int) -> Log:
    """A joint that follows its command at once, 0.5 deg/s per %, between two stops."""
    q, speed, angle = np.zeros(len(command)), 0.0, 0.0
    stop = np.deg2rad(stop_deg)
    for k in range(len(command)):
        q[k] = angle
        u = command[k - delay] if k >= delay else 0.0
        speed += 0.25 * (np.deg2rad(0.5 * u) - speed)
        angle += 0.01 * speed
        if abs(angle) > stop:
            angle, speed = np.clip(angle, -stop, stop), 0.0
    q += np.deg2rad(0.05) * np.random.default_rng(seed).normal(size=len(q))
    return Log("stop", np.arange(len(q), dtype=float) * 0.01, command[:, None], q[:, None], 0.01)


@pytest.mark.parametrize("stop_deg", [5, 15, 40])
@pytest.mark.parametrize("dwell", [100, 200, 400])
def test_a_joint_at_its_stop_is_not_taken_for_a_delay(stop_deg: float, dwell: int) -> None:
    """It stands still for most of the log: nothing but its true lag may be said, at any delay."""
    answers = 0
    for seed in range(2):
        steps = np.random.default_rng(seed).uniform(-100, 100, 6000 // dwell)
        squares = 80 * np.sign(np.sin(np.arange(6000) * 0.01 * (1 + 0.3 * seed)))
        for command in (np.repeat(steps, dwell), squares):
            for delay in (0, 30):
                lag = JointMotion(stopping_joint(command, stop_deg, delay, seed), 1).lag
                answers += lag is not None
                assert lag is None or -0.02 < lag - 0.01 * delay < 0.06 or 0 <= lag <= 0.1
    assert answers >= 2


def test_noise_alone_has_no_delay() -> None:
    log = rig("rig_shoulder_1")
    rng = np.random.default_rng(7)
    for _ in range(10):
        noise = rng.normal(size=log.angle.shape)
        assert JointMotion(replace(log, angle=noise), 2).lag is None
    assert JointMotion(log, 1).lag is None
