"""The steady speed in a pose against motions that have settled, of both models, and its
laws."""

import numpy as np
import pytest
from conftest import candidates
from made_logs import at_rest

from hydroid.rungs import DYNAMIC, QUASI_STATIC, RUNGS
from hydroid.settings.problem import SimulationSettings
from hydroid.simulation import Simulation
from hydroid.simulation.lone import steady_velocity
from hydroid.simulation.rollout import SteppedArm
from hydroid.simulation.scenario import Scenario
from hydroid.simulation.steady import NEAR

SHOULDER, ROLL = 1, 3
"""a cylinder that lifts the arm, and a rotary actuator, 0-based"""
PUMP = {"pump_flow": 2e-5, "pump_droop": 60e5}


@pytest.fixture
def both(spec, arm):
    """The speed of a settled motion [rad/s], and the steady one in the pose that the
    joint then passes."""

    def compare(joint, command, model, seconds=1.5, back=0.0, **values):
        pose = arm.pose("study")
        pose[joint] -= back
        commands = np.zeros((round(seconds / 0.01) + 1, len(arm.joints)))
        commands[:, joint] = command
        one = candidates(arm, 1)
        one.mass[:], one.joints.stiffness[:] = arm.masses, 0.0
        for name, value in values.items():
            (one.mass if name == "mass" else one.joints[name])[:] = value
        log = at_rest(pose, commands)
        stepping = RUNGS[model].stepping(1, 10)
        scenario = Scenario(spec, arm, log, [joint], SimulationSettings(), stepping)
        angle = Simulation(scenario).simulate(one).angle[0, :, 0]
        settled = (angle[-1] - angle[-3]) / 0.02
        stepped = SteppedArm(scenario.arm.model)
        values = scenario.values(one)
        poses = angle[-2] + NEAR * np.array([[-1.0], [0.0], [1.0]])
        load = np.array([[stepped.start(values, [0], near)[0] for near in poses]])
        args = one.joints[:, joint], float(angle[-2]), load, np.array([command])
        return settled, float(steady_velocity(*args, RUNGS[model])[0, 0])

    return compare


@pytest.mark.parametrize("model", ["dynamic", "quasi-static"])
@pytest.mark.parametrize("command", [60.0, -60.0])
@pytest.mark.parametrize(
    "values",
    [
        {},
        {"dry_friction": 800.0, "compensation": 0.7},
        {"friction": 30.0, "damping": 400.0},
        {"flow_limit": 8e-6, "return_a": 2.5},
        PUMP,
        PUMP | {"draw_a": 0.5, "return_b": 0.6},
        PUMP | {"pump_limit": 15e5},
        PUMP | {"pump_exponent": 4.0},
        PUMP | {"pump_exponent": 40.0},
        PUMP | {"pump_bypass": 0.7},
        {
            "overlap_a": 0.3e-3,
            "overlap_b": 0.2e-3,
            "opening_exponent_a": 1.6,
            "curve_3_b": 0.5,
            "curve_2_a": 3.0,
        },
        {"mass": 0.1, "dead_band_a": 20.0, "dead_band_b": 25.0, "pilot_lag_a": 0.05},
    ],
)
def test_it_is_the_speed_of_a_motion_that_has_settled(both, values, model, command):
    back = np.radians(4.0) * np.sign(command)
    slow = {"opening_a": 1e-7, "opening_b": 1e-7, "stiffness": 30.0}
    settled, steady = both(SHOULDER, command, model, back=back, **(slow | values))
    assert np.sign(steady) == np.sign(command)
    assert steady == pytest.approx(settled, rel=0.004)


@pytest.mark.parametrize("command", [0.0, 8.0, 60.0])
@pytest.mark.parametrize(
    "values",
    [
        {"leakage": 3e-8},
        {"leakage": 1e-8, "anticavitation": 2e-6},
        PUMP | {"leakage": 1e-8},
    ],
)
def test_leaking_edges_let_the_dynamic_model_sag(both, command, values):
    slow = {"opening_a": 1e-7, "opening_b": 1e-7, "bulk_modulus": 8e9}
    settled, steady = both(SHOULDER, command, "dynamic", **(slow | values))
    assert steady == pytest.approx(settled, rel=0.02, abs=1e-5)
    if command == 0.0:
        assert steady < 0.0


@pytest.mark.parametrize("model", ["dynamic", "quasi-static"])
def test_a_rotary_actuator_turns_steadily_too(both, model):
    values = {"lever_slope": 0.3, "lever_bend": -0.2, "damping": 0.0}
    settled, steady = both(ROLL, -40.0, model, seconds=0.6, **values)
    assert steady == pytest.approx(settled, rel=0.01)


@pytest.fixture
def shoulder(arm):
    """Steady velocities [rad/s] of the shoulder in a pose, (n, m), under loads [N·m],
    (n,)."""

    def velocity(load, commands, rung=DYNAMIC, **values):
        one = candidates(arm, len(load))
        one.joints.stiffness[:] = 0.0
        for name, value in values.items():
            one.joints[name][:] = value
        loads = np.repeat(np.array(load)[:, None], 3, axis=1)  # the same on the way
        joint = one.joints[:, SHOULDER]
        return steady_velocity(joint, 0.2, loads, np.array(commands), rung)

    return velocity


@pytest.mark.parametrize("pump", [{}, PUMP])
def test_without_leakage_the_models_have_one_law(shoulder, pump):
    values = {
        "leakage": 0.0,
        "transition_pressure": 1.0,
        "bulk_modulus": 1e15,
        "friction": 20.0,
        "damping": 300.0,
    } | pump
    load, commands = (
        np.linspace(-400.0, 600.0, 11),
        [-100.0, -40.0, -5.0, 5.0, 40.0, 100.0],
    )
    dynamic, quasi = (
        shoulder(load, commands, rung, **values) for rung in (DYNAMIC, QUASI_STATIC)
    )
    np.testing.assert_allclose(dynamic, quasi, rtol=1e-4, atol=1e-9)


def test_a_load_within_the_joints_friction_stands(shoulder):
    values = {"leakage": 1e-8, "friction": 50.0}
    (free, held) = shoulder(
        [0.0, 0.0], [0.0], leakage=1e-8, friction=np.array([[0.0], [1e9]])
    )[:, 0]
    assert free != 0.0
    assert held == 0.0
    speeds = shoulder(np.linspace(-2000.0, 2000.0, 201), [0.0], **values)[:, 0]
    assert np.all(np.diff(speeds) <= 0.0)
    assert (speeds == 0.0).sum() >= 4  # 100 N·m wide


def test_an_infeasible_coil_has_no_speed(shoulder):
    found = shoulder([100.0, 100.0], [50.0], force_2=np.array([[0.7], [100.0]]))
    assert np.isfinite(found).ravel().tolist() == [True, False]
