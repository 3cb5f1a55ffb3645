"""What an MJCF and a YAML file say of an arm, and the triangles of its cylinders."""

import mujoco
import numpy as np
import pytest
from arms import BOOM, CHILD, CYLINDER, FOUR_BAR, PARENT, posed, write_arm
from hypothesis import given, strategies as st

from hydroid.arm.model import add_payload, load_model
from hydroid.cad.importer import import_arm
from hydroid.errors import HydroidError
from hydroid.project.boxes import boxes_urdf
from hydroid.settings.arm import load_arm
from hydroid.settings.cylinder import LinearActuator
from hydroid.settings.linkage import triangle

SHIPPED = load_arm("hydrolek")
LINEAR = [
    joint for joint in SHIPPED.joints if isinstance(joint.actuator, LinearActuator)
]


def test_the_shipped_arm_is_the_articles():
    assert len(SHIPPED.joints) == 7
    assert SHIPPED.link_names[-2:] == ("jaw_left", "jaw_right")
    assert SHIPPED.masses.sum() == pytest.approx(45.0)
    assert SHIPPED.masses[6:].sum() == pytest.approx(2.5)
    np.testing.assert_allclose(
        np.degrees(SHIPPED.pose("study")), [0, 10, -60, 0, 0, 0, 20]
    )
    for name in SHIPPED.poses:
        assert np.all(SHIPPED.lower <= SHIPPED.pose(name))
        assert np.all(SHIPPED.pose(name) <= SHIPPED.upper)
    assert np.isinf(SHIPPED.upper[5])
    assert SHIPPED.joints[1].range == (-30.0, 90.0)


@st.composite
def triangles(draw):
    """Sides a, b and the angle between them, at which the triangle is not flat."""
    return (
        draw(st.floats(0.02, 1.0)),
        draw(st.floats(0.02, 1.0)),
        draw(st.floats(0.15, 3.0)),
    )


@given(triangles())
def test_length_is_the_third_side_and_the_moment_arm_its_derivative(case):
    a, b, theta = case
    length, arm, slope = triangle(theta, a, b, 0.0)
    line = b * np.exp(1j * theta) - a
    assert length == pytest.approx(abs(line), rel=1e-9)
    # the moment arm is the joint's distance from the cylinder's line
    assert arm == pytest.approx((a * line).imag / abs(line), rel=1e-7)
    step = 1e-30  # complex step: no subtraction, so no rounding
    ahead = triangle(theta + step * 1j, a, b, 0.0)
    assert arm == pytest.approx(ahead[0].imag / step, rel=1e-9)
    assert slope == pytest.approx(ahead[1].imag / step, rel=1e-6, abs=1e-9)


def test_in_every_pose_a_cylinder_is_as_long_as_its_pivots_are_apart():
    model = load_model(SHIPPED).compile()
    rng = np.random.default_rng(1)
    for _ in range(5):
        pose = rng.uniform(
            np.maximum(SHIPPED.lower, -np.pi), np.minimum(SHIPPED.upper, np.pi)
        )
        data = posed(model, pose)
        jacobian = np.zeros((model.ntendon, model.nv))
        rows = model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind
        mujoco.mju_sparse2dense(jacobian, data.ten_J, *rows)
        for joint in LINEAR:
            column, tendon = (
                model.joint(joint.name).id,
                model.tendon(f"{joint.name}_cylinder").id,
            )
            angle = data.qpos[column]
            assert data.ten_length[tendon] == pytest.approx(
                joint.actuator.length(angle), abs=1e-9
            )
            expected = joint.actuator.moment_arm(angle) * (
                np.arange(model.nv) == column
            )
            np.testing.assert_allclose(jacobian[tendon], expected, atol=1e-9)


