import mujoco
import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from hydroid.arm.build import build_model, write_model
from hydroid.arm.mesh import mass_properties
from hydroid.arm.model import load_model
from hydroid.errors import MeshError, ModelError
from hydroid.settings.arm import Arm, load_arm

ARM = load_arm("hydrolek")
SPEC = load_model(ARM.model, ARM)
MODEL = SPEC.compile()
BUILT = build_model(ARM).compile()
TEXT = ARM.model.read_text(encoding="utf-8")


def random_poses(count, seed=0):
    low, high = np.maximum(ARM.lower, -np.pi), np.minimum(ARM.upper, np.pi)
    return np.random.default_rng(seed).uniform(low, high, (count, len(low)))


def posed(q):
    data = mujoco.MjData(MODEL)
    data.qpos[:] = q
    mujoco.mj_forward(MODEL, data)
    return data


REBUILT = {
    "body": ("parentid", "pos", "quat", "mass", "ipos", "inertia"),
    "jnt": ("axis", "pos", "range", "limited", "stiffness"),
    "dof": ("damping", "frictionloss", "armature"),
    "geom": ("type", "group", "size", "contype"),
    "actuator": ("gear", "trnid"),
    "mesh": ("vertnum", "facenum"),
    "site": ("pos",),
    "key": ("qpos",),
    "tendon": ("width",),
    "exclude": ("signature",),
    "cam": ("pos", "quat"),
}


@pytest.mark.parametrize("field", [f"{what}_{name}" for what, names in REBUILT.items() for name in names])
def test_the_committed_model_equals_a_rebuild(field):
    np.testing.assert_allclose(getattr(MODEL, field), getattr(BUILT, field), rtol=1e-7, atol=1e-9)


def test_the_committed_model_has_the_names_and_options_of_a_rebuild():
    assert MODEL.names == BUILT.names
    assert MODEL.opt.timestep == BUILT.opt.timestep == 0.01
    assert MODEL.opt.integrator == BUILT.opt.integrator == mujoco.mjtIntegrator.mjINT_EULER


def test_writing_what_was_read_changes_nothing(tmp_path):
    path = tmp_path / "deep" / "arm.xml"
    write_model(ARM, path)
    again = load_model(path, ARM).compile()
    np.testing.assert_allclose(again.body_inertia, MODEL.body_inertia, rtol=1e-12)
    assert [p.name for p in path.parent.iterdir()] == ["arm.xml"]


def test_a_bad_mesh_leaves_the_old_model_alone(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text("the old one")
    with pytest.raises(MeshError, match=r"base\.stl"):
        write_model(ARM, path, mesh_folder=tmp_path)
    assert path.read_text() == "the old one"


def test_each_body_carries_its_meshs_inertia_times_its_mass():
    for part in ARM.parts:
        body = MODEL.body(part.name)
        expected = mass_properties(ARM.meshes / part.mesh)
        axes = Rotation.from_quat(np.roll(body.iquat, -1)).as_matrix()
        assert body.mass[0] == part.mass
        np.testing.assert_allclose(body.ipos, expected.centre, atol=1e-12)
        tensor = part.mass * expected.inertia
        np.testing.assert_allclose(axes * body.inertia @ axes.T, tensor, atol=1e-6 * tensor.max())
    assert MODEL.body_mass.sum() == pytest.approx(45.0)


@pytest.mark.parametrize("q", random_poses(6))
def test_bodies_stand_where_the_chain_of_joints_puts_them(q):
    data = posed(q)
    turn, at = Rotation.identity(), np.array(ARM.base.at)
    for link, joint, angle in zip(ARM.links, ARM.joints, q, strict=True):
        at = at + turn.apply(joint.at)
        turn = turn * Rotation.from_rotvec(angle * np.array(joint.axis))
        np.testing.assert_allclose(data.body(link.name).xpos, at, atol=1e-12)
        np.testing.assert_allclose(data.body(link.name).xmat.reshape(3, 3), turn.as_matrix(), atol=1e-12)


@pytest.mark.parametrize("q", random_poses(6, seed=1))
def test_pivots_are_as_far_apart_as_the_cylinder_is_long(q):
    data = posed(q)
    for joint, angle in zip(ARM.joints, q, strict=True):
        if joint.actuator.kind != "linear":
            continue
        ends = [data.site(f"{joint.name}_pivot_{end}").xpos for end in ("parent", "child")]
        assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(joint.actuator.length(angle), abs=1e-10)
        tendon = MODEL.tendon(f"{joint.name}_cylinder").id
        jacobian = np.zeros((MODEL.ntendon, MODEL.nv))
        mujoco.mju_sparse2dense(
            jacobian, data.ten_J, MODEL.ten_J_rownnz, MODEL.ten_J_rowadr, MODEL.ten_J_colind
        )
        expected = np.zeros(MODEL.nv)
        expected[MODEL.joint(joint.name).dofadr] = joint.actuator.moment_arm(angle)
        np.testing.assert_allclose(jacobian[tendon], expected, atol=1e-9)


@pytest.mark.parametrize("q", random_poses(3, seed=2))
def test_holding_torques_are_the_slope_of_the_potential_energy(q):
    def energy(q):
        data = posed(q)
        return 9.81 * float(MODEL.body_mass @ data.xipos[:, 2])

    step = 1e-6
    slope = [(energy(q + step * e) - energy(q - step * e)) / (2 * step) for e in np.eye(7)]
    np.testing.assert_allclose(posed(q).qfrc_bias, slope, atol=1e-5)


@pytest.mark.parametrize("joint", ["shoulder", "elbow", "wrist"])
def test_positive_pitch_lifts_the_jaws(joint):
    angle = 0.1 * (np.array(ARM.joint_names) == joint)
    assert posed(angle).body("jaw_left").xipos[2] > posed(0 * angle).body("jaw_left").xipos[2] + 0.01


def test_a_positive_gripper_angle_opens_the_jaws():
    jaws = [posed([0, 0, 0, 0, 0, 0, angle]) for angle in (0.0, 0.5)]
    shut, wide = (np.linalg.norm(d.body("jaw_left").xipos - d.body("jaw_right").xipos) for d in jaws)
    assert wide > shut + 0.03


def test_motors_are_joint_torques_and_nothing_else_pushes():
    data = mujoco.MjData(MODEL)
    data.ctrl[:] = np.arange(1.0, 8.0)
    mujoco.mj_forward(MODEL, data)
    np.testing.assert_allclose(data.qfrc_actuator, data.ctrl)
    np.testing.assert_array_equal(data.qfrc_passive, 0)
    assert [MODEL.actuator(k).name for k in range(MODEL.nu)] == list(ARM.joint_names)


@pytest.mark.parametrize("pose", ARM.poses)
def test_every_pose_is_a_keyframe_without_contact(pose):
    data = mujoco.MjData(MODEL)
    mujoco.mj_resetDataKeyframe(MODEL, data, MODEL.key(pose).id)
    mujoco.mj_forward(MODEL, data)
    np.testing.assert_allclose(data.qpos, ARM.pose(pose), atol=1e-12)
    assert data.ncon == 0


def test_an_arm_in_the_floor_is_felt():
    data = posed([0, np.radians(-30), np.radians(-50), 0, 0, 0, 0])
    assert MODEL.geom("floor").id in data.contact.geom


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<joint name="elbow"', '<joint name="ellbow"', "MuJoCo refuses it|no joint 'elbow'"),
        ('joint="elbow"', 'joint="nowhere"', "MuJoCo refuses it .*nowhere"),
        ('body name="link5"', 'body name="link5b"', "no body 'link5'; it has: .*link5b"),
        ('<joint name="elbow"', '<joint type="slide" name="elbow"', "'elbow' must be a hinge"),
        ('<joint name="elbow"', '<joint name="extra"/><joint name="elbow"', "'extra' is not in the arm"),
        ("</mujoco>", "", "MuJoCo refuses it"),
        (
            "<contact>",
            '<equality><joint joint1="roll" joint2="wrist"/></equality><contact>',
            "equality constraints",
        ),
    ],
)
def test_a_model_that_does_not_fit_the_settings_is_refused_in_one_line(tmp_path, old, new, message):
    assert old in TEXT
    path = tmp_path / "mine.xml"
    text = TEXT.replace('meshdir="../meshes"', f'meshdir="{ARM.meshes}"')
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(ModelError, match=message) as caught:
        load_model(path, ARM)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_missing_model_names_the_command_that_writes_it(tmp_path):
    with pytest.raises(ModelError, match=r"no such model.*build-model"):
        load_model(tmp_path / "none.xml", ARM)


