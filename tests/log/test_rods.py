"""Lengths of cylinders in a log stand for the angles of the joints that they turn."""

from pathlib import Path

import numpy as np
import pytest
from log_files import read

from hydroid.log import Log, Reading, check_log, guess_columns, open_table, write_log
from hydroid.log.rods import rods_of
from hydroid.settings.arm import Arm, load_arm
from hydroid.settings.log import LogSettings

T = np.arange(1500) * 0.02
STEPS = np.repeat([0.0, 60, -60, 0, 80, -40], 250)


@pytest.fixture(scope="module")
def arm() -> Arm:
    return load_arm("hydrolek")


def swept(arm: Arm, joint: int) -> np.ndarray:
    low, high = arm.joints[joint - 1].limits
    return (low + high) / 2 + 0.49 * (high - low) * np.sin(0.4 * T)


def table(folder: Path, **columns: np.ndarray) -> Path:
    path = folder / "log.csv"
    every = {"time_s": T, **columns}
    np.savetxt(
        path,
        np.stack([*every.values()], axis=1),
        "%.9g",
        ",",
        header=",".join(every),
        comments="",
    )
    return path


def test_an_angle_and_its_length_are_each_others_inverse(arm: Arm) -> None:
    rods = rods_of(arm)
    assert rods
    for joint, rod in rods.items():
        angle = swept(arm, joint)
        np.testing.assert_allclose(
            rod.angle(rod.cylinder.length(angle)), angle, atol=1e-10
        )
        assert rod.ends[0] < rod.ends[1]


@pytest.mark.parametrize("unit", ["mm", "cm", "m", ""])
@pytest.mark.parametrize(
    "travel", [False, True], ids=["from pin to pin", "the rod's travel"]
)
def test_lengths_are_guessed_and_read_as_angles(
    unit: str, travel: bool, arm: Arm, tmp_path: Path
) -> None:
    joint, rod = next(iter(rods_of(arm).items()))
    name, angle = arm.joint_names[joint - 1], swept(arm, joint)
    length = rod.cylinder.length(angle) - travel * rod.ends[0]
    column = f"{name}_length_{unit}".rstrip("_")
    factor = {"mm": 1e3, "cm": 1e2, "m": 1.0, "": 1e3}[unit]
    path = table(tmp_path, **{f"{name}_cmd": STEPS, column: factor * length})
    guess = guess_columns([open_table(path)], arm.joint_names, rods=rods_of(arm))
    entry = guess.log["joints"][joint]["angle"]
    assert (entry["column"], entry["unit"], "offset" in entry) == (
        column,
        unit or "mm",
        travel,
    )
    log, _ = read(path, LogSettings.model_validate(guess.log), arm.ranges, arm=arm)
    np.testing.assert_allclose(
        log.angle[:, joint - 1], angle[: len(log.time)], atol=1e-6
    )


def test_an_angle_that_is_there_is_taken_before_a_length(
    arm: Arm, tmp_path: Path
) -> None:
    joint, rod = next(iter(rods_of(arm).items()))
    name, angle = arm.joint_names[joint - 1], swept(arm, joint)
    columns = {
        f"{name}_cyl_mm": 1e3 * rod.cylinder.length(angle),
        f"{name}_angle_deg": np.rad2deg(angle),
    }
    path = table(tmp_path, **{f"{name}_cmd": STEPS}, **columns)
    guess = guess_columns([open_table(path)], arm.joint_names, rods=rods_of(arm))
    assert guess.log["joints"][joint]["angle"]["column"] == f"{name}_angle_deg"


def test_lengths_that_the_pins_do_not_allow_are_said(arm: Arm, tmp_path: Path) -> None:
    joint, rod = next(iter(rods_of(arm).items()))
    path = table(tmp_path, l=1e3 * rod.cylinder.length(swept(arm, joint)) + 200)
    entry = {"command": None, "angle": {"column": "l", "unit": "mm"}}
    settings = LogSettings.model_validate(
        {"command": None, "angle": None, "joints": {joint: entry}}
    )
    log, (fault, *_) = check_log(path, settings, arm.ranges, Reading(arm=arm))
    assert log is None
    assert fault.kind == "length outside"
    assert (
        f"its pins allow {1e3 * rod.ends[0]:.5g} to {1e3 * rod.ends[1]:.5g} mm"
        in str(fault)
    )


def test_a_length_without_a_cylinder_is_refused(arm: Arm, tmp_path: Path) -> None:
    joint = next(
        j for j in range(1, 8) if j not in rods_of(arm) and j not in arm.slides
    )
    path = table(tmp_path, l=np.full(len(T), 900.0))
    entry = {"angle": {"column": "l", "unit": "mm"}, "command": None}
    settings = LogSettings.model_validate(
        {"command": None, "angle": None, "joints": {joint: entry}}
    )
    _, (fault,) = check_log(path, settings, arm.ranges, Reading(arm=arm))
    assert f"no cylinder of {arm.joint_names[joint - 1]} is known" in str(fault)


@pytest.mark.parametrize("unit", ["_mm", "_cm", "_m", ""])
def test_lengths_are_no_angles_of_a_joint_whose_pivots_nobody_knows(
    unit: str, arm: Arm, tmp_path: Path
) -> None:
    """90 cm without a unit are a possible angle in deg."""
    joint = next(
        j for j in range(1, 8) if j not in rods_of(arm) and j not in arm.slides
    )
    name = arm.joint_names[joint - 1]
    columns = {f"{name}_cmd": STEPS, f"{name}_cyl{unit}": 90 + np.sin(T)}
    path = table(tmp_path, **columns)
    guess = guess_columns([open_table(path)], arm.joint_names, rods=rods_of(arm))
    assert guess.log["joints"][joint]["angle"] is None
    what = f"lengths of cylinders whose pivots are not known: {name}_cyl{unit}: give"
    assert [reason for reason in guess.reasons if what in reason]


def test_lengths_without_a_unit_that_the_pins_do_not_allow_are_no_angles(
    arm: Arm, tmp_path: Path
) -> None:
    joint, rod = next(iter(rods_of(arm).items()))
    name = arm.joint_names[joint - 1]
    length = 1.5 * rod.ends[1] + 0.01 * np.sin(T)
    path = table(tmp_path, **{f"{name}_cmd": STEPS, f"{name}_cyl": 1e3 * length})
    guess = guess_columns([open_table(path)], arm.joint_names, rods=rods_of(arm))
    assert guess.log["joints"][joint]["angle"]["unit"] == "mm"
    log, (fault, *_) = check_log(
        path, LogSettings.model_validate(guess.log), arm.ranges, Reading(arm=arm)
    )
    assert log is None
    assert fault.kind == "length outside"


def test_lengths_are_written_and_read_back(arm: Arm, tmp_path: Path) -> None:
    joints, rods = len(arm.joints), rods_of(arm)
    angle = np.stack([swept(arm, joint) for joint in range(1, joints + 1)], axis=1)
    log = Log("a", T, np.zeros_like(angle), angle, 0.02)
    entries = {
        j: {"angle": {"column": f"c{j}", "unit": "cm", "offset": 3.0}} for j in rods
    }
    assert len(entries) > 2
    settings = LogSettings.model_validate({"period_s": 0.02, "joints": entries})
    write_log(tmp_path / "log.csv", log, settings, exact=True, arm=arm)
    again, _ = read(tmp_path / "log.csv", settings, arm.ranges, arm=arm)
    np.testing.assert_allclose(again.angle, angle, atol=1e-10)
