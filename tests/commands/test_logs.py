"""What commands read: angles that are not measured stay unmeasured, though the simulation has a
start pose."""

from pathlib import Path

import numpy as np
import pytest
from log_files import RIG

from hydroid import load_settings, read_logs, simulate
from hydroid.advice.assumptions import exchanged
from hydroid.fitting.multistart import lone_joints
from hydroid.log import Log
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings

LOG = RIG / "rig_all_joints_1.csv"
UNMEASURED = {"log.joints.3.angle": None}


def settings(**changes: object) -> FitSettings:
    own = {
        f"parameters.own_{j}": {"quantity": "overlap", "joints": [j], "bounds": [0.0, 0.8]} for j in (2, 4)
    }
    return load_settings("fit-hyd", {"outputs": [2, 4], "start_pose": "study", **own, **changes})


def read(**changes: object) -> tuple[Log, FitSettings]:
    fit = settings(**changes)
    (log,) = read_logs(LOG, fit)
    return log, fit


def test_an_unmeasured_joint_is_unmeasured_and_starts_in_the_start_pose() -> None:
    log, fit = read(**UNMEASURED)
    assert log.measured.tolist() == [joint != 3 for joint in range(1, 8)]
    assert np.isnan(log.angle[:, 2]).all()
    assert log.start[2] == fit.arm.pose("study")[2]
    np.testing.assert_array_equal(log.posed[:, 2], fit.arm.pose("study")[2])
    whole, _ = read()
    there = [joint != 2 for joint in range(7)]
    np.testing.assert_array_equal(log.start[there], whole.start[there])
    np.testing.assert_array_equal(whole.posed, whole.angle)


def test_a_log_that_was_read_elsewhere_has_a_start_pose_too() -> None:
    log, fit = read(**UNMEASURED)
    (again,) = read_logs(Log(log.source, log.time, log.command, log.angle, log.period), fit)
    np.testing.assert_array_equal(again.start, log.start)


def test_what_needs_the_motion_of_driven_joints_leaves_out_logs_that_lack_it() -> None:
    """The start of a joint is open, joints are fitted alone and columns compared only where it is
    measured."""
    log, fit = read(**UNMEASURED)
    problem, whole = Problem(fit, [log]), Problem(settings(), [read()[0]])
    assert 3 in whole.started(whole.logs[0])
    assert 3 not in problem.started(log)
    assert lone_joints(whole) == (2, 4)
    assert lone_joints(problem) == ()
    assert exchanged(fit, [log]) == ()


@pytest.mark.parametrize("others", ["measured", "locked", "passive"])
def test_a_log_without_an_angle_is_simulated(others: str, tmp_path: Path) -> None:
    """A joint that is neither driven nor measured stands in its pose where others follow the log."""
    changes = {**UNMEASURED, "log.joints.3.command": None, "simulation.other_joints": others}
    log, fit = read(**changes)
    response = Problem(fit, [log]).responses(fit.parameter_set().start[None])[0].angle
    assert np.isfinite(response).all()


def test_a_simulation_from_a_named_pose_starts_there_and_writes_all_angles(tmp_path: Path) -> None:
    truth = RIG.parent / "article" / "truth.yaml"
    log = simulate(RIG / "rig_shoulder_1.csv", fit=truth, pose="study", out=tmp_path / "log.csv").log
    assert log.measured.all()
    np.testing.assert_allclose(log.start, load_settings("fit-hyd").arm.pose("study"), atol=1e-3)
