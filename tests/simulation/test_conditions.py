"""Engine speed and oil temperature: speeds in proportion, a pump's flow, both models
alike, and the bits of old where there is nothing to it."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import candidates
from made_logs import at_rest

from hydroid.hydraulics.actuator import under_conditions
from hydroid.rungs import RUNGS
from hydroid.settings.problem import SimulationSettings
from hydroid.simulation import Simulation
from hydroid.simulation.scenario import Candidates, Scenario

SHOULDER, ROLL, WRIST = 1, 3, 5
"""a cylinder that lifts the arm, and two actuators that lift little, 0-based"""
MODELS = "quasi-static", "dynamic"
PUMP = {"pump_flow": 1e-5, "pump_droop": 60e5, "pump_exponent": 20.0}
IDEAL = {"damping": 0.0, "leakage": 1e-16, "dry_friction": 0.0}


@pytest.fixture
def simulated(spec, arm):
    """Simulate constant commands [%] of some joints, 0-based, under the conditions of
    each sample, (2,) or (T, 2); what they do, the last candidate's.

    With `plant`, the conditions are in the values of the joints.
    """

    def run(commands, conditions=None, model="quasi-static", plant=None, **values):
        seconds = 1.0
        command = np.zeros((round(seconds / 0.01) + 1, len(arm.joints)))
        for joint, value in commands.items():
            command[:, joint] = value
        log = at_rest(arm.pose("study"), command)
        if conditions is not None:
            held = np.broadcast_to(conditions, (len(command), 2))
            log = replace(log, conditions=held)
        one = candidates(arm, 1)
        one.mass[:], one.joints.stiffness[:] = arm.masses, 0.0
        for name, value in values.items():
            one.joints[name][:] = value
        if plant is not None:
            one = Candidates(under_conditions(one.joints, *plant), one.mass)
        scenario = Scenario(
            spec,
            arm,
            log,
            sorted(commands),
            SimulationSettings(),
            RUNGS[model].stepping(1, 10),
        )
        return Simulation(scenario, sorted(commands)).simulate(one)

    return run


def speeds(response):
    """Mean speeds at the end [rad/s]."""
    return np.diff(response.angle[0, -20:], axis=0).mean(axis=0) / 0.01


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(
    ("conditions", "values", "factor"),
    [
        ((2.0, 0.0), {"engine_exponent": 1.0}, 2.0),
        ((0.5, 0.0), {"engine_exponent": 0.5}, 0.5**0.5),
        ((1.0, 20.0), {"temperature_effect": 0.01}, np.exp(0.2)),
        ((1.0, -30.0), {"temperature_effect": 0.01}, np.exp(-0.3)),
        (
            (0.7, 10.0),
            {"engine_exponent": 1.0, "temperature_effect": 0.02},
            0.7 * np.exp(0.2),
        ),
        ((2.0, 30.0), {}, 1.0),
    ],
)
def test_speeds_without_a_pump_are_in_proportion(
    simulated, model, conditions, values, factor
):
    # as slow as a joint is whose oil does not matter
    machine = IDEAL | values | {"opening_a": 1e-7, "opening_b": 1e-7}
    at_reference = speeds(simulated({ROLL: 60}, model=model, **machine))
    there = speeds(simulated({ROLL: 60}, conditions, model, **machine))
    assert abs(at_reference[0]) > 0.01
    np.testing.assert_allclose(there, factor * at_reference, rtol=5e-3)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("engine", [0.5, 1.6])
def test_a_pump_at_its_limit_gives_a_flow_in_proportion_to_the_engine(
    simulated, model, engine
):
    # no load: a joint that sinks takes oil from the tank
    commands = {ROLL: -90, WRIST: 80}

    def drawn(conditions):
        response = simulated(
            commands, conditions, model, **IDEAL, **PUMP, line_volume=1e-7
        )
        into = np.maximum(response.flow[0, -20:], 0.0).sum(axis=(1, 2))
        return into.mean(), response.line[0, -1]

    usual, line = drawn(None)
    there, _ = drawn((engine, 0.0))
    assert line < 145e5  # it is at its limit
    assert usual == pytest.approx(PUMP["pump_flow"], rel=0.05)
    assert there == pytest.approx(engine * usual, rel=0.03)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("pump", [{}, PUMP | {"pump_bypass": 0.8, "pump_idle": 0.5}])
@pytest.mark.parametrize(
    "values",
    [{}, {"engine_exponent": 0.8, "temperature_effect": 0.02}],
)
def test_at_the_references_every_bit_is_as_without_the_columns(
    simulated, model, pump, values
):
    commands = {SHOULDER: 80, ROLL: -90}
    without = simulated(commands, model=model, **pump, **values)
    there = simulated(commands, (1.0, 0.0), model, **pump, **values)
    for name in ("angle", "pressure", "flow", "line"):
        np.testing.assert_array_equal(getattr(there, name), getattr(without, name))


@pytest.mark.parametrize("model", MODELS)
def test_what_has_no_effect_changes_no_bit(simulated, model):
    rng = np.random.default_rng(1)
    varied = np.column_stack([rng.uniform(0.4, 2.0, 101), rng.normal(0.0, 20.0, 101)])
    without = simulated({ROLL: 60}, model=model)
    there = simulated({ROLL: 60}, varied, model)
    np.testing.assert_array_equal(there.angle, without.angle)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("pump", [{}, PUMP | {"pump_bypass": 0.8, "pump_idle": 0.5}])
def test_constant_conditions_are_a_machine_of_other_numbers(simulated, model, pump):
    machine = pump | {"engine_exponent": 0.6, "temperature_effect": 0.01}
    commands, conditions = {SHOULDER: 80, ROLL: -90}, (0.6, 25.0)
    by_log = simulated(commands, conditions, model, **machine)
    as_plant = simulated(commands, None, model, plant=conditions, **machine)
    as_before = simulated(commands, None, model, **machine)
    assert np.abs(by_log.angle - as_before.angle).max() > 0.01
    np.testing.assert_allclose(by_log.angle, as_plant.angle, atol=1e-9)
    np.testing.assert_allclose(by_log.pressure, as_plant.pressure, rtol=1e-6, atol=1.0)


@pytest.mark.parametrize("engine", [0.5, 1.0, 1.8])
@pytest.mark.parametrize("pump", [{}, PUMP])
def test_both_models_agree_once_joints_move_steadily(simulated, engine, pump):
    machine = IDEAL | pump | {"engine_exponent": 0.5, "line_volume": 1e-7}
    slow = {"opening_a": 1e-7, "opening_b": 1e-7}
    machine |= {} if pump else slow
    commands = {SHOULDER: 80, ROLL: -90}
    quasi, full = (
        speeds(simulated(commands, (engine, 0.0), model, **machine)) for model in MODELS
    )
    np.testing.assert_allclose(full, quasi, rtol=0.02, atol=1e-3)


def test_what_changes_in_a_log_acts_when_it_does(simulated):
    """An engine that is throttled down half way: the joint slows there, not before."""
    varied = np.tile([1.0, 0.0], (101, 1))
    varied[50:, 0] = 0.5
    machine = IDEAL | {"engine_exponent": 1.0}
    usual = simulated({ROLL: 60}, **machine).angle[0, :, 0]
    there = simulated({ROLL: 60}, varied, **machine).angle[0, :, 0]
    np.testing.assert_array_equal(there[:51], usual[:51])
    np.testing.assert_allclose(
        np.diff(there[50:]), 0.5 * np.diff(usual)[50:], rtol=1e-3
    )
