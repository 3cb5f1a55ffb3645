"""Arm files without meshes, without cylinders, large ones, and cylinders that are given by their pivots."""

import math

import mujoco
import numpy as np
import pytest
import trimesh
import yaml

from hydroid.arm.build import build_model, pivots
from hydroid.arm.model import load_model
from hydroid.errors import MeshError, SettingsError
from hydroid.settings.arm import Arm, load_arm

ROD = {"kind": "cylinder", "ends": [[0, 0, 0], [2, 0, -2]], "radius": 0.1}
BOOM = {
    "name": "boom",
    "model": "boom.xml",
    "base": {"at": [0, 0, 1.5]},
    "links": [
        {"name": "boom", "shape": {"kind": "box", "size": [6, 0.3, 0.5], "at": [3, 0, 0]}, "mass": 1500},
        {"name": "bar", "mass": 90, "shape": ROD},
    ],
    "joints": [
        {"name": "lift", "axis": [0, -1, 0], "at": [0.2, 0, 0.5], "range": [-20, 60]},
        {"name": "tilt", "axis": [0, -1, 0], "at": [6, 0, 0], "range": [-60, 60]},
    ],
    "poses": {"home": [0, 0]},
}  # fmt: skip
SIZES = {"area_a": 5000, "area_b": 3000, "max_opening": 20}


def arm(folder, **changes) -> Arm:
    path = folder / "arm.yaml"
    path.write_text(yaml.safe_dump(BOOM | changes))
    return load_arm(path)


def cylinder(**pivots: object) -> list[dict[str, object]]:
    """The joints, the second with a cylinder."""
    actuator = {"kind": "linear", "pivots": pivots, **SIZES}
    return [BOOM["joints"][0], {**BOOM["joints"][1], "actuator": actuator}]


def test_shapes_have_the_textbooks_inertia(tmp_path):
    model = build_model(arm(tmp_path)).compile()
    box = 1500 / 12 * np.array([0.3**2 + 0.5**2, 6**2 + 0.5**2, 6**2 + 0.3**2])
    np.testing.assert_allclose(np.sort(model.body("boom").inertia), np.sort(box))
    np.testing.assert_allclose(model.body("boom").ipos, [3, 0, 0])
    length = math.sqrt(8.0)
    rod = 90 * np.array([0.1**2 / 2, 0.1**2 / 4 + length**2 / 12, 0.1**2 / 4 + length**2 / 12])
    np.testing.assert_allclose(np.sort(model.body("bar").inertia), np.sort(rod))
    np.testing.assert_allclose(model.body("bar").ipos, [1, 0, -1], atol=1e-12)


def test_an_arm_of_shapes_is_seen_whole(tmp_path):
    model = build_model(arm(tmp_path)).compile()
    assert model.stat.extent > 2
    assert model.geom("floor").size[0] > 5
    assert model.ngeom == 1 + 2 * 2


def test_a_stated_inertia_is_taken_and_an_open_mesh_then_only_shown(tmp_path):
    solid = trimesh.creation.box(extents=(6, 0.3, 0.5))
    solid.update_faces(np.arange(len(solid.faces)) > 0)  # a hole
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "boom.stl").write_bytes(solid.export(file_type="stl"))
    stated = {"centre": [2.5, 0.1, 0], "tensor": [100, 4000, 4050, 5, -20, 3]}
    link = {"name": "boom", "mesh": "boom.stl", "mass": 1500}
    one = {"joints": BOOM["joints"][:1], "poses": {"home": [0]}}
    with pytest.raises(MeshError, match="not watertight"):
        build_model(arm(tmp_path, links=[link], **one))
    model = build_model(arm(tmp_path, links=[link | {"inertia": stated}], **one)).compile()
    body = model.body("boom")
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, body.iquat)
    axes = turn.reshape(3, 3)
    expected = [[100, 5, -20], [5, 4000, 3], [-20, 3, 4050]]
    np.testing.assert_allclose(axes * body.inertia @ axes.T, expected, atol=1e-8)
    np.testing.assert_allclose(body.ipos, stated["centre"])


