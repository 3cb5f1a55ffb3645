"""A log that begins in motion goes on as the whole recording does."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import candidates
from made_logs import at_rest

from hydroid.fitting.baselines import Baseline
from hydroid.log import Log
from hydroid.rungs import RUNGS
from hydroid.settings.problem import SimulationSettings
from hydroid.simulation import Simulation
from hydroid.simulation.scenario import Scenario

SHOULDER, ROLL = 1, 3
"""a cylinder that lifts the arm, and a rotary actuator, 0-based"""
PERIOD = 0.01
LAGS = {"delay_a": 0.1, "delay_b": 0.1, "pilot_lag_a": 0.05, "opening_lag": 0.15}


@pytest.fixture
def simulate(spec, arm):
    """Simulate a log by a model, with a lag of the opening or of the speed; angles of
    two joints [rad], (T, 2)."""

    def run(log, model, **values):
        one = candidates(arm, 1)
        one.mass[:], one.joints.stiffness[:] = arm.masses, 0.0
        for name, value in values.items():
            one.joints[name][:] = value
        stepping = RUNGS[model].stepping(1, 10)
        outputs = [SHOULDER, ROLL]
        scenario = Scenario(spec, arm, log, outputs, SimulationSettings(), stepping)
        return Simulation(scenario).simulate(one).angle[0]

    return run


def recording(arm, simulate, model, **values):
    """Half a second of rest, and then two commands that are held."""
    command = np.zeros((300, len(arm.joints)))
    command[50:, SHOULDER], command[50:, ROLL] = 35.0, -40.0
    log = at_rest(arm.pose("study"), command, PERIOD)
    angle = log.angle.copy()
    angle[:, [SHOULDER, ROLL]] = simulate(log, model, **values)
    return replace(log, angle=angle, speed=np.zeros(len(arm.joints)))


@pytest.mark.parametrize(
    ("model", "more"),
    [
        ("quasi-static", {}),
        ("quasi-static", {"lag_of_speed": 1.0}),
        ("quasi-static", {"oil_frequency": 12.0, "oil_damping": 0.3}),
        ("quasi-static", {"sensor_lag": 0.2}),
        (
            "quasi-static",
            {
                "pump_flow": 4e-5,
                "pump_droop": 60e5,
                "pump_idle": 0.2,
                "pump_delay": 0.3,
            },
        ),
        ("dynamic", {}),
        ("dynamic", {"lag_of_speed": 1.0}),
    ],
)
def test_a_part_goes_on_as_the_whole_does(model, more, arm, simulate):
    values = LAGS | more
    whole = recording(arm, simulate, model, **values)
    part = whole.part(200, 300)
    true = whole.angle[200:, [SHOULDER, ROLL]]
    way = np.abs(true[-1] - true[0])
    assert np.all(way > 0.01)
    found = simulate(part, model, **values)
    # the pressures of the dynamic model begin at rest, and take a moment to settle
    most = 0.06 if model == "dynamic" else 0.02
    assert np.all(np.abs(found - true).max(axis=0) < most * way)
    # as if it began at rest, it comes too late
    late = simulate(replace(part, speed=None), model, **values)
    assert np.all(np.abs(late - true).max(axis=0) > 0.1 * way)


def test_a_log_that_begins_at_rest_is_no_motion(arm, simulate):
    whole = recording(arm, simulate, "quasi-static", **LAGS)
    assert not whole.start_speed.any()
    # with a command from the first sample on, which has not moved anything yet
    assert not whole.part(50, 300).start_speed.any()
    moving = whole.part(200, 300).start_speed
    steady = np.gradient(whole.angle, PERIOD, axis=0)[250]
    assert moving[[SHOULDER, ROLL]] == pytest.approx(steady[[SHOULDER, ROLL]], rel=0.05)


@pytest.mark.parametrize(
    ("period", "late"),
    [(0.005, 0.05), (0.01, 0.05), (0.01, 0.1), (0.05, 0.1), (0.1, 0.3), (0.01, 0.3)],
)
def test_a_joint_that_begins_to_move_is_not_in_motion(period, late):
    """Noise is none either."""
    time = np.arange(0, 3, period)
    command = np.full((len(time), 1), 30.0)
    found = list[bool]()
    for seed in range(100):
        noise = 1e-3 * np.random.default_rng(seed).normal(size=len(time))
        angle = 0.3 * np.maximum(time - late, 0.0) + noise
        log = Log("a", time, command, angle[:, None], period)
        found.append(bool(log.speed_at_first.any()))
    assert np.mean(found) <= 0.02


def test_a_prefix_starts_as_the_whole_and_a_part_as_it_moves(arm, simulate):
    whole = recording(arm, simulate, "quasi-static", **LAGS)
    moving = whole.part(200, 300)
    assert np.array_equal(moving.first(0.1).start_speed, moving.start_speed)
    later = moving.part(30, 100)
    assert later.start_speed[ROLL] == pytest.approx(moving.start_speed[ROLL], rel=0.05)
    assert not replace(moving, speed=None).part(30, 100).start_speed.any()


def test_simple_models_begin_in_motion_too(arm, simulate):
    whole = recording(arm, simulate, "quasi-static", **LAGS)
    speed = np.gradient(whole.angle[:, SHOULDER], PERIOD)[250]
    numbers = np.array([[0.0] * 2, [1.0] * 2, [speed / 0.35] * 2, [0.15] * 2])
    limits = np.array([-np.inf, np.inf])
    model = Baseline(SHOULDER + 1, limits, delay=0.1, numbers=numbers)
    part = whole.part(200, 300)
    error = model.errors([part])
    assert np.abs(error).max() < 0.02 * np.ptp(part.angle[:, SHOULDER])
