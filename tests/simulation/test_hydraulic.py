"""Stage 2 as the fit sees it: commands in, angles out, through the whole chain beside MuJoCo."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import candidates as arms
from conftest import replaced, step_log

from hydroid.settings.hydraulics import HydraulicSettings
from hydroid.settings.simulation import SimulationSettings
from hydroid.simulation import Candidates, Simulation
from hydroid.simulation.rollout import compile_rollout
from hydroid.simulation.scenario import Scenario

SHOULDER = [1]


def simulation(spec, arm, log, outputs=SHOULDER, **settings) -> Simulation:
    chosen = SimulationSettings(**settings)
    scenario = Scenario(spec, arm, log, list(outputs), chosen)
    return Simulation(scenario, arm, HydraulicSettings().substeps)


def candidates(arm, n: int, seed: int = 0, **hydraulics) -> Candidates:
    """Random arms with actuators whose areas, currents and calibration differ too."""
    rng = np.random.default_rng(seed)
    everyone = arms(arm, n, seed, HydraulicSettings(**hydraulics))
    for name in ("area_a", "area_b", "current_max", "onset_a", "onset_b", "force_1"):
        everyone.joints[name] *= rng.uniform(0.7, 1.4, (n, 1))
    return everyone


@pytest.fixture(scope="module")
def steps(arm):
    return step_log(arm.pose("study"), [60.0, -80.0, 0.0, 30.0, -40.0])


@pytest.mark.parametrize("other", ["locked", "passive", "measured"])
def test_threads_and_neighbours_change_no_bit(spec, arm, steps, other):
    everyone = candidates(arm, 7)
    together = simulation(spec, arm, steps, other_joints=other, threads=1).simulate(everyone).angle
    assert np.ptp(together, axis=1).min() > np.deg2rad(1)
    for settings in ({"threads": 2}, {"threads": 3}):
        again = simulation(spec, arm, steps, other_joints=other, **settings).simulate(everyone).angle
        np.testing.assert_array_equal(again, together)
    alone = simulation(spec, arm, steps, other_joints=other).simulate(everyone[slice(3, 4)]).angle
    np.testing.assert_array_equal(alone, together[3:4])


def test_with_shut_valves_and_no_leakage_the_arm_stands_for_a_minute(spec, arm):
    log = step_log(arm.pose("study"), [0.0], dwell=60.0)
    everyone = candidates(arm, 3, leakage=0.0)
    response = simulation(spec, arm, log, other_joints="passive").simulate(everyone)
    assert response.feasible.all()
    assert np.abs(response.angle[:, :, 0] - arm.pose("study")[1]).max() < 1e-6


def test_the_answer_converges_with_mujocos_step(spec, arm, steps):
    everyone = candidates(arm, 4)
    angle = [simulation(spec, arm, steps, steps_per_sample=s).simulate(everyone).angle for s in (1, 2, 4, 16)]
    errors = [np.abs(a - angle[-1]).max() for a in angle[:-1]]
    assert errors[0] < np.deg2rad(0.3)
    assert errors[2] < 0.5 * errors[0]


def test_passive_joints_that_hardly_move_leave_the_shoulder_as_locked_ones(spec, arm, steps):
    everyone = candidates(arm, 2)
    held = {"stiffness": 1e5, "damping": 1e4}
    stiff = {k: np.where(np.arange(7) == 1, everyone.joints[k], value) for k, value in held.items()}
    locked = simulation(spec, arm, steps).simulate(everyone).angle
    passive = simulation(spec, arm, steps, other_joints="passive").simulate(replaced(everyone, **stiff))
    np.testing.assert_allclose(passive.angle, locked, atol=np.deg2rad(0.1))


def test_only_products_that_the_chain_knows_matter(spec, arm, steps):
    """F1, F2, x1, x2 act through two numbers, and the currents' scale trades with them: null directions."""
    one = candidates(arm, 2)
    a = one.joints
    ratio = np.sqrt(a.force_1 / a.force_2)
    gap = (a.stroke_2 - ratio * a.stroke_1) / (ratio - 1)
    coil = a.force_1 * (a.stroke_1 + gap) ** 2
    x1, x2 = a.stroke_1 * 1.5, a.stroke_2 * 0.6
    along = {
        "stroke_1": x1,
        "stroke_2": x2,
        "current_max": a.current_max / 2,
        "current_min": a.current_min / 2,
    }
    along |= {"force_1": 4 * coil / (x1 + gap) ** 2, "force_2": 4 * coil / (x2 + gap) ** 2}
    run = simulation(spec, arm, steps).simulate
    np.testing.assert_allclose(run(replaced(one, **along)).angle, run(one).angle, atol=1e-9)


