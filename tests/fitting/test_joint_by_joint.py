"""Several hydraulic joints: each alone with the others as logged, then all together."""

from dataclasses import replace

import numpy as np
from small_fits import Watcher

from hydroid import load_settings
from hydroid.fitting.fit import fit
from hydroid.fitting.multistart import alone, lone_joints
from hydroid.log import Log
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem

TRUTH = {"open_2": 0.35, "open_3": 0.5, "overlap_2": 0.4, "overlap_3": 0.3, "M3": 20.0}


def make(noise_deg: float = 0.0, **changes):
    """Six seconds of steps on joints 2 and 3, after half a second at rest, in stage 2."""
    fixed = {"D": {"quantity": "damping", "fixed": 100.0}}
    free = {
        "open_2": {"quantity": "opening", "joints": [2], "bounds": [0.1, 1.0]},
        "open_3": {"quantity": "opening", "joints": [3], "bounds": [0.1, 1.0]},
        "overlap_2": {"quantity": "overlap", "joints": [2], "bounds": [0.0, 0.8]},
        "overlap_3": {"quantity": "overlap", "joints": [3], "bounds": [0.0, 0.8]},
        "M3": {"quantity": "mass", "link": "link3", "bounds": [10.0, 40.0], "start": 22.0},
    }
    settings = load_settings(
        "fit-hyd",
        {
            "parameters": fixed | free,
            "outputs": [2, 3],
            "joint_refinement": False,
            "objective.segments": {"equal": 1},
            "search.algorithm": "multistart",
            "search.multistart": {"starts": 2, "horizons": [1.0]},
        }
        | changes,
    )
    time = np.arange(650) * 0.01
    command = np.zeros((650, 7))
    command[50:, 1] = np.repeat([60.0, -80.0, 70.0, 0.0], 150)
    command[50:, 2] = np.repeat([-70.0, 80.0, 0.0, -60.0, 90.0], 120)
    log = Log("steps", time, command, np.tile(settings.arm.pose("study"), (650, 1)), 0.01)
    log = simulate_log(settings, log, TRUTH | {"D": 100.0}, "truth")
    noise = np.random.default_rng(0).normal(0.0, np.deg2rad(noise_deg), log.angle.shape)
    noise[0] = 0.0
    return settings, replace(log, angle=log.angle + noise)


def test_a_lone_joint_feels_no_valve_but_its_own():
    settings, log = make()
    problem = Problem(settings, [log])
    assert lone_joints(problem) == (2, 3)
    values = problem.parameters.mapping(problem.parameters.start)
    one = alone(problem, 2, problem.parameters.vector(values, ""))
    assert [n for n, free in zip(one.parameters.names, one.parameters.free, strict=True) if free] == [
        "open_2",
        "overlap_2",
    ]
    other = alone(problem, 2, problem.parameters.vector(values | {"open_3": 0.9, "overlap_3": 0.7}, ""))
    unit = np.full((1, 2), 0.3)
    angles = [p.residuals(p.parameters.from_unit(unit)) for p in (one, other)]
    np.testing.assert_array_equal(*angles)


def test_a_lone_joint_moves_as_with_all_others():
    settings, log = make()
    problem = Problem(settings, [log])
    truth = problem.parameters.vector(TRUTH | {"D": 100.0}, "truth")
    for joint in lone_joints(problem):
        error = alone(problem, joint, truth).residuals(truth[None])
        assert np.rad2deg(np.sqrt(np.mean(error**2))) < 0.1  # the logged motion passes a low-pass


def test_joints_that_follow_the_log_take_their_part_of_the_pump():
    """Two joints share a pump that cannot serve both: each alone is as slow as beside the other.

    What is left is the low-pass of the motion that is followed, less than half of the pump's effect.
    """
    settings, log = make(**{"hydraulics.pump_flow": 1.5, "hydraulics.line_volume": 20.0})
    _, own_pumps = make()
    problem = Problem(settings, [log])
    truth = problem.parameters.vector(TRUTH | {"D": 100.0}, "truth")
    for joint in lone_joints(problem):
        error = alone(problem, joint, truth).residuals(truth[None])
        effect = (own_pumps.angle - log.angle)[:, joint - 1]
        assert np.rad2deg(np.sqrt(np.mean(effect**2))) > 1
        assert np.mean(error**2) < 0.25 * np.mean(effect**2)


def test_the_start_pose_is_the_recordings_not_the_joints():
    """Joint 3 rests for longer than joint 2: its lone log must not start amid joint 2's motion."""
    _, log = make(noise_deg=0.1)
    log = replace(log, command=log.command * (np.arange(650) >= 120)[:, None] ** (np.arange(7) == 2))
    np.testing.assert_array_equal(log.driving(3).start, log.start)
    assert log.driving(3).driven.tolist() == [False, False, True, False, False, False, False]


def test_joint_by_joint_then_together_finds_the_truth():
    settings, log = make()
    problem = Problem(settings, [log])
    watcher = Watcher()
    result = fit(problem, watcher)
    assert [row[0] for row in watcher.rows] == [1, 2]
    truth = problem.parameters.vector(TRUTH | {"D": 100.0}, "truth")
    own = [n in ("open_2", "open_3", "overlap_2", "overlap_3") for n in problem.parameters.names]
    assert np.rad2deg(result.searched.rms) < 0.5
    np.testing.assert_allclose(result.searched.theta[own], truth[own], rtol=0.2)
    np.testing.assert_allclose(result.best.theta, truth, rtol=1e-3)
    assert result.converged


def test_a_single_joint_is_fitted_with_the_others_as_the_settings_say():
    settings, log = make()
    assert lone_joints(Problem(settings.model_copy(update={"outputs": (2,)}), [log])) == ()