@pytest.mark.parametrize("above", [1.0, -1.0])
def test_a_cylinder_between_two_points_of_the_assembled_arm(tmp_path, above):
    """The distance of the two points, carried by their links, is its length; sites say
    the same."""
    z = 2.0 + above * np.array([0.4, 0.5])
    ends = {"parent": [*PARENT[:2], float(z[0])], "child": [*CHILD[:2], float(z[1])]}
    arm = write_arm(tmp_path, actuators={"tilt": CYLINDER | {"pivots": ends}})
    cylinder = arm.joints[1].actuator
    here, there = np.array(cylinder.pivots)
    np.testing.assert_allclose(here, np.array(ends["parent"]) - [0.2, 0, 2], atol=1e-9)
    np.testing.assert_allclose(there, np.array(ends["child"]) - [6.2, 0, 2], atol=1e-9)
    model, ends = load_model(arm).compile(), {"boom": here, "bar": there}
    for angle in (-0.9, 0.0, 0.7):
        data = posed(model, (0.3, angle))
        pairs = ((data.body("boom"), here), (data.body("bar"), there))
        first, second = (
            body.xpos + body.xmat.reshape(3, 3) @ point for body, point in pairs
        )
        assert np.linalg.norm(second - first) == pytest.approx(
            cylinder.length(angle), abs=1e-9
        )
    assert (
        (cylinder.length(0.1) > cylinder.length(0.0))
        == (cylinder.sense > 0)
        == (above < 0)
    )
    assert cylinder.stroke == pytest.approx(
        1e3 * np.ptp(cylinder.length(np.radians([-60, 60]))), abs=1e-3
    )
    before = {
        "parent": ('<body name="hook"', here),
        "child": ('<joint name="tilt"', there),
    }
    sites = BOOM
    for name, (old, place) in before.items():
        sites = sites.replace(
            old, f'<site name="tilt_pivot_{name}" pos="{text(place)}"/>{old}'
        )
    same = write_arm(tmp_path, sites, actuators={"tilt": CYLINDER}).joints[1].actuator
    assert (same.triangle, same.stroke, same.pivots) == (
        cylinder.triangle,
        cylinder.stroke,
        cylinder.pivots,
    )


@pytest.mark.parametrize("above", [1.0, -1.0])
@pytest.mark.parametrize("limits", ["-60 60", "-175 -135", "135 175"])
def test_a_positive_command_turns_a_joint_back_whose_rod_runs_out_that_way(
    tmp_path, above, limits
):
    """The way in its range counts: at angle 0, which it need not reach, the rod may run
    out the other way."""
    z = 2.0 + above * np.array([0.4, 0.5])
    ends = {"parent": [*PARENT[:2], float(z[0])], "child": [*CHILD[:2], float(z[1])]}
    model = BOOM.replace('range="-60 60"', f'range="{limits}"')
    arm = write_arm(tmp_path, model, actuators={"tilt": CYLINDER | {"pivots": ends}})
    low, high = arm.joints[1].actuator.length(np.array(arm.joints[1].limits))
    assert arm.backward == ((2,) if high < low else ())


def text(values):
    return " ".join(map(repr, values.tolist()))


def test_any_mjcf_of_hinges_is_an_arm(tmp_path):
    """Masses may come from shapes; without a keyframe `home` is where MuJoCo starts."""
    arm = write_arm(tmp_path)
    assert (arm.name, arm.joint_names, arm.link_names) == (
        "boom",
        ("lift", "tilt"),
        ("boom", "bar", "hook"),
    )
    np.testing.assert_allclose(arm.masses, [1500, 90, 20])
    assert arm.poses == {"home": (0.0, 0.0)}
    assert arm.joints[0].actuator is None
    free = write_arm(tmp_path, BOOM.replace('range="-20 60"', ""))
    assert (free.joints[0].continuous, free.joints[0].range) == (True, (-180.0, 180.0))
    assert np.isinf(free.lower[0])


def test_defaults_classes_and_frames_are_read_as_mujoco_reads_them(tmp_path):
    """Names and ranges are read without MuJoCo, masses and the order of links with
    it."""
    model = BOOM.replace(
        "<worldbody>",
        '<compiler angle="radian" autolimits="true"/><default><joint range="-0.5 0.5"/><default class="look">'
        '<geom mass="0"/><joint limited="false"/></default></default><worldbody>',
    )
    model = model.replace(' range="-20 60"', "").replace(' range="-60 60"', "")
    model = model.replace('<joint name="tilt"', '<joint class="look" name="tilt"')
    hung = '<frame childclass="look"><body name="sign"><geom size="1"/></body></frame><body name="hook"'
    arm = write_arm(tmp_path, model.replace('<body name="hook"', hung))
    compiled = load_model(arm).compile()
    assert arm.joint_names == tuple(compiled.joint(j).name for j in range(2))
    np.testing.assert_allclose([arm.lower, arm.upper], [[-0.5, -np.inf], [0.5, np.inf]])
    np.testing.assert_allclose(arm.limits, [[-0.5, 0.5], [-np.pi, np.pi]])
    assert compiled.jnt_limited.tolist() == [1, 0]
    assert arm.link_names == ("boom", "bar", "hook")
    np.testing.assert_allclose(
        arm.masses, [compiled.body(name).mass[0] for name in arm.link_names]
    )


def test_a_payload_hangs_on_its_site(tmp_path):
    frame = '<frame pos="1 0 0"><site name="grip" pos="0 0 2"/></frame>'
    model = BOOM.replace('<body name="bar"', f'{frame}<body name="bar"')
    arm = write_arm(tmp_path, model, payload="grip")
    loaded = add_payload(load_model(arm), arm, 70.0).compile()
    assert loaded.body("payload").mass[0] == 70.0
    np.testing.assert_allclose(loaded.body("payload").pos, [1, 0, 2])