def test_a_set_without_a_force_curve_is_infeasible_and_harms_nobody(
    spec, arm, steps, capfd, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    everyone = candidates(arm, 3)
    run = simulation(spec, arm, steps).simulate
    healthy = run(everyone).angle
    capfd.readouterr()
    force = everyone.joints.force_2.copy()
    force[1] = 100.0  # the force would grow with the stroke
    response = run(replaced(everyone, force_2=force))
    np.testing.assert_array_equal(response.feasible, [True, False, True])
    np.testing.assert_array_equal(response.angle[[0, 2]], healthy[[0, 2]])
    assert np.isnan(response.angle[1]).all()
    assert capfd.readouterr() == ("", "")
    assert not Path("MUJOCO_LOG.TXT").exists()
    nobody = run(replaced(everyone, force_2=100.0))
    assert not nobody.feasible.any()


def test_the_trace_explains_the_motion(spec, arm, steps):
    """Oil into chamber A over its area is the rod's way; no pressure is below vapour."""
    one = candidates(arm, 1, leakage=0.0, bulk_modulus=8e5)
    run = simulation(spec, arm, steps)
    angle = run.simulate(one).angle[0, :, 0]
    trace = run.trace(one)
    assert list(run.joints) == [1]
    assert trace.pressure.shape == (len(steps.time), 1, 2)
    assert trace.pressure.min() >= 0
    cylinder = arm.joints[1].actuator
    way = cylinder.length(angle) - cylinder.length(angle[:1])
    oil = np.cumsum(trace.flow[:, 0, 0]) * steps.period / one.joints.area_a[0, 1]
    assert np.ptp(way) > 2e-3
    np.testing.assert_allclose(oil, way, atol=0.03 * np.ptp(way))


def test_a_diverging_member_is_marked_and_harms_nobody(spec, arm, steps, capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    everyone = candidates(arm, 3)
    run = simulation(spec, arm, steps, other_joints="passive", threads=1)
    healthy = run.simulate(everyone).angle
    stiffness = everyone.joints.stiffness.copy()
    stiffness[1, 4] = 1e9  # MuJoCo's spring is explicit in the angle: at 0.01 s it blows up
    capfd.readouterr()
    response = run.simulate(replaced(everyone, stiffness=stiffness))
    np.testing.assert_array_equal(response.feasible, [True, False, True])
    assert np.isnan(response.angle[1]).all()
    np.testing.assert_array_equal(response.angle[[0, 2]], healthy[[0, 2]])
    assert capfd.readouterr() == ("", "")
    assert not Path("MUJOCO_LOG.TXT").exists()


def test_reading_the_compiled_loop_from_the_cache_is_not_announced(caplog):
    compile_rollout()
    compile_rollout.cache_clear()
    compile_rollout()
    assert "compiling" not in caplog.text


@pytest.mark.slow
def test_compiling_is_announced_only_where_the_cache_is_empty(tmp_path):
    """The message follows numba's cache, not the time that reading it takes."""
    program = "from hydroid.simulation.rollout import compile_rollout; compile_rollout()"
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    said = [
        subprocess.run(
            [sys.executable, "-c", program], env=environment, capture_output=True, text=True
        ).stderr
        for _ in range(2)
    ]
    assert said[0].count("compiling the simulation") == 1
    assert said[1] == ""
