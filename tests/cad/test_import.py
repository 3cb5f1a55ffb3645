"""An arm out of a URDF or MJCF: it moves as MuJoCo's own import does, and every trap is said in one line."""

import mujoco
import numpy as np
import pytest
import robots
import trimesh
from robots import LIMIT, joint, link, write_robot

from hydroid.cad import import_arm
from hydroid.errors import ModelError


def said(arm, start):
    """The one note that begins like this."""
    (line,) = [note for note in arm.notes if note.startswith(start)]
    assert "\n" not in line
    return line


def forward(arm, angles):
    """Turn [matrix] and place of each link's frame, and the gravity torques, from the imported numbers."""
    turn, at, frames = np.eye(3), np.zeros(3), []
    for link_, joint_, angle in zip(arm.links, arm.joints, angles, strict=True):
        at = at + turn @ joint_.at
        quat, step = np.empty(4), np.empty(9)
        mujoco.mju_axisAngle2Quat(quat, joint_.axis, angle)
        mujoco.mju_quat2Mat(step, quat)
        turn = turn @ step.reshape(3, 3)
        frames.append((turn, at, turn @ joint_.axis, at + turn @ link_.centre, link_.mass))
    return frames


def test_links_joints_and_inertias_are_those_of_the_file(tmp_path):
    arm = import_arm(write_robot(tmp_path))
    assert [part.name for part in arm.links] == ["house", "boom", "stick"]
    assert [part.name for part in arm.joints] == ["swing_joint", "boom_joint", "stick_joint"]
    for part in arm.links:
        length, width, height = robots.SIZES[part.name]
        square = np.array([length, width, height]) ** 2
        assert part.mass == robots.MASSES[part.name]
        np.testing.assert_allclose(part.centre, [length / 2, 0, 0], atol=1e-12)
        np.testing.assert_allclose(part.tensor, np.diag(square.sum() - square) * part.mass / 12, rtol=1e-9)
        np.testing.assert_allclose(
            part.mesh.bounds, [[0, -width / 2, -height / 2], [length, width / 2, height / 2]]
        )
    assert arm.joints[1].range == pytest.approx(np.degrees([-0.5, 1.2]))
    np.testing.assert_allclose(arm.base.extents, [2, 1.5, 0.5])


def test_turned_frames_move_as_mujocos_own_import_does(tmp_path):
    """Links whose frames are turned, with a tool fixed to the last one, in every pose."""
    inertia = '<inertia ixx="2" iyy="3" izz="4" ixy="0.1" ixz="0" iyz="0.2"/>'
    tool = f'<link name="tool"><inertial><origin xyz="0 0.1 0"/><mass value="30"/>{inertia}</inertial></link>'
    boom = {"at": "0.5 0.1 0.3", "turn": "0.3 -0.2 0.5", "axis": "0.1 -1 0.2"}
    stick = {"at": "2 0 0.1", "turn": "-0.4 0.1 0.2", "axis": "0 0.3 1"}
    changes = {
        "boom_joint": joint("boom_joint", "house", "boom", **boom),
        "stick_joint": joint("stick_joint", "boom", "stick", **stick),
        "more": tool + joint("weld", "stick", "tool", kind="fixed", at="1.5 0 0", turn="1 0 0", limit=""),
    }  # fmt: skip
    path = write_robot(tmp_path, **changes)
    arm = import_arm(path)
    assert arm.links[2].mass == 120.0
    text = path.read_text().replace("package://digger/meshes/", str(tmp_path / "digger/meshes") + "/")
    text = text.replace("</robot>", '<mujoco><compiler strippath="false"/></mujoco></robot>')
    model = mujoco.MjSpec.from_string(text).compile()
    data = mujoco.MjData(model)
    for angles in np.random.default_rng(1).uniform(-1, 1, (5, 3)):
        data.qpos[:] = angles
        mujoco.mj_forward(model, data)
        frames = forward(arm, angles)
        for k, (_, at, axis, _, _) in enumerate(frames):
            np.testing.assert_allclose(at, data.xanchor[k], atol=1e-9)
            np.testing.assert_allclose(axis, data.xaxis[k], atol=1e-9)
        weight = [
            9.81 * axis @ sum(m * np.cross(c - at, [0, 0, 1]) for *_, c, m in frames[k:])
            for k, (_, at, axis, _, _) in enumerate(frames)
        ]
        np.testing.assert_allclose(data.qfrc_bias, weight, atol=1e-6)


