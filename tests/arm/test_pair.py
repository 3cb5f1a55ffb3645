"""Two arms on one carrier: each is the other's mirror image, and neither feels the other."""

import mujoco
import numpy as np
import pytest

from hydroid.arm.machine import Machine, load_machine
from hydroid.arm.pair import SIDES, build_pair, mirror, write_pair
from hydroid.errors import SettingsError
from hydroid.settings.arm import Arm

MIRROR = np.array([1.0, -1.0, 1.0])


@pytest.fixture(scope="module")
def machine(arm: Arm) -> Machine:
    return load_machine(arm, pair=True)


def stepped(machine: Machine, torque: np.ndarray, damping: float = 0.0) -> tuple[mujoco.MjData, np.ndarray]:
    """Data after some steps under torques [N·m], shape (T, 14), and the angles on the way, shape (T, 14)."""
    model = machine.model
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    model.dof_damping[:] = damping
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("study").id)
    angle = []
    for now in torque:
        data.ctrl[:] = now
        mujoco.mj_step(model, data)
        angle.append(data.qpos.copy())
    mujoco.mj_forward(model, data)
    return data, np.array(angle)


def torques(samples: int) -> np.ndarray:
    """Smooth torques of seven joints [N·m], shape (samples, 7)."""
    time = 0.01 * np.arange(samples)[:, None]
    return np.array([60, 150, 80, 5, 15, 2, 1]) * np.sin(2 * time + np.arange(7))


def test_mirrored_commands_give_mirrored_motion(machine: Machine):
    data, angle = stepped(machine, np.tile(torques(300), 2), damping=20.0)
    right, left = np.split(angle, 2, axis=1)
    assert np.ptp(right, axis=0).min() > 0.02
    np.testing.assert_allclose(left, right, rtol=0, atol=1e-9)
    for name in ("link1", "link2", "link3", "link4", "link5", "link6", "jaw_left", "jaw_right"):
        one, other = (data.body(f"{side}_{name}") for side in SIDES)
        np.testing.assert_allclose(other.xipos, one.xipos * MIRROR, atol=1e-9)
        spin, back = one.cvel, other.cvel  # rotation, a pseudovector, then translation
        np.testing.assert_allclose(back[:3], -spin[:3] * MIRROR, atol=1e-9)
    model = machine.model
    for k in range(model.ngeom):  # what is seen and what collides too
        if not model.geom(k).bodyid[0] or model.body(model.geom_bodyid[k]).name == "carrier":
            continue
    corners = {side: vertices(machine.model, data, side) for side in SIDES}
    gap = np.linalg.norm(corners["left"][:, None] - (corners["right"] * MIRROR)[None], axis=2)
    assert gap.min(axis=0).max() < 1e-6


def vertices(model: mujoco.MjModel, data: mujoco.MjData, side: str) -> np.ndarray:
    """A few vertices of an arm's meshes in the world [m], shape (V, 3)."""
    found = []
    for k in range(model.ngeom):
        body = model.body(model.geom_bodyid[k]).name
        if model.geom_type[k] == mujoco.mjtGeom.mjGEOM_MESH and body.startswith(side):
            mesh = model.geom_dataid[k]
            first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
            turn = data.geom_xmat[k].reshape(3, 3)
            found.append(model.mesh_vert[first : first + count : 50] @ turn.T + data.geom_xpos[k])
    return np.vstack(found)


def test_an_arm_rests_beside_a_moving_one(machine: Machine):
    model = machine.model
    still = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, still, model.key("study").id)
    mujoco.mj_forward(model, still)
    hold = still.qfrc_bias[7:]
    torque = np.hstack([torques(200), np.tile(hold, (200, 1))])
    _, angle = stepped(machine, torque, damping=20.0)
    assert np.ptp(angle[:, :7], axis=0).max() > 0.1
    assert np.abs(angle[:, 7:] - still.qpos[7:]).max() < 1e-9


def test_energy_is_what_the_motors_gave(machine: Machine):
    """Without dampers; the error falls with the step as Euler's does."""
    model, errors, flags = machine.model, [], machine.model.opt.disableflags
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    model.dof_damping[:] = 0.0
    off = mujoco.mjtDisableBit
    model.opt.disableflags |= off.mjDSBL_CONTACT | off.mjDSBL_LIMIT
    for step in (1e-3, 5e-4):
        model.opt.timestep = step
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, model.key("study").id)
        mujoco.mj_forward(model, data)
        begin, work = data.energy.sum(), 0.0
        for _ in range(round(0.5 / step)):
            data.ctrl[:] = [60, 200, 80, 5, 15, 2, 1, -30, 250, 60, 2, 10, 1, 0.5]
            before = data.qpos.copy()
            mujoco.mj_step(model, data)
            work += data.ctrl @ (data.qpos - before)
        mujoco.mj_forward(model, data)
        errors.append(abs(data.energy.sum() - begin - work) / data.energy[1])
    model.opt.timestep, model.opt.disableflags = 0.01, flags
    assert errors[0] < 0.05
    assert errors[1] < 0.6 * errors[0]


