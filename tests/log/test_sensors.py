"""Faults of a sensor are told from motion, and good logs are free of them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from log_files import RIG, RIG_RANGES, read

import hydroid
from hydroid.log import JointMotion, Log
from hydroid.log.sensors import leaps, resolution

KINDS = {
    "leap",
    "coarse",
    "frozen",
    "straight",
    "turned",
    "range of one",
    "lost",
    "split",
}
EXAMPLES = Path(__file__).parents[2] / "examples"
GOOD = {"fit-mech": "logs/*.csv", EXAMPLES / "excavator/fit.yaml": "excavator/*.csv"}
GOOD |= {EXAMPLES / "boom/fit.yaml": "boom/*.csv"}


@pytest.mark.parametrize("config", GOOD, ids=str)
def test_good_logs_have_none_of_these_findings(config: str | Path) -> None:
    logs = sorted(EXAMPLES.glob(GOOD[config]))
    assert logs
    # one by one: logs that are given together are compared as well, which takes longest
    for log in logs:
        (checked,) = hydroid.check(log, config=config).result
        assert not [str(one) for one in checked.findings if one.kind in KINDS]


TIME = 0.02 * np.arange(1000)


def motion(speed: float, noise: float = 0.02) -> np.ndarray:
    """A joint that turns to and fro at a speed [deg/s], starting and stopping within
    one sample: [rad]."""
    turning = np.select(
        [TIME % 4 < 1, (TIME % 4 > 2) & (TIME % 4 < 3)], [speed, -speed], 0.0
    )
    angle = np.cumsum(turning) * 0.02 + np.random.default_rng(2).normal(
        0, noise, len(TIME)
    )
    return np.deg2rad(angle)


@pytest.mark.parametrize("speed", [1.0, 20.0, 120.0, 400.0])
def test_a_start_within_one_sample_is_no_leap(speed: float) -> None:
    assert not len(leaps(TIME, motion(speed)))


@pytest.mark.parametrize("size", [5.0, 40.0])
@pytest.mark.parametrize("length", [1, 2, 3, 25, 10_000])
def test_a_leap_is_found_however_long_it_lasts(size: float, length: int) -> None:
    angle = motion(20.0)
    angle[400 : 400 + length] += np.deg2rad(size)
    assert leaps(TIME, angle).tolist() == [
        row for row in (400, 400 + length) if row < 1000
    ]


def test_a_gap_in_the_time_is_no_leap() -> None:
    angle, there = motion(20.0), (TIME < 8.3) | (TIME > 8.9)
    assert np.ptp(angle[~there]) > np.deg2rad(5)
    assert not len(leaps(TIME[there], angle[there]))


@pytest.mark.parametrize("step", [0.1, 2.0])
def test_the_resolution_is_the_step_of_the_sensor(step: float) -> None:
    readings = np.deg2rad(step) * np.round(np.rad2deg(motion(20.0)) / step)
    assert resolution(readings) == pytest.approx(np.deg2rad(step))


def driven(angle: np.ndarray, command: np.ndarray) -> JointMotion:
    return JointMotion(Log("a", TIME, command[:, None], angle[:, None], 0.02), 1)


def pushed() -> tuple[np.ndarray, np.ndarray]:
    """A noisy joint that follows its command."""
    command = 60 * np.sign(np.sin(2 * np.pi * TIME / 4 + 0.01)) * (TIME > 1)
    noise = np.random.default_rng(3).normal(0, 0.02, len(TIME))
    return np.deg2rad(0.02 * np.cumsum(command / 3) + noise), command


def test_an_angle_that_stands_while_driven_is_frozen() -> None:
    angle, command = pushed()
    assert driven(angle, command).frozen is None
    held = np.where((TIME > 9.99) & (TIME < 15), angle[500], angle)
    assert driven(held, command).frozen == pytest.approx((10.0, 14.98), abs=0.021)


def test_an_angle_at_a_stop_or_of_a_quiet_sensor_is_not_frozen() -> None:
    angle, command = pushed()
    # held there by commands that all push up
    stopped = np.minimum(angle, np.quantile(angle, 0.7))
    assert (
        driven(stopped, np.where(stopped == stopped.max(), 60, command)).frozen is None
    )
    rough = np.deg2rad(20) * np.round(np.rad2deg(angle) / 20)
    assert driven(rough, command).frozen is None


@pytest.mark.parametrize("backward", [False, True])
def test_one_test_of_the_sign_serves_both_directions(backward: bool) -> None:
    angle, command = pushed()
    way = -1 if backward else 1
    assert not driven(way * angle, command).contradicts(backward=backward)
    assert driven(-way * angle, command).contradicts(backward=backward)
    still = replace(driven(angle, command).log, angle=0 * angle[:, None])
    assert not JointMotion(still, 1).contradicts(backward=backward)


def test_findings_of_a_real_log_name_its_line(tmp_path: Path) -> None:
    lines = (RIG / "rig_shoulder_1.csv").read_text().splitlines()
    names, row = lines[0].split(","), lines[501].split(",")
    row[names.index("q2_deg")] = "0"
    path = tmp_path / "log.csv"
    path.write_text("\n".join([*lines[:501], ",".join(row), *lines[502:1000]]))
    _, findings = read(path, ranges=RIG_RANGES)
    (leap,) = [one for one in findings if one.kind == "leap"]
    assert leap.where.endswith("line 502, column q2_deg")