ROD = 0.05  # thickness [m]
LENGTHS, MASSES = {"base": 0.1, "upper": 0.6, "fore": 0.4}, {"upper": 3.0, "fore": 2.0}


def planar(folder):
    """Another arm: two rods that swing in a vertical plane."""
    for name, length in LENGTHS.items():
        rod = trimesh.creation.box(extents=(length, ROD, ROD))
        rod.apply_translation((length / 2, 0, 0))
        (folder / f"{name}.stl").write_bytes(rod.export(file_type="stl"))
    joint = {"axis": [0, -1, 0], "actuator": {"kind": "rotary", "displacement": 5, "max_opening": 0.1}}
    return Arm.model_validate(
        {
            "name": "planar",
            "model": folder / "planar.xml",
            "meshes": folder,
            "base": {"mesh": "base.stl"},
            "links": [{"name": name, "mesh": f"{name}.stl", "mass": mass} for name, mass in MASSES.items()],
            "joints": [
                {"name": "one", "at": [0, 0, 0], "range": [-90, 90], **joint},
                {"name": "two", "at": [LENGTHS["upper"], 0, 0], "range": [-150, 0], **joint},
            ],
            "poses": {"bent": [30, -45]},
        }
    )


def test_another_arm_is_another_file(tmp_path):
    """Its mass matrix is the textbook's."""
    arm = planar(tmp_path)
    write_model(arm, arm.model)
    model = load_model(arm.model, arm).compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    found = np.zeros((2, 2))
    mujoco.mj_fullM(model, data, found)

    (m1, m2), l1, l2 = MASSES.values(), LENGTHS["upper"], LENGTHS["fore"]
    c = m2 * l1 * (l2 / 2) * np.cos(np.radians(-45))
    far = m2 * (l2**2 + ROD**2) / 12 + m2 * l2**2 / 4
    near = m1 * (l1**2 + ROD**2) / 12 + m1 * l1**2 / 4 + m2 * l1**2 + far + 2 * c
    np.testing.assert_allclose(found, [[near, far + c], [far + c, far]], rtol=1e-6)


def test_a_mesh_that_mujoco_cannot_read_is_one_line(tmp_path):
    arm = planar(tmp_path)
    rod = trimesh.load(tmp_path / "fore.stl", force="mesh")
    (tmp_path / "fore.stl").write_text(rod.export(file_obj=None, file_type="stl_ascii"))
    with pytest.raises(MeshError, match=r"fore\.stl: is an ASCII STL") as caught:
        build_model(arm)
    assert "\n" not in str(caught.value)