@pytest.mark.parametrize(
    ("link", "message"),
    [
        ({}, "needs a mesh, a shape or an inertia"),
        ({"inertia": {"centre": [0, 0, 0], "tensor": [1, 1, 3, 0, 0, 0]}}, "1, 1 and 3 .* break A . B . C"),
        ({"inertia": {"centre": [0, 0, 0], "tensor": [0, 1, 1, 0, 0, 0]}}, "must be above 0"),
        ({"mesh": "a.stl", "shape": {"kind": "box", "size": [1, 1, 1]}}, "a mesh and a shape"),
        (
            {"shape": {"kind": "cylinder", "ends": [[0, 0, 0], [0, 0, 0]], "radius": 1}},
            "two different points",
        ),
    ],
)
def test_a_link_that_cannot_be_is_refused(tmp_path, link, message):
    with pytest.raises(SettingsError, match=message):
        arm(tmp_path, links=[{"name": "boom", "mass": 5} | link, BOOM["links"][1]])


@pytest.mark.parametrize("frame", ["link", "arm"])
@pytest.mark.parametrize("below", [1.0, -1.0])
def test_a_cylinder_goes_through_its_two_pivots(tmp_path, frame, below):
    parent, child = np.array([4.0, 0.05, 0.4 * below]), np.array([0.3, 0.05, 0.5 * below])
    shift = {"link": ([0, 0, 0], [0, 0, 0]), "arm": ([0.2, 0, 2.0], [6.2, 0, 2.0])}[frame]
    given = {"parent": (parent + shift[0]).tolist(), "child": (child + shift[1]).tolist(), "frame": frame}
    own = arm(tmp_path, joints=cylinder(**given))
    joint = own.joints[1]
    found = pivots(joint, joint.actuator)
    np.testing.assert_allclose(found, [parent, child], atol=1e-12)
    model = build_model(own).compile()
    data = mujoco.MjData(model)
    for angle in (-0.9, 0.0, 0.7):
        data.qpos[:] = 0.3, angle
        mujoco.mj_forward(model, data)
        assert data.ten_length[0] == pytest.approx(joint.actuator.length(angle), abs=1e-12)
    # the rod runs out where the cylinder grows longer
    assert (joint.actuator.length(0.1) > joint.actuator.length(0.0)) == (joint.actuator.sense > 0)
    travel = np.ptp(joint.actuator.length(np.radians(joint.range)))
    assert joint.actuator.stroke == pytest.approx(1e3 * travel, abs=1e-3)


def test_an_arm_with_pivots_reads_back_the_same(tmp_path):
    own = arm(tmp_path, joints=cylinder(parent=[4, 0, 0.4], child=[0.3, 0, 0.5]))
    again = Arm.model_validate(own.model_dump(mode="json"))
    assert again == own.model_copy(update={"model": again.model, "meshes": again.meshes})


@pytest.mark.parametrize(
    ("pivots", "message"),
    [
        ({"parent": [6, 0.2, 0], "child": [0.3, 0, 0.5]}, "tilt: the pivot on the parent lies on"),
        ({"parent": [4, 0.9, 0.4], "child": [0.3, 0, 0.5]}, "must lie across the axis"),
        ({"parent": [4, 0, 0.4]}, "pivots.child' is missing"),
        ({"parent": [4, 0, "x"], "child": [0.3, 0, 0.5]}, "pivots.parent.2: must be a number"),
        ({"parent": [4, 0, 0.4], "child": [0.3, 0, 0.5], "frame": "body"}, "'link' or 'arm'"),
        ({"parent": [4, 0, 0.0], "child": [0.3, 0, 0.0]}, "no moment arm at 0 and 180"),
    ],
)  # fmt: skip
def test_pivots_that_cannot_be_are_refused_in_one_line(tmp_path, pivots, message):
    with pytest.raises(SettingsError, match=message) as caught:
        arm(tmp_path, joints=cylinder(**pivots))
    assert "\n" not in str(caught.value)


def test_pivots_and_a_triangle_are_too_much(tmp_path):
    joints = cylinder(parent=[4, 0, 0.4], child=[0.3, 0, 0.5])
    joints[1]["actuator"]["theta0"] = 30
    with pytest.raises(SettingsError, match="pivots take the place of theta0"):
        arm(tmp_path, joints=joints)


def test_stage_1_needs_no_actuators(tmp_path):
    own = arm(tmp_path)
    assert own.joints[0].actuator is None
    (tmp_path / "boom.xml").write_text(build_model(own).to_xml())
    load_model(tmp_path / "boom.xml", own)
