"""The simulation against plain MuJoCo and Radau, and what both stages have in
common."""

import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from arms import posed, with_masses
from conftest import candidates, replaced, scattered, simulation
from made_logs import step_log
from scipy.integrate import solve_ivp

from hydroid.simulation import Candidates
from hydroid.simulation.simulation import reading


@pytest.mark.parametrize(
    ("kind", "other", "drift"),
    [("mech", "locked", 1e-9), ("mech", "passive", 1e-9), ("hyd", "passive", 1e-6)],
)
def test_without_commands_and_leakage_the_arm_stands_for_a_minute(
    spec, arm, kind, other, drift
):
    log = step_log(arm.pose("study"), [0.0], dwell=60.0)
    everyone = scattered(arm, 3, leakage=0.0)
    response = simulation(spec, arm, log, range(7), kind, other_joints=other).simulate(
        everyone
    )
    assert np.isfinite(response.angle).all()
    # gravity's gradient is a spring that may be unstable; rounding must not have grown
    # to anything
    assert np.abs(response.angle - arm.pose("study")).max() < drift


def test_passive_arm_equals_a_plain_mujoco_loop(spec, arm, study_log):
    parameters = candidates(arm, 1)
    response = simulation(
        spec, arm, study_log, range(7), other_joints="passive"
    ).simulate(parameters)
    model = with_masses(arm, parameters.mass[0])
    model.dof_damping[:] = parameters.joints.damping[0]
    model.jnt_stiffness[:] = parameters.joints.stiffness[0]
    pose = study_log.angle[0]
    model.qpos_spring[:] = pose
    data = posed(model, pose)
    balance = data.qfrc_bias.copy()
    angle = [pose]
    for command in study_log.command[:-1]:
        data.qfrc_applied[:] = balance + parameters.joints.gain[0] * command
        mujoco.mj_step(model, data)
        angle.append(data.qpos.copy())
    assert np.ptp(np.array(angle)[:, 1]) > np.deg2rad(2)  # it moves
    np.testing.assert_allclose(response.angle[0], np.array(angle), atol=1e-9)


def test_locked_arm_converges_to_the_equation_of_motion(spec, arm, study_log):
    """Against Radau on I q'' = K u + tau0 - g(q) - D q' - S (q - q0), with first order
    in the step."""
    parameters = candidates(arm, 1)
    model = with_masses(arm, parameters.mass[0])
    pose = study_log.angle[0]
    mass_matrix = np.empty((7, 7))

    def gravity_and_inertia(q: float) -> tuple[float, float]:
        data = posed(model, np.where(np.arange(7) == 1, q, pose))
        mujoco.mj_fullM(model, data, mass_matrix)
        return data.qfrc_bias[1], mass_matrix[1, 1]

    balance, _ = gravity_and_inertia(pose[1])
    gain, damping, stiffness = (
        parameters.joints[name][0, 1] for name in ("gain", "damping", "stiffness")
    )

    def motion(t, y, u):
        bias, inertia = gravity_and_inertia(y[0])
        torque = (
            gain * u + balance - bias - damping * y[1] - stiffness * (y[0] - pose[1])
        )
        return [y[1], torque / inertia]

    state, reference = [pose[1], 0.0], [pose[1]]
    for k in range(5):  # one interval of constant command after the other
        u = study_log.command[100 * k, 1]
        times = np.linspace(0, 1, 101)
        solution = solve_ivp(
            motion, (0, 1), state, "Radau", times, args=(u,), rtol=1e-10, atol=1e-12
        )
        reference.extend(solution.y[0, 1:])
        state = solution.y[:, -1]
    errors = []
    for steps in (1, 2, 4, 8):
        angle = (
            simulation(spec, arm, study_log, steps_per_sample=steps)
            .simulate(parameters)
            .angle[0, :, 0]
        )
        errors.append(np.abs(angle - reference[:-1]).max())
    assert errors[0] < np.deg2rad(0.1)
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 1.0, atol=0.1)