def test_the_base_link_is_the_fixed_base(tmp_path):
    said(import_arm(write_robot(tmp_path)), "the root link track is the fixed base: its mass does not matter")


def test_a_joint_that_mimics_another_is_held(tmp_path):
    limit = LIMIT.format(-1, 1) + '<mimic joint="boom_joint" multiplier="-1"/>'
    arm = import_arm(write_robot(tmp_path, stick_joint=joint("stick_joint", "boom", "stick", limit=limit)))
    said(arm, "joint stick_joint mimics boom_joint, which hydroid does not model: it is held at 0")
    assert [part.mass for part in arm.links] == [800.0, 290.0]


@pytest.mark.parametrize("kind", ["prismatic", "floating"])
def test_a_joint_that_is_no_hinge_is_held(tmp_path, kind):
    more = joint("stick_joint", "boom", "stick", kind=kind)
    arm = import_arm(write_robot(tmp_path, stick_joint=more))
    said(arm, f"joint stick_joint is {kind}: hydroid moves hinges only, so it is held at 0")
    assert len(arm.joints) == 2


@pytest.mark.parametrize(("kind", "limit"), [("continuous", ""), ("revolute", LIMIT.format(0, 0))])
def test_a_joint_without_limits_turns_without_stops(tmp_path, kind, limit):
    more = joint("swing_joint", "track", "house", kind=kind, axis="0 0 1", limit=limit)
    arm = import_arm(write_robot(tmp_path, swing_joint=more))
    said(arm, "joint swing_joint has no limits: it turns without stops, unless you set range and continuous")
    assert arm.joints[0].continuous
    assert arm.joints[0].range == (-180, 180)


def test_a_missing_mesh_says_where_it_was_looked_for(tmp_path):
    arm = import_arm(write_robot(tmp_path, boom=link("boom", mesh="package://other/meshes/lost.stl")))
    line = said(arm, "mesh package://other/meshes/lost.stl is not there; looked for ")
    assert f"{tmp_path}/digger/urdf/other/meshes/lost.stl" in line
    assert "lost.stl below" in line
    assert arm.links[1].mesh is None
    assert arm.links[1].mass == 200


@pytest.mark.parametrize(
    "mesh", ["package://digger/meshes/boom.stl", "../meshes/boom.stl", "package://x/meshes/boom.stl"]
)
def test_meshes_are_found_from_the_urdfs_folder_and_its_parents(tmp_path, mesh):
    assert import_arm(write_robot(tmp_path, boom=link("boom", mesh=mesh))).links[1].mesh is not None


