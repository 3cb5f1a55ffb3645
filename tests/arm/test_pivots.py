import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hydroid.arm.build import pivots
from hydroid.settings.arm import load_arm
from hydroid.settings.linkage import triangle

ARM = load_arm("hydrolek")
LINEAR = [joint for joint in ARM.joints if joint.actuator.kind == "linear"]


@st.composite
def triangles(draw):
    """Sides a, b and the angle between them, at which the triangle is not flat."""
    return draw(st.floats(0.02, 1.0)), draw(st.floats(0.02, 1.0)), draw(st.floats(0.15, 3.0))


@given(triangles())
def test_length_is_the_third_side_of_the_triangle(case):
    a, b, theta = case
    length, arm, _ = triangle(theta, a, b, 0.0)
    line = b * np.exp(1j * theta) - a
    assert length == pytest.approx(abs(line), rel=1e-9)
    # the moment arm is the joint's distance from the cylinder's line
    assert arm == pytest.approx((a * line).imag / abs(line), rel=1e-7)


@given(triangles())
def test_moment_arm_is_the_derivative_of_the_length(case):
    a, b, theta = case
    step = 1e-30  # complex step: no subtraction, so no rounding
    ahead = triangle(theta + step * 1j, a, b, 0.0)
    _, arm, slope = triangle(theta, a, b, 0.0)
    assert arm == pytest.approx(ahead[0].imag / step, rel=1e-9)
    assert slope == pytest.approx(ahead[1].imag / step, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("joint", LINEAR, ids=lambda joint: joint.name)
def test_the_rod_runs_out_steadily_from_one_stop_to_the_other(joint):
    travel = np.ptp(joint.actuator.length(np.radians(joint.range)))
    assert np.all(
        np.diff(joint.actuator.length(np.radians(np.linspace(joint.range[0], joint.range[1], 200)))) > 0
    )
    assert 0.8 * joint.actuator.stroke < 1e3 * travel < 1.02 * joint.actuator.stroke


@pytest.mark.parametrize("joint", LINEAR, ids=lambda joint: joint.name)
def test_pivots_lie_where_the_settings_say(joint):
    on_parent, on_child = pivots(joint, joint.actuator)
    axis = np.array(joint.axis)
    away = {"parent": on_parent - joint.at, "child": on_child}
    radius = {end: np.linalg.norm(np.cross(axis, at)) for end, at in away.items()}
    other = "child" if joint.actuator.a_on == "parent" else "parent"
    assert radius[joint.actuator.a_on] == pytest.approx(joint.actuator.a)
    assert radius[other] == pytest.approx(joint.actuator.b)
    assert [axis @ at for at in away.values()] == pytest.approx([joint.actuator.offset] * 2)
