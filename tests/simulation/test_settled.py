"""Settled speeds of joints that share a pump, and the commands for wished ones: laws of
both models."""

import numpy as np
import pytest
from conftest import candidates

from hydroid.hydraulics.actuator import make_plugin, swallowed
from hydroid.hydraulics.pump import delivery
from hydroid.hydraulics.records import coefficients
from hydroid.rungs import DYNAMIC, QUASI_STATIC
from hydroid.simulation.lone import steady_velocity
from hydroid.simulation.settled import settled_commands, settled_speeds

JOINTS = [1, 2, 3]
"""two cylinders and a rotary actuator, 0-based"""
PUMP = {"pump_flow": 3e-5, "pump_droop": 60e5}
SLOPING = {"pump_flow": 6e-4, "pump_droop": 250e5}
"""flow and pressure of the line then follow from each other"""
STRAIGHT = {
    "opening_a": 4e-7,
    "opening_b": 4e-7,
    "bulk_modulus": 1e15,
    "transition_pressure": 1.0,
    "leakage": 0.0,
}
LAWS = [
    STRAIGHT,
    STRAIGHT | SLOPING,
    STRAIGHT | {"compensation": 0.8, "dry_friction": 5.0},
    STRAIGHT
    | {
        "dead_band_a": 20.0,
        "dead_band_b": 25.0,
        "opening_exponent_a": 1.8,
        "friction": 20.0,
    },
    STRAIGHT | SLOPING | {"draw_a": 0.5, "return_b": 0.6, "damping": 300.0},
    STRAIGHT | SLOPING | {"pump_exponent": 3.0},
    STRAIGHT | SLOPING | {"pump_exponent": 50.0},
    STRAIGHT | SLOPING | {"pump_bypass": 0.7},
]
both_models = pytest.mark.parametrize(
    "rung", [DYNAMIC, QUASI_STATIC], ids=lambda rung: rung.name
)


def actuators(arm, **values):
    """The plugin of three joints, and the records of the joints, (1, 3)."""
    one = candidates(arm, 1)
    one.joints.stiffness[:] = 0.0
    for name, value in values.items():
        one.joints[name][:] = value
    joints = one.joints[:, JOINTS]
    return make_plugin(joints, np.zeros((3, 3), np.intp), 0.01, 1).candidate(0), joints


@pytest.fixture
def poses(arm):
    angle = (
        np.tile(arm.pose("study")[JOINTS], (20, 1))
        + np.linspace(-0.1, 0.1, 20)[:, None]
    )
    load = np.random.default_rng(0).uniform(-200.0, 400.0, (20, 3)) * [1.0, 0.5, 0.05]
    return angle, load


@both_models
@pytest.mark.parametrize("values", LAWS)
def test_commands_for_the_speeds_of_commands_are_these_commands(
    arm, poses, values, rung
):
    plugin, _ = actuators(arm, **values)
    angle, load = poses
    command = np.random.default_rng(1).uniform(30.0, 90.0, angle.shape)
    command *= np.where(np.arange(60).reshape(20, 3) % 2, -1.0, 1.0)
    speed = settled_speeds(plugin, angle, load, command, rung)
    assert np.abs(speed).min() > 0.0
    found, reached = settled_commands(plugin, angle, load, speed, rung)
    np.testing.assert_allclose(reached, speed, rtol=1e-5)
    np.testing.assert_allclose(found, command, rtol=1e-4)


@both_models
@pytest.mark.parametrize("values", LAWS[:1] + LAWS[2:4])
def test_without_a_pump_each_joint_is_alone(arm, poses, values, rung):
    plugin, joints = actuators(arm, **values)
    angle, load = poses
    command = np.tile([60.0, -45.0, 80.0], (20, 1))
    speed = settled_speeds(plugin, angle, load, command, rung)
    for k, j in np.ndindex(3, 3):
        loads = np.full((1, 3), load[k, j])
        alone = steady_velocity(
            joints[:, j],
            angle[k, j],
            loads,
            command[k, j : j + 1],
            rung,
        )
        assert speed[k, j] == pytest.approx(alone[0, 0], rel=1e-6)


@both_models
def test_the_pump_gives_what_joints_draw(arm, poses, rung):
    """Oil is conserved: at the line's pressure, which the flows imply, both are
    equal."""
    plugin, joints = actuators(arm, **STRAIGHT | PUMP | {"draw_b": 0.7})
    angle, load = poses
    command = np.tile([90.0, -80.0, 100.0], (20, 1))
    speed = settled_speeds(plugin, angle, load, command, rung)
    table = coefficients(joints)[0]
    drawn = np.array(
        [swallowed(table, one, v).sum() for one, v in zip(angle, speed, strict=True)]
    )
    free = settled_speeds(actuators(arm, **STRAIGHT)[0], angle, load, command, rung)
    wanted = np.array(
        [swallowed(table, one, v).sum() for one, v in zip(angle, free, strict=True)]
    )
    limit = delivery(0.0, 1.0, table[0])[0]
    assert (wanted > limit).all()
    assert (drawn <= limit * (1.0 + 1e-6)).all()
    assert (drawn > 0.5 * limit).all()
    assert (np.abs(speed) <= np.abs(free) * (1.0 + 1e-9)).all()


@both_models
def test_what_cannot_be_had_is_met_by_the_nearest(arm, poses, rung):
    plugin, _ = actuators(arm, **STRAIGHT)
    angle, load = poses
    for sign in (1.0, -1.0):
        wish = np.full(angle.shape, sign * 50.0)
        command, reached = settled_commands(plugin, angle, load, wish, rung)
        full = settled_speeds(plugin, angle, load, np.full(angle.shape, 100.0), rung)
        other = settled_speeds(plugin, angle, load, np.full(angle.shape, -100.0), rung)
        assert (np.abs(command) == 100.0).all()
        fastest = np.maximum(full, other) if sign > 0 else np.minimum(full, other)
        np.testing.assert_allclose(reached, fastest, rtol=1e-9)


@both_models
def test_a_valve_that_opens_with_a_jump_has_a_slowest_speed(arm, poses, rung):
    """Below half of it the nearest is to stand, above it is that speed."""
    plugin, _ = actuators(arm, **STRAIGHT | {"onset_a": 4.0, "onset_b": 4.0})
    angle, load = poses
    least = settled_speeds(plugin, angle, load, np.full(angle.shape, 1e-6), rung)
    assert np.abs(least).min() > 1e-4
    for part, wanted in ((0.4, 0.0), (0.6, 1.0)):
        _, reached = settled_commands(plugin, angle, load, part * least, rung)
        np.testing.assert_allclose(reached, wanted * least, rtol=1e-4)


@both_models
def test_no_wish_needs_no_command(arm, poses, rung):
    plugin, _ = actuators(arm, **STRAIGHT | PUMP)
    command, reached = settled_commands(plugin, *poses, np.zeros((20, 3)), rung)
    assert not command.any()
    assert not reached.any()