@pytest.mark.parametrize("other", ["locked", "passive"])
def test_a_common_factor_of_all_forces_and_masses_changes_nothing(
    spec, arm, study_log, other
):
    one = candidates(arm, 3)
    forces = {
        name: 1.7 * one.joints[name]
        for name in ("gain", "damping", "stiffness", "friction")
    }
    scaled = Candidates(replaced(one, **forces).joints, 1.7 * one.mass)
    run = simulation(spec, arm, study_log, other_joints=other).simulate
    np.testing.assert_allclose(run(scaled).angle, run(one).angle, atol=1e-9)


def test_prescribed_joints_give_the_shoulder_the_motion_they_had(spec, arm):
    """Move every joint, then prescribe all but the shoulder: it must move as it did,
    coupling included."""
    log = step_log(arm.pose("study"), [60.0, -80.0, 30.0, 0.0, -40.0])
    command = log.command.copy()
    command[:, 2] = -command[:, 1]
    command[:, 3] = 0.5 * command[:, 1]
    moved = replace(log, command=command)
    parameters = candidates(arm, 1)
    free = (
        simulation(spec, arm, moved, range(7), other_joints="passive")
        .simulate(parameters)
        .angle[0]
    )
    assert np.ptp(free[:, 2]) > np.deg2rad(2)
    only_shoulder = replace(log, angle=free)  # its commands drive the shoulder alone
    errors = []
    for steps in (1, 8):
        settings = {"measured_cutoff_hz": 50.0, "steps_per_sample": steps}
        run = simulation(spec, arm, only_shoulder, other_joints="measured", **settings)
        errors.append(
            np.abs(run.simulate(parameters).angle[0, :, 0] - free[:, 1]).max()
        )
    locked = simulation(spec, arm, only_shoulder).simulate(parameters).angle[0, :, 0]
    assert errors[0] < 0.02 * np.abs(locked - free[:, 1]).max()
    assert errors[0] < np.deg2rad(0.01)


def test_dry_friction_holds_the_arm_against_small_commands(spec, arm):
    log = step_log(arm.pose("study"), [20.0, 20.0, 20.0])
    parameters = candidates(arm, 1)
    torque = 20.0 * parameters.joints.gain[0, 1]
    holding = replaced(parameters, friction=3 * torque)
    run = simulation(spec, arm, log).simulate
    moved = np.ptp(run(parameters).angle)
    assert np.ptp(run(holding).angle) < 0.05 * moved


@pytest.mark.parametrize("other", ["locked", "passive"])
def test_candidates_at_their_stops_or_diverging_change_no_bit_of_others(
    spec, arm, study_log, other
):
    some = candidates(arm, 8)
    gain, friction = some.joints["gain"], some.joints["friction"]
    gain[2:6] *= 40.0
    friction[4:] = 30.0
    gain[7] = 1e12
    run = simulation(spec, arm, study_log, other_joints=other).simulate
    together = run(some)
    assert np.isfinite(together.angle).all(axis=(1, 2)).tolist() == [True] * 7 + [False]
    beyond = (together.angle > arm.upper[1]) | (together.angle < arm.lower[1])
    assert beyond.any(axis=(1, 2)).sum() > 1
    alone = [run(some[k : k + 1]).angle for k in range(8)]
    np.testing.assert_array_equal(together.angle, np.concatenate(alone))


@pytest.mark.parametrize("stage", ["mech", "hyd"])
def test_threads_may_simulate_the_same_log_at_once(spec, arm, study_log, stage):
    """As those of a cluster's worker do."""
    run = simulation(spec, arm, study_log, kind=stage, threads=1).simulate
    some = candidates(arm, 6)
    some.mass[:] *= np.linspace(0.9, 1.1, 6)[:, None]
    parts = [some[k : k + 1] for k in range(6)] * 3
    alone = [run(part).angle for part in parts]
    assert np.isfinite(alone).all()
    with ThreadPoolExecutor(4) as pool:
        at_once = [response.angle for response in pool.map(run, parts)]
    np.testing.assert_array_equal(at_once, alone)