MESH = '<mesh filename="../meshes/boom.stl"/>'
FAULTS = {
    "no inertial": (
        f'<link name="boom"><visual><geometry>{MESH}</geometry></visual></link>',
        "it has no inertial; 120 kg are taken, its mesh at 1000 kg/m³",
        120.0,
    ),
    "no mass": (link("boom", mass=0.0, ixx=1, iyy=1, izz=1), "it has no mass; 120 kg are taken", 120.0),
    "A + B < C": (
        link("boom", ixx=1, iyy=1, izz=9),
        "its moments of inertia 1, 1 and 9 kg·m² break A + B ≥ C; the inertia of its mesh at uniform density",
        200.0,
    ),
    "no inertia": (link("boom", ixx=0, iyy=0, izz=0), "its inertia is 0; the inertia of its mesh", 200.0),
    "negative": (link("boom", ixx=-1, iyy=5, izz=5), "its smallest moment of inertia is -1 kg·m²", 200.0),
    "in kg mm²": (link("boom", ixx=2e6, iyy=7e7, izz=7e7), "its inertia is that of a body", 200.0),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_an_impossible_inertia_is_that_of_the_mesh(tmp_path, fault):
    text, message, mass = FAULTS[fault]
    arm = import_arm(write_robot(tmp_path, boom=text))
    assert message in said(arm, "link boom: ")
    boom = arm.links[1]
    assert boom.mass == pytest.approx(mass)
    square = np.array(robots.SIZES["boom"]) ** 2
    np.testing.assert_allclose(boom.tensor, np.diag(square.sum() - square) * mass / 12, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(boom.centre, [1, 0, 0], atol=1e-9)


def test_an_open_mesh_counts_by_its_hull(tmp_path):
    path = write_robot(tmp_path, boom=link("boom", ixx=0, iyy=0, izz=0))
    box = trimesh.load(tmp_path / "digger/meshes/boom.stl", force="mesh")
    box.update_faces(np.arange(len(box.faces)) > 1)
    (tmp_path / "digger/meshes/boom.stl").write_bytes(box.export(file_type="stl"))
    assert "the inertia of its mesh's hull" in said(import_arm(path), "link boom: its inertia is 0")


def test_no_damping_is_said(tmp_path):
    said(import_arm(write_robot(tmp_path)), "no joint has damping: a fit estimates it")


def test_meshes_in_millimetres_are_scaled(tmp_path):
    arm = import_arm(write_robot(tmp_path, scale=1000.0))
    line = said(arm, "mesh boom.stl would be 2000 m long: all meshes are taken to be in mm")
    assert "house" not in line
    np.testing.assert_allclose([part.mesh.extents[0] for part in arm.links], [1, 2, 1.5])


def test_the_files_own_scale_is_used(tmp_path):
    boom = robots.PARTS["boom"].replace('.stl"', '.stl" scale="0.5 0.5 0.5"')
    arm = import_arm(write_robot(tmp_path, boom=boom))
    np.testing.assert_allclose(arm.links[1].mesh.extents[0], 1.0)


@pytest.mark.parametrize("kind", ["obj", "stl_ascii", "ply"])
def test_other_mesh_files_are_converted(tmp_path, kind):
    box = trimesh.load(write_robot(tmp_path).parents[1] / "meshes/boom.stl", force="mesh")
    name = f"boom.{kind.removesuffix('_ascii')}"
    content = box.export(file_type=kind)
    target = tmp_path / "digger/meshes" / name
    target.write_bytes(content if isinstance(content, bytes) else content.encode())
    arm = import_arm(write_robot(tmp_path, boom=link("boom", mesh=f"../meshes/{name}")))
    np.testing.assert_allclose(arm.links[1].mesh.extents, robots.SIZES["boom"], rtol=1e-6)


def test_a_mesh_that_cannot_be_read_is_said(tmp_path):
    arm = import_arm(write_robot(tmp_path, boom=link("boom", mesh="../meshes/boom.dae")))
    assert "boom.dae is not there" in said(arm, "mesh ")
    (tmp_path / "digger/meshes/boom.dae").write_text("<COLLADA/>")
    arm = import_arm(tmp_path / "digger/urdf/digger.urdf")
    assert "pip install pycollada" in said(arm, "mesh boom.dae cannot be read")
    assert arm.links[1].mass == 200.0


FORK = (
    link("stick").replace('"stick"', '"hammer"')
    + robots.PARTS["stick"].replace('"stick"', '"chisel"')
    + joint("hammer_joint", "boom", "hammer", at="1 0 0")
    + joint("chisel_joint", "hammer", "chisel", at="1 0 0")
)


def test_of_several_branches_the_longest_is_taken_and_said(tmp_path):
    arm = import_arm(write_robot(tmp_path, more=FORK))
    line = said(arm, "of 2 branches the arm is swing_joint - boom_joint - hammer_joint - chisel_joint")
    assert "(the longest branch); held at 0: stick_joint. Choose another with --tip: stick, chisel" in line
    assert arm.links[1].mass == 290.0


def test_the_branch_that_the_log_names_is_taken(tmp_path):
    arm = import_arm(write_robot(tmp_path, more=FORK), columns=["t", "u_stick_V", "phi stick"])
    assert "(named in the log); held at 0: hammer_joint, chisel_joint" in said(arm, "of 2 branches")
    assert [part.name for part in arm.joints] == ["swing_joint", "boom_joint", "stick_joint"]


def test_a_tip_may_be_asked_for(tmp_path):
    path = write_robot(tmp_path, more=FORK)
    assert len(import_arm(path, tip="boom").joints) == 2
    with pytest.raises(ModelError, match=r"no joint moves a link 'bom'; tips: stick, chisel"):
        import_arm(path, tip="bom")


MJCF = """
<mujoco model="my arm">
  <compiler angle="degree" meshdir="meshes"/>
  <asset><mesh name="b" file="boom.stl"/></asset>
  <worldbody>
    <geom type="plane" size="5 5 1"/>
    <body name="base" pos="0 0 1"><geom type="box" size="0.5 0.5 0.5"/>
      <body name="boom" pos="0.5 0 0.5" euler="0 0 90">
        <joint name="lift" axis="0 -1 0" pos="0 0 0.1" range="-30 60" limited="true"/>
        <frame pos="0 0 0.1" euler="0 0 0"><geom type="mesh" mesh="b" density="500"/></frame>
        <body name="stick" pos="2 0 0.1"><inertial pos="0.7 0 0" mass="50" diaginertia="1 9 9"/>
          <joint name="tilt" axis="0 -1 0" range="-90 0" limited="true"/>
          <geom type="capsule" fromto="0 0 0 1.5 0 0" size="0.1"/>
          <body name="slide"><joint type="slide" axis="1 0 0"/><geom size="0.1" mass="5"/></body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="lift"/></actuator>
</mujoco>
"""


def test_an_mjcf_is_read_too(tmp_path):
    write_robot(tmp_path)
    path = tmp_path / "digger" / "arm.xml"
    path.write_text(MJCF)
    arm = import_arm(path)
    assert arm.name == "my_arm"
    said(arm, "its 1 actuators are left out: the hydraulics take their place")
    said(arm, "joint of slide slides: hydroid moves hinges only, so it is held at 0")
    boom, stick = arm.links
    assert boom.mass == pytest.approx(0.12 * 500)
    np.testing.assert_allclose(boom.centre, [0, 1, 0], atol=1e-6)  # turned by 90 deg about z, from its joint
    np.testing.assert_allclose(boom.mesh.extents, [0.2, 2.0, 0.3], atol=1e-6)
    np.testing.assert_allclose(arm.joints[0].at, [0.5, 0, 1.6], atol=1e-9)
    np.testing.assert_allclose(arm.joints[1].at, [0, 2, 0], atol=1e-9)
    assert stick.mass == pytest.approx(55)
    assert arm.joints[1].range == (-90, 0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<robot", "cannot be read as XML"),
        ("<sdf/>", "is neither URDF nor MJCF: its root element is <sdf>"),
        ('<robot xmlns:xacro="http://ros.org/xacro"><xacro:include filename="a"/></robot>', "is a xacro"),
        ('<robot name="a"><link name="b"/></robot>', "has no hinge that hydroid could move"),
        ('<robot name="a"><joint name="j" type="revolute"/></robot>', "MuJoCo refuses it"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_arm_is_refused_in_one_line(tmp_path, text, message):
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    with pytest.raises(ModelError, match=message) as caught:
        import_arm(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
    with pytest.raises(ModelError, match="no such robot"):
        import_arm(tmp_path / "none.urdf")
