"""Where a cylinder is fixed: one that extends towards negative angles, and pivots that
are estimated."""

from dataclasses import replace

import numpy as np
import pytest
from arms import FOUR_BAR
from hydraulic_reference import changed, simulate, wheel

from hydroid.hydraulics.records import Records, nominal_joints
from hydroid.settings.arm import Arm
from hydroid.settings.cylinder import make_cylinder
from hydroid.settings.hydraulics import HydraulicSettings
from hydroid.settings.linkage import FourBar, Triangle, four_bar

SETTINGS = HydraulicSettings()
SHOULDER = 1


def with_cylinder(arm: Arm, **changes) -> Arm:
    """The arm with other settings of the shoulder's cylinder; its triangle is given,
    not its pivots."""
    joint = arm.joints[SHOULDER]
    cylinder, limits = joint.actuator, changes.pop("range", joint.range)
    changes = {"triangle": cylinder.triangle, "stroke": cylinder.stroke} | changes
    settings = cylinder.settings.model_copy(update=changes)
    moved = replace(
        joint, range=limits, actuator=make_cylinder(settings, np.radians(limits))
    )
    other = arm.model_copy()
    vars(other)["joints"] = (*arm.joints[:SHOULDER], moved, *arm.joints[SHOULDER + 1 :])
    return other


def mirrored(arm: Arm) -> Arm:
    """The same with the shoulder's angle counted the other way: its cylinder extends to
    negative angles."""
    low, high = arm.joints[SHOULDER].range
    sides = arm.joints[SHOULDER].actuator.triangle
    triangle = sides.model_copy(update={"theta0": -sides.theta0})
    return with_cylinder(arm, triangle=triangle, range=(-high, -low))


def shoulder(arm: Arm, **values: float) -> Records:
    return changed(
        nominal_joints(arm, SETTINGS)[None, [SHOULDER]].view(np.recarray), **values
    )


def motion(arm: Arm, command: np.ndarray, start: float) -> np.ndarray:
    """Angles [rad], (T + 1,), of the shoulder's cylinder on a lone wheel."""
    return simulate(
        shoulder(arm, damping=50.0), command, SETTINGS, start=start, model=wheel(20.0)
    )[0]


def test_a_cylinder_that_extends_to_negative_angles_mirrors_the_motion(arm: Arm):
    other = mirrored(arm)
    command = np.repeat([60.0, -80.0, 40.0, 0.0, 100.0], 60)
    here, there = motion(arm, command, 0.3), motion(other, command, -0.3)
    assert np.ptp(here) > 0.2
    assert here[30] > here[0]
    np.testing.assert_allclose(there, -here, atol=1e-12)


def bucket(arm: Arm, **bars: float) -> Arm:
    sides = Triangle(a=0.8, b=0.45, theta0=10.0)
    return with_cylinder(
        arm,
        triangle=sides,
        four_bar=FourBar.model_validate(FOUR_BAR | bars),
        stroke=560.0,
    )


def test_the_coupler_of_a_four_bar_linkage_keeps_its_length(arm: Arm):
    actuator = bucket(arm).joints[SHOULDER].actuator
    bars = actuator.settings.four_bar
    q = np.radians(np.linspace(-30, 90, 25))
    psi, first, second = four_bar(q, bars)
    pin = bars.ground + bars.rocker * np.exp(1j * psi)
    child = bars.child * np.exp(1j * (q + bars.phase))
    np.testing.assert_allclose(abs(pin - child), bars.coupler, rtol=1e-12)
    ahead, behind = four_bar(q + 1e-6, bars), four_bar(q - 1e-6, bars)
    np.testing.assert_allclose(
        first, (np.unwrap(ahead[0]) - np.unwrap(behind[0])) / 2e-6, rtol=1e-6
    )
    np.testing.assert_allclose(
        second, (ahead[1] - behind[1]) / 2e-6, rtol=1e-4, atol=1e-7
    )
    arms = (actuator.length(q + 1e-6) - actuator.length(q - 1e-6)) / 2e-6
    np.testing.assert_allclose(actuator.moment_arm(q), arms, rtol=1e-6)


def test_a_bucket_turns_by_flow_over_area_and_moment_arm(arm: Arm):
    other = bucket(arm)
    angle = motion(other, np.full(150, 60.0), 0.0)
    length = other.joints[SHOULDER].actuator.length(angle)
    rod = np.diff(length)[60:] / 0.01
    plain = (
        np.diff(
            arm.joints[SHOULDER].actuator.length(motion(arm, np.full(150, 60.0), 0.0))
        )[60:]
        / 0.01
    )
    # without much load the rod's speed is that of the valve's flow, whatever it moves
    assert rod.mean() == pytest.approx(plain.mean(), rel=0.05)
    assert np.ptp(rod[-30:]) < 0.1 * rod.mean()  # the oil has rung out


def test_a_linkage_that_does_not_reach_is_refused(arm: Arm):
    with pytest.raises(
        ValueError, match="four-bar linkage does not reach all of its range"
    ):
        bucket(arm, coupler=0.05)
