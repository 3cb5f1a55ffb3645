"""Where a cylinder is fixed: one that extends towards negative angles, and pivots that are estimated."""

import numpy as np
import pytest
from hydraulic_arm import lone_wheel
from recovery import assert_recovered, duties, recover, settings_of
from scipy.spatial.transform import Rotation

from hydroid.arm.build import pivots
from hydroid.hydraulics.actuator import Actuator
from hydroid.hydraulics.records import linkages, nominal_parameters, with_values
from hydroid.settings.arm import Arm, Joint
from hydroid.settings.hydraulics import HydraulicSettings
from hydroid.settings.linkage import four_bar

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
    return lone_wheel(actuator, command, 20.0, start)


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


BARS = {"ground": 0.35, "rocker": 0.45, "coupler": 0.4, "child": 0.35, "phase_deg": 69.0, "side": "right"}
"""a bucket's linkage; ours"""


def bucket(joint: Joint) -> Joint:
    """The shoulder moved by a four-bar linkage."""
    changes = {"four_bar": BARS, "a": 0.8, "b": 0.45, "theta0": 10.0, "stroke": 560.0}
    return Joint.model_validate(joint.model_dump() | {"actuator": joint.actuator.model_dump() | changes})


def test_the_coupler_of_a_four_bar_linkage_keeps_its_length(arm: Arm):
    actuator = bucket(arm.joints[SHOULDER]).actuator
    bars = actuator.four_bar
    q = np.radians(np.linspace(-30, 90, 25))
    psi, first, second = four_bar(q, bars)
    pin = bars.ground + bars.rocker * np.exp(1j * psi)
    child = bars.child * np.exp(1j * (q + bars.phase))
    np.testing.assert_allclose(abs(pin - child), bars.coupler, rtol=1e-12)
    ahead, behind = four_bar(q + 1e-6, bars), four_bar(q - 1e-6, bars)
    np.testing.assert_allclose(first, (np.unwrap(ahead[0]) - np.unwrap(behind[0])) / 2e-6, rtol=1e-6)
    np.testing.assert_allclose(second, (ahead[1] - behind[1]) / 2e-6, rtol=1e-4, atol=1e-7)
    arms = (actuator.length(q + 1e-6) - actuator.length(q - 1e-6)) / 2e-6
    np.testing.assert_allclose(actuator.moment_arm(q), arms, rtol=1e-6)


def test_a_bucket_turns_by_flow_over_area_and_moment_arm(arm: Arm):
    joints = list(arm.joints)
    joints[SHOULDER] = bucket(joints[SHOULDER])
    other = arm.model_copy(update={"joints": tuple(joints)})
    angle = motion(other, np.full(150, 60.0), 0.0)
    length = joints[SHOULDER].actuator.length(angle)
    rod = np.diff(length)[60:] / 0.01
    plain = np.diff(arm.joints[SHOULDER].actuator.length(motion(arm, np.full(150, 60.0), 0.0)))[60:] / 0.01
    # without much load the rod's speed is that of the valve's flow, whatever it moves
    assert rod.mean() == pytest.approx(plain.mean(), rel=0.05)
    assert np.ptp(rod[-30:]) < 0.1 * rod.mean()  # the oil has rung out


def test_a_linkage_that_does_not_reach_is_refused(arm: Arm):
    joint = bucket(arm.joints[SHOULDER])
    values = joint.model_dump()
    values["actuator"]["four_bar"]["coupler"] = 0.05
    with pytest.raises(ValueError, match="does not reach all of its range or has a dead centre"):
        Joint.model_validate(values)


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
