"""Where a cylinder is fixed: one that extends towards negative angles, and pivots that are estimated."""

import numpy as np
import pytest
from recovery import assert_recovered, duties, recover, settings_of
from scipy.spatial.transform import Rotation

from hydroid.arm.build import pivots
from hydroid.hydraulics.actuator import Actuator
from hydroid.hydraulics.records import linkages, nominal_parameters, with_values
from hydroid.settings.arm import Arm, Joint
from hydroid.settings.hydraulics import HydraulicSettings

SETTINGS = HydraulicSettings()
SHOULDER = 1


def mirrored(joint: Joint) -> Joint:
    """The same joint with its angle counted the other way round: its cylinder extends to negative angles."""
    low, high = joint.range
    actuator = joint.actuator.model_copy(update={"extends": "negative"})
    values = joint.model_dump() | {"range": (-high, -low), "actuator": actuator.model_dump()}
    return Joint.model_validate(values)


def motion(arm: Arm, command: np.ndarray, start: float) -> np.ndarray:
    """Angles [rad], (T,), of the shoulder's cylinder on a lone wheel."""
    nominal = nominal_parameters(arm, SETTINGS, [SHOULDER])
    moved = linkages(arm, [SHOULDER], [SHOULDER])
    actuator = Actuator(nominal, moved, 50.0, 0.01, SETTINGS)
    angle, velocity, inertia = np.full((1, 1), start), np.zeros((1, 1)), 20.0
    state, mass = actuator.start(angle, np.zeros((1, 1))), np.full((1, 1), inertia)
    out = []
    for u in command:
        torque, armature = actuator.advance(state, [u], angle, velocity, mass)
        mass = inertia + armature
        velocity = velocity + 0.01 * torque / mass
        angle = actuator.close(state, velocity, mass)
        out.append(angle[0, 0])
    return np.array(out)


def test_a_cylinder_that_extends_to_negative_angles_mirrors_the_motion(arm: Arm):
    joints = list(arm.joints)
    joints[SHOULDER] = mirrored(joints[SHOULDER])
    other = arm.model_copy(update={"joints": tuple(joints)})
    command = np.repeat([60.0, -80.0, 40.0, 0.0, 100.0], 60)
    here, there = motion(arm, command, 0.3), motion(other, command, -0.3)
    assert np.ptp(here) > 0.2
    assert here[30] > here[0]
    np.testing.assert_allclose(there, -here, atol=1e-12)


@pytest.mark.parametrize("angle", [-20.0, 15.0, 25.0])
def test_its_pivots_are_as_far_apart_as_it_is_long(arm: Arm, angle: float):
    joint = mirrored(arm.joints[SHOULDER])
    on_parent, on_child = pivots(joint, joint.actuator)
    turn = Rotation.from_rotvec(np.radians(angle) * np.array(joint.axis))
    ends = on_parent - joint.at, turn.apply(on_child)
    assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(joint.actuator.length(np.radians(angle)))
    step = 1e-6
    before, after = joint.actuator.length(np.radians(angle) + np.array([-step, step]))
    assert joint.actuator.moment_arm(np.radians(angle)) == pytest.approx((after - before) / (2 * step))
    assert after < before


def test_a_range_through_the_dead_centre_is_refused(arm: Arm):
    values = mirrored(arm.joints[SHOULDER]).model_dump() | {"range": (-30, 90)}
    with pytest.raises(ValueError, match="theta0 - range runs from -20 to 100 deg"):
        Joint.model_validate(values)


def test_pivots_of_parameters_take_the_place_of_the_arms(arm: Arm):
    p = nominal_parameters(arm, SETTINGS, [SHOULDER], 2)
    own = linkages(arm, [SHOULDER], [SHOULDER])
    moved = linkages(arm, [SHOULDER], [SHOULDER], with_values(p, {"pivot_distance_2": [[0.08], [0.1]]}))
    assert moved[0, 0] == own[0, 0]
    assert moved.b[1, 0] == 0.1
    assert moved.shortest[1, 0] < own.shortest[0, 0]


def test_pivots_are_recovered():
    """With known areas the speed at each angle tells the moment arm."""
    truth = {"b": 0.075, "theta0": 78.0}
    parameters = {
        "b": {"quantity": "pivot_distance_2", "joints": [2], "bounds": [0.05, 0.12]},
        "theta0": {"quantity": "pivot_angle", "joints": [2], "bounds": [45.0, 85.0]},
    }
    settings = settings_of(parameters)
    log = duties(settings.arm.pose("study"), {2: [60, 60, -70, -70, 40, -50, -90, 80]})
    assert_recovered(recover(settings, [log], truth, {"b": 0.08, "theta0": 70.0}), settings, truth)
