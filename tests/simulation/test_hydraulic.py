"""Stage 2 as the fit sees it: commands in, angles out, through the whole chain beside MuJoCo."""

import os
import subprocess
import sys

import numpy as np
import pytest
from conftest import candidates as arms
from conftest import replaced, step_log

from hydroid.settings.hydraulics import HydraulicSettings
from hydroid.settings.simulation import SimulationSettings
from hydroid.simulation import Candidates, Simulation
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


def test_passive_joints_that_hardly_move_leave_the_shoulder_as_locked_ones(spec, arm, steps):
    everyone = candidates(arm, 2)
    held = {"stiffness": 1e5, "damping": 1e4}
    stiff = {k: np.where(np.arange(7) == 1, everyone.joints[k], value) for k, value in held.items()}
    locked = simulation(spec, arm, steps).simulate(everyone).angle
    passive = simulation(spec, arm, steps, other_joints="passive").simulate(replaced(everyone, **stiff))
    np.testing.assert_allclose(passive.angle, locked, atol=np.deg2rad(0.1))


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
