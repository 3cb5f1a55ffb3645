"""Two arms on one carrier: each is the other's mirror image, and neither feels the other."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from hydroid.arm.model import SIDES, Machine, load_machine
from hydroid.errors import ModelError, SettingsError
from hydroid.settings.arm import Arm

MIRROR = np.array([1.0, -1.0, 1.0])


@pytest.fixture(scope="module")
def machine(arm: Arm) -> Machine:
    return load_machine(arm, pair=True)


def stepped(machine: Machine, torque: np.ndarray) -> tuple[mujoco.MjData, np.ndarray]:
    """Data after some steps under torques [N·m], shape (T, 14), and the angles on the way, shape (T, 14)."""
    model = machine.model
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    model.dof_damping[:] = 20.0
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


def test_mirrored_commands_give_mirrored_motion(machine: Machine, arm: Arm):
    data, angle = stepped(machine, np.tile(torques(300), 2))
    right, left = np.split(angle, 2, axis=1)
    assert np.ptp(right, axis=0).min() > 0.02
    np.testing.assert_allclose(left, right, rtol=0, atol=1e-9)
    for name in arm.link_names:
        one, other = (data.body(f"{side}_{name}") for side in SIDES)
        np.testing.assert_allclose(other.xipos, one.xipos * MIRROR, atol=1e-9)
    corners = {side: vertices(machine.model, data, side) for side in SIDES}  # what is seen and what collides
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
        full, single = np.zeros((14, 14)), np.zeros((7, 7))
        mujoco.mj_fullM(machine.model, data, full)
        mujoco.mj_fullM(alone, one, single)
        np.testing.assert_allclose(full, np.kron(np.eye(2), single), atol=1e-9)


def test_an_arm_that_names_no_pair_or_another_model_says_how(arm: Arm):
    with pytest.raises(SettingsError, match=r"stands alone.*pair: MODEL"):
        load_machine(replace(arm, file=arm.file.model_copy(update={"pair": None})), pair=True)
    with pytest.raises(ModelError, match=r"not the model of two of the arm; the joints .* right_azimuth"):
        load_machine(replace(arm, file=arm.file.model_copy(update={"pair": arm.model})), pair=True)