def test_each_arm_is_the_one_that_stands_alone(machine: Machine, arm: Arm, spec: mujoco.MjSpec):
    """Its gravity and inertia, on both sides."""
    alone, data = spec.compile(), mujoco.MjData(machine.model)
    one = mujoco.MjData(alone)
    rng = np.random.default_rng(1)
    for _ in range(3):
        pose = rng.uniform(np.maximum(arm.lower, -3), np.minimum(arm.upper, 3))
        one.qpos[:], data.qpos[:] = pose, np.tile(pose, 2)
        mujoco.mj_forward(alone, one)
        mujoco.mj_forward(machine.model, data)
        np.testing.assert_allclose(data.qfrc_bias, np.tile(one.qfrc_bias, 2), atol=1e-9)
        full = np.zeros((14, 14))
        mujoco.mj_fullM(machine.model, data, full)
        single = np.zeros((7, 7))
        mujoco.mj_fullM(alone, one, single)
        np.testing.assert_allclose(full, np.kron(np.eye(2), single), atol=1e-9)


def test_the_committed_model_is_the_one_that_is_built(machine: Machine, arm: Arm):
    assert arm.pair is not None
    committed = mujoco.MjModel.from_xml_path(str(arm.pair.model))
    for name in ("body_mass", "body_pos", "body_inertia", "jnt_axis", "jnt_range", "geom_pos", "key_qpos"):
        np.testing.assert_allclose(getattr(committed, name), getattr(machine.model, name), atol=1e-9)
    assert committed.nexclude == machine.model.nexclude


def test_it_is_written_with_meshes_that_are_found(arm: Arm, spec: mujoco.MjSpec, tmp_path):
    assert arm.pair is not None
    pair = arm.pair.model_copy(update={"model": tmp_path / "dual.xml"})
    path = write_pair(spec, arm.model_copy(update={"pair": pair}))
    assert str(tmp_path) not in path.read_text()
    assert mujoco.MjModel.from_xml_path(str(path)).nq == 14


def test_orientations_of_every_kind_are_mirrored():
    """A user's own model may turn bodies by Euler angles, and hold frames and shapes of all kinds."""
    text = """<mujoco><worldbody><frame euler="10 20 30"><body name="a" pos="1 2 3" euler="40 -50 60">
      <joint axis="1 2 3" pos="0.1 0.2 0.3"/><geom type="capsule" size="0.1" fromto="0 0 0 1 2 3"/>
      <body name="b" pos="1 1 1" axisangle="1 2 3 40"><joint axis="0 1 1"/>
      <geom type="box" size="1 2 3" pos="3 2 1" xyaxes="1 1 0 -1 1 0" density="3"/>
      <site name="s" pos="1 2 3"/></body></body></frame></worldbody></mujoco>"""
    spec = mujoco.MjSpec.from_string(text)
    one = spec.compile()
    other_spec = mujoco.MjSpec.from_string(text)
    mirror(other_spec)
    other = other_spec.compile()
    here, there = mujoco.MjData(one), mujoco.MjData(other)
    here.qpos[:] = there.qpos[:] = [0.3, -0.7]
    here.qvel[:] = there.qvel[:] = [1.0, 2.0]
    mujoco.mj_forward(one, here)
    mujoco.mj_forward(other, there)
    for name in ("xipos", "geom_xpos", "site_xpos"):
        np.testing.assert_allclose(getattr(there, name), getattr(here, name) * MIRROR, atol=1e-9)
    np.testing.assert_allclose(there.qfrc_bias, here.qfrc_bias, atol=1e-9)
    np.testing.assert_allclose(there.M, here.M, atol=1e-9)


def test_an_arm_that_names_no_pair_says_how(arm: Arm, spec: mujoco.MjSpec):
    with pytest.raises(SettingsError, match=r"stands alone.*add pair"):
        build_pair(spec, arm.model_copy(update={"pair": None}))
    with pytest.raises(SettingsError, match="stands alone"):
        load_machine(arm.model_copy(update={"pair": None}), pair=True)
