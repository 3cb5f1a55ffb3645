import mujoco
import numpy as np
import pytest
from arms import BOOM, posed, with_masses, write_arm
from hypothesis import given, settings, strategies as st
from mujoco.batch import Batch

from hydroid.arm.export import locked_spec
from hydroid.arm.locked import lock
from hydroid.arm.model import load_model
from hydroid.settings.arm import load_arm

ARM = load_arm("hydrolek")
SPEC = load_model(ARM)
J, L = len(ARM.joint_names), len(ARM.link_names)


def locked_arm(spec, arm, moving, pose):
    return lock(spec, arm, np.isin(arm.joint_names, moving), pose)


def locked_model(locked, masses):
    model, inertials = locked.model, locked.inertials(masses[None])
    for field, value in inertials.items():
        getattr(model, field)[:] = value[0]
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def random_state(rng):
    span = np.where(np.isinf(ARM.upper), np.pi, ARM.upper - ARM.lower)
    start = np.where(np.isinf(ARM.lower), -np.pi / 2, ARM.lower)
    return (
        start + span * rng.uniform(0.02, 0.98, J),
        rng.normal(size=J),
        50 * rng.normal(size=J),
    )


def constrained(masses, q, v, tau, moving):
    """Accelerations and bias of the moving joints of the whole arm, others held: M_ff
    a_f = τ_f - bias_f."""
    model = with_masses(ARM, masses)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[moving] = q, v[moving]
    mujoco.mj_forward(model, data)
    inertia = np.zeros((J, J))
    mujoco.mj_fullM(model, data, inertia)
    bias = data.qfrc_bias[moving]
    return np.linalg.solve(inertia[np.ix_(moving, moving)], tau[moving] - bias), bias


@settings(max_examples=40, deadline=None)
@given(
    moving=st.sets(st.integers(0, J - 1), min_size=1), seed=st.integers(0, 2**32 - 1)
)
def test_moves_like_the_whole_arm_with_the_other_joints_held(moving, seed):
    rng = np.random.default_rng(seed)
    moving = sorted(moving)
    masses = ARM.masses * rng.uniform(0.1, 5, L)
    q, v, tau = random_state(rng)
    expected, bias = constrained(masses, q, v, tau, moving)

    model = locked_model(lock(SPEC, ARM, np.isin(range(J), moving), q), masses)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q[moving], v[moving], tau[moving]
    mujoco.mj_forward(model, data)

    scale = np.abs(bias).max() + np.abs(tau).max()
    np.testing.assert_allclose(data.qfrc_bias, bias, rtol=1e-9, atol=1e-11 * scale)
    np.testing.assert_allclose(
        data.qacc, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max()
    )


def test_what_a_users_model_says_of_its_joints_is_kept():
    spec = SPEC.copy()
    wrist = spec.joint("wrist")
    wrist.armature, wrist.frictionloss, wrist.springref, wrist.ref = (
        0.3,
        1.5,
        20.0,
        10.0,
    )
    wrist.damping[0], wrist.stiffness[0] = 7.0, 11.0
    whole, part = spec.compile(), locked_arm(spec, ARM, ["wrist"], np.zeros(J)).model
    for field in (
        "dof_armature",
        "dof_frictionloss",
        "dof_damping",
        "jnt_stiffness",
        "qpos_spring",
        "qpos0",
    ):
        assert getattr(part, field)[0] == getattr(whole, field)[4] != 0, field


def test_a_batch_follows_principal_axes_that_change_places(tmp_path):
    """Two blocks on one hinge: which axis is the longest depends on their masses."""
    blocks = {"a": (0.3, 0.2, 0.1), "b": (0.1, 0.2, 0.5)}
    half = {
        name: " ".join(str(length / 2) for length in size)
        for name, size in blocks.items()
    }
    arm = write_arm(
        tmp_path,
        f"""<mujoco><worldbody><body name="a"><joint name="j" axis="0 -1 0" range="-90 90"/>
        <geom type="box" size="{half["a"]}" mass="1"/>
        <body name="b"><geom type="box" size="{half["b"]}" mass="1"/></body></body></worldbody></mujoco>""",
    )
    locked = lock(load_model(arm), arm, np.ones(1, bool), np.zeros(1))
    masses = np.array([[1, 1], [5, 0.01], [0.01, 5], [100, 0.001]])
    batch, inertials = Batch(locked.model, nsim=4, nthread=1), locked.inertials(masses)
    for field, value in inertials.items():
        batch.expand(field)[:] = value
    batch.set_const()
    acceleration = batch.bind("qacc")
    batch.qfrc_applied = np.ones((4, 1))
    batch.forward()
    per_mass = [(x**2 + z**2) / 12 for x, _, z in (blocks["a"], blocks["b"])]
    np.testing.assert_allclose(acceleration[:, 0], 1 / (masses @ per_mass), rtol=1e-6)


@pytest.mark.parametrize("moving", [["lift"], ["tilt"]])
def test_the_export_stands_where_the_whole_arm_does(tmp_path, moving):
    """Also bodies in frames, turned by angles; only drawings are left of tendons, and
    no limits of motors."""
    bar = (
        BOOM[BOOM.index('<body name="bar"') : BOOM.index("</body>\n      </body>")]
        + "</body>"
    )
    turned = bar.replace(
        'name="bar" pos="6 0 0"', 'name="bar" pos="1 0 0" euler="0 20 0"'
    )
    frame = f'<frame pos="5 0 1" euler="30 0 0"><site name="eye"/>{turned}</frame>'
    fixed = '<tendon><fixed><joint joint="tilt" coef="1"/></fixed></tendon></mujoco>'
    arm = write_arm(tmp_path, BOOM.replace(bar, frame).replace("</mujoco>", fixed))
    spec, pose = load_model(arm), np.array([0.3, -0.4])
    for joint in spec.joints:
        joint.actfrclimited, joint.actfrcrange = (
            mujoco.mjtLimited.mjLIMITED_TRUE,
            [-1, 1],
        )
    locked, whole = locked_arm(spec, arm, moving, pose), spec.compile()
    model = locked_spec(spec, locked, locked.model, np.empty((2, 0))).compile()
    here, there = posed(model, locked.pose), posed(whole, pose)
    assert (model.njnt, model.ntendon, model.jnt_actfrclimited[0]) == (1, 0, 0)
    places = (d.geom_xpos[np.argsort(d.geom_xpos[:, 0])] for d in (here, there))
    np.testing.assert_allclose(*places, atol=1e-9)
    np.testing.assert_allclose(here.site_xpos, there.site_xpos, atol=1e-9)
    np.testing.assert_allclose(
        here.qfrc_bias, there.qfrc_bias[locked.columns], atol=1e-6
    )