def test_passive_joints_that_hardly_move_leave_the_shoulder_as_locked_ones(
    spec, arm, study_log
):
    everyone, shoulder = scattered(arm, 2), np.arange(7) == 1
    held = {"stiffness": 1e5, "damping": 1e4}
    stiff = {
        k: np.where(shoulder, everyone.joints[k], value) for k, value in held.items()
    }
    others = ("locked", "passive")
    locked, passive = (
        simulation(spec, arm, study_log, kind="hyd", other_joints=o) for o in others
    )
    found = passive.simulate(replaced(everyone, **stiff)).angle
    np.testing.assert_allclose(
        found, locked.simulate(everyone).angle, atol=np.deg2rad(0.1)
    )


TIME = 0.01 * np.arange(300)
REST = np.zeros(1)
"""speed before the start [rad/s]"""


def sensors(scale: float, lag: float) -> np.ndarray:
    return np.array([(scale, lag)], [("sensor_scale", float), ("sensor_lag", float)])


def test_a_plain_sensor_reads_the_angle_to_the_bit():
    angle = np.random.default_rng(0).normal(size=(50, 1))
    assert reading(angle, sensors(1.0, 0.0), 0.01, REST) is angle


def test_a_lagging_sensor_follows_a_ramp_late():
    angle = 0.3 + 0.2 * TIME[:, None]
    seen = reading(angle, sensors(1.0, 0.15), 0.01, REST)[:, 0]
    np.testing.assert_allclose(
        seen, 0.3 + 0.2 * (TIME - 0.15 * (1 - np.exp(-TIME / 0.15))), atol=1e-12
    )


def test_a_lagging_sensor_of_a_joint_in_motion_reads_on():
    """It is late by the same angle from the start on."""
    angle = 0.3 + 0.2 * TIME[:, None]
    seen = reading(angle, sensors(1.1, 0.15), 0.01, np.array([0.2]))[:, 0]
    np.testing.assert_allclose(seen, 0.3 + 1.1 * 0.2 * TIME, atol=1e-12)


def test_a_scale_acts_on_the_turn_since_the_start():
    angle = 0.3 + 0.2 * np.sin(TIME)[:, None]
    np.testing.assert_allclose(
        reading(angle, sensors(1.1, 0.0), 0.01, REST), 0.3 + 1.1 * (angle - 0.3)
    )


@pytest.mark.slow
def test_compiling_is_announced_only_where_the_cache_is_empty(tmp_path):
    """The message follows numba's cache, not the time that reading it takes."""
    program = (
        "from hydroid.simulation.rollout import compile_rollout; compile_rollout()"
    )
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", program]
    runs = [
        subprocess.run(command, env=environment, capture_output=True, text=True)
        for _ in range(2)
    ]
    said = [run.stderr for run in runs]
    assert said[0].count("compiling the simulation") == 1
    assert said[1] == ""


@pytest.fixture
def stopping(spec, arm, study_log, monkeypatch):
    """A simulation that is stopped when its first candidate begins, and the moments at
    which it began one."""
    stopped = simulation(spec, arm, study_log, range(7), threads=2)
    begun = list[float]()
    write = stopped._write

    def write_and_stop(*given):
        begun.append(time.monotonic())
        if len(begun) == 1:
            os.kill(os.getpid(), signal.SIGINT)
        write(*given)

    monkeypatch.setattr(stopped, "_write", write_and_stop)
    before = signal.getsignal(signal.SIGINT)
    yield stopped, begun
    signal.signal(signal.SIGINT, before)


def test_a_stop_is_raised_when_no_thread_is_left(arm, stopping):
    """Else Python may leave a lock locked for which a thread waits forever."""
    stopped, begun = stopping
    signal.signal(signal.SIGINT, signal.default_int_handler)
    threads = threading.active_count()
    with pytest.raises(KeyboardInterrupt):
        stopped.simulate(candidates(arm, 20))
    assert threading.active_count() == threads
    assert len(begun) < 20


def test_a_stop_that_is_ignored_changes_nothing(spec, arm, study_log, stopping):
    stopped, _ = stopping
    signal.signal(signal.SIGINT, lambda *_: None)
    parameters = candidates(arm, 20)
    whole = simulation(spec, arm, study_log, range(7)).simulate(parameters)
    np.testing.assert_array_equal(stopped.simulate(parameters).angle, whole.angle)
