import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from hydroid.arm.linkage import Cylinder, Rotary, linkage, pivots
from hydroid.settings.arm import load_arm

ARM = load_arm("hydrolek")
LINEAR = [joint for joint in ARM.joints if joint.actuator.kind == "linear"]


@st.composite
def triangles(draw):
    """A cylinder and an angle at which its triangle is not flat."""
    a, b = draw(st.floats(0.02, 1.0)), draw(st.floats(0.02, 1.0))
    theta, theta0 = draw(st.floats(0.15, 3.0)), draw(st.floats(-3.0, 3.0))
    return Cylinder(a, b, theta0, start=0.05 - theta0), theta - theta0


@given(triangles())
def test_length_is_the_third_side_of_the_triangle(case):
    cylinder, q = case
    third = abs(cylinder.a - cylinder.b * np.exp(1j * (q + cylinder.theta0)))
    assert cylinder.length(q) == pytest.approx(third, rel=1e-9)


@given(triangles())
def test_moment_arm_is_the_derivative_of_the_length(case):
    cylinder, q = case
    step = 1e-30  # complex step: no subtraction, so no rounding
    assert cylinder.moment_arm(q) == pytest.approx(cylinder.length(q + step * 1j).imag / step, rel=1e-9)


@given(triangles())
def test_moment_arm_is_the_joints_distance_from_the_cylinders_line(case):
    cylinder, q = case
    first, second = cylinder.a, cylinder.b * np.exp(1j * (q + cylinder.theta0))
    line = second - first
    assert cylinder.moment_arm(q) == pytest.approx((first.conjugate() * line).imag / abs(line), rel=1e-7)


@given(triangles(), st.floats(0.01, 0.1), st.floats(-500.0, 500.0))
def test_the_torque_does_the_work_of_a_force_that_grows_with_travel(case, angle, rate):
    cylinder, q = case

    def torque(angle):
        return (100.0 + rate * cylinder.travel(angle)) * cylinder.moment_arm(angle)

    x = cylinder.travel(np.array([q, q + angle]))
    work = 100.0 * np.diff(x) + 0.5 * rate * np.diff(x**2)
    assert quad(torque, q, q + angle)[0] == pytest.approx(work[0], rel=1e-8, abs=1e-9)


@pytest.mark.parametrize("joint", LINEAR, ids=lambda joint: joint.name)
def test_the_rod_runs_out_steadily_from_one_stop_to_the_other(joint):
    cylinder = linkage(joint)
    q = np.linspace(*np.radians(joint.range), 200)
    travel = cylinder.travel(q)
    assert travel[0] == 0
    assert np.all(np.diff(travel) > 0)
    assert 0.8 * joint.actuator.stroke < 1e3 * travel[-1] < 1.02 * joint.actuator.stroke


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


def test_any_leading_axes_are_kept():
    q = np.linspace(0.1, 0.3, 24).reshape(2, 3, 4)
    cylinder, rotary = linkage(ARM.joints[1]), linkage(ARM.joints[3])
    assert cylinder.length(q).shape == cylinder.moment_arm(q).shape == rotary.moment_arm(q).shape == q.shape
    assert cylinder.moment_arm(q)[1, 2, 3] == cylinder.moment_arm(q[1, 2, 3])


def test_a_rotary_actuator_has_the_same_arm_everywhere():
    rotary = linkage(ARM.joints[3])
    assert isinstance(rotary, Rotary)
    np.testing.assert_allclose(rotary.moment_arm(np.array([-1.0, 0.0, 1.0])), 10e-6, rtol=1e-15)  # 10 cm³