TELESCOPE = """
<mujoco>
  <worldbody>
    <body name="boom" pos="0 0 1">
      <joint name="lift" axis="0 -1 0" range="-20 60"/>
      <geom type="box" size="1 .1 .1" pos="1 0 0"/>
      <body name="telescope" pos="1 0 0">
        <joint name="slide" type="slide" axis="1 0 0" range="0 2"/>
        <geom type="box" size="1 .1 .1" pos=".2 0 0"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def test_without_a_site_the_tip_is_the_end_of_the_last_link(tmp_path):
    boxes = boxes_urdf(["swing", "boom", "stick"], [0, 3.0, 1.5])
    (tmp_path / "boxes.urdf").write_text(boxes)
    imported = import_arm(tmp_path / "boxes.urdf")
    cases = [
        (imported.mjcf, "stick_link", [1.5, 0, 0]),
        (TELESCOPE, "telescope", [1.2, 0, 0]),
        (BOOM, "bar", [2, 0, -2]),
    ]
    for text, link, at in cases:
        arm = write_arm(tmp_path, text)
        loaded = add_payload(load_model(arm), arm, 70.0).compile()
        payload = loaded.body("payload")
        assert loaded.body(payload.parentid[0]).name == link
        np.testing.assert_allclose(payload.pos, at, atol=1e-9)


def cylinder(**changes) -> dict[str, object]:
    ends = {"parent": PARENT, "child": CHILD} | changes.pop("pivots", {})
    return {"actuators": {"tilt": CYLINDER | {"pivots": ends} | changes}}


SAME = "", ""
WRONG = [
    (SAME, {"actuators": {"knee": CYLINDER}}, "knee: no such joint; the model's joints: lift, tilt"),
    (SAME, {"actuators": {"tilt": CYLINDER}}, "actuators.tilt: the model has no site tilt_pivot_parent"),
    (SAME, {"actuators": {"tilt": {"kind": "hydraulic"}}}, "kind"),
    (SAME, {"payload": "hand"}, "payload: the model has no site 'hand'"),
    (SAME, {"links": []}, "unknown setting 'links'"),
    (SAME, cylinder(stroke=10), "a stroke of 10 mm is too short for the range, which needs"),
    (SAME, cylinder(pivots={"parent": [6.2, 0.2, 2.0]}), "tilt: the pivot on the parent lies on"),
    (SAME, cylinder(pivots={"parent": [4.2, 0.9, 2.4]}), "must lie across the axis"),
    (SAME, cylinder(pivots={"parent": [4.2, 0, 2.0], "child": [6.5, 0, 2.0]}), "has a dead centre"),
    (SAME, cylinder(pivots={"parent": [4, 0, "x"]}), "pivots.parent.2: must be a valid number"),
    (SAME, cylinder(triangle={"a": 1, "b": 0.5, "theta0": 90}), "pivots take the place of triangle"),
    (SAME, cylinder(four_bar=FOUR_BAR), "four_bar needs a triangle"),
    (('range="-60 60"', ""), cylinder(), "tilt: a joint without limits needs a rotary actuator"),
    (("</mujoco>", ""), {}, "cannot be read as XML"),
    (('range="-20 60"', 'range="-20"'), {}, "does not have enough data"),
    (('axis="0 -1 0"', 'type="ball"'), {}, "must be a hinge or a slide"),
    (('<joint name="tilt"', '<joint name="extra"/><joint name="tilt"'), {}, "alone on its body"),
    (('<joint name="tilt"', "<joint"), {}, "both need a name"),
    (('<body name="bar"', "<body"), {}, "both need a name"),
    (("</mujoco>", '<equality><joint joint1="lift" joint2="tilt"/></equality></mujoco>'), {}, "equality"),
    (("</mujoco>", '<asset><texture name="t" type="2d" file="no.png"/></asset></mujoco>'), {}, "no.png"),
]  # fmt: skip
"""a change of the model, the settings, and what is said of them"""


@pytest.mark.parametrize(("change", "settings", "message"), WRONG)
def test_an_arm_that_hydroid_cannot_simulate_is_refused_in_one_line(
    tmp_path, change, settings, message
):
    assert change[0] in BOOM
    with pytest.raises(HydroidError, match=message) as caught:
        assert write_arm(tmp_path, BOOM.replace(*change), **settings).joints
    assert str(caught.value).startswith(str(tmp_path))
    assert "\n" not in str(caught.value)


def test_a_model_that_is_not_there_is_answered_with_the_way_to_one(tmp_path):
    (tmp_path / "arm.yaml").write_text("model: none.xml")
    with pytest.raises(HydroidError, match=r"none\.xml: no such model; .*hydroid init"):
        assert load_arm(tmp_path / "arm.yaml").joints
