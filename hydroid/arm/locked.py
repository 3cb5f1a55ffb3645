"""The smallest model that moves exactly like the arm with some of its joints locked.

A locked joint makes its link one rigid body with the link before it. `lock` builds the
model of those rigid bodies, and `LockedArm.inertials` gives their mass, centre and
inertia for any masses of the links, by Steiner's theorem; links that cannot move at all
become part of the world and drop out. With every joint moving nothing but the fixed
parts is fused, and the result is the whole arm without shapes or contacts.
"""

from collections.abc import Sequence
from typing import Any, cast

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from hydroid.arrays import Array, Index, Mask, record
from hydroid.mjcf import quiet_mujoco
from hydroid.settings.arm import Arm

_OPTIONS = (
    "timestep", "gravity", "integrator", "solver", "iterations", "tolerance", "jacobian",
    "enableflags"
)  # fmt: skip
_JOINT_FIELDS = (
    "jnt_range", "jnt_limited", "jnt_margin", "jnt_solref", "jnt_solimp", "jnt_stiffness",
    "jnt_stiffnesspoly", "dof_solref", "dof_solimp", "dof_damping", "dof_dampingpoly",
    "dof_armature", "dof_frictionloss", "qpos0", "qpos_spring"
)  # fmt: skip


_OFF = mujoco.mjtDisableBit
IDLE = (
    # looking for what the chain lacks takes a tenth of a step
    _OFF.mjDSBL_ACTUATION
    | _OFF.mjDSBL_SENSOR
    | _OFF.mjDSBL_EQUALITY
    | _OFF.mjDSBL_CONTACT
    # a diverged candidate must stay diverged
    | _OFF.mjDSBL_AUTORESET
    # which are taken for all arms of a model or for none
    | _OFF.mjDSBL_ISLAND
    | _OFF.mjDSBL_WARMSTART
)
"""what a simulation of the chain does not need, as MuJoCo's flags"""


PART = np.dtype(
    [
        ("body", int),
        ("column", int),
        ("mass", float),
        ("centre", float, 3),
        ("inertia", float, (3, 3)),
    ]
)
"""a link, or another body of the model, as a rigid part of a fused body and in its
frame: that body; the column of its mass in `masses`, -1 where no setting names it; its
mass in the model [kg]; its centre [m]; its inertia about that for 1 kg [m²]"""


@record
class LockedArm:
    """A model with only the moving joints, and the way from link masses to its
    bodies."""

    model: mujoco.MjModel
    """one body per moving joint, no actuator: torques go to qfrc_applied [N·m];
    contacts, auto-reset off"""
    joints: tuple[str, ...]  # the moving joints in the order of qpos and qvel, (V,)
    columns: Index  # the same among the arm's joints, 0-based, shape (V,)
    pose: Array  # where they start [rad], shape (V,)
    parts: Any  # what the bodies consist of, (P,) of PART
    held: dict[str, tuple[Array, Array]]
    """place in its parent of a locked joint's body, by name: [m], (3,), and a
    quaternion (w, x, y, z)"""

    def inertials(self, masses: Array) -> dict[str, Array]:
        """Fuse links of some masses [kg], shape (n, L); row k depends on masses[k]
        alone, to the last bit.

        Returns:
            The fields of mjModel that describe the B bodies, the world first: body_mass
            [kg], shape (n, B); body_ipos [m], shape (n, B, 3); body_iquat (w, x, y, z),
            shape (n, B, 4); body_inertia [kg·m²], shape (n, B, 3).
        """
        shapes = (len(masses), self.model.nbody)
        part = self.parts
        body_of_part = cast(Any, (slice(None), part.body))
        weight = np.where(part.column < 0, part.mass, masses[:, part.column])
        mass = np.zeros(shapes)
        np.add.at(mass, body_of_part, weight)
        centre = np.zeros((*shapes, 3))
        np.add.at(centre, body_of_part, weight[..., None] * part.centre)
        centre[:, 1:] /= mass[:, 1:, None]
        # Steiner's theorem, from each part's centre to that of its body
        away = part.centre - centre[:, part.body]
        square = np.sum(away * away, axis=-1)[..., None, None]
        outer = away[..., :, None] * away[..., None, :]
        moved = square * np.eye(3) - outer
        per_mass = part.inertia + moved
        tensor = np.zeros((*shapes, 3, 3))
        np.add.at(tensor, body_of_part, weight[..., None, None] * per_mass)
        inertia, axes = np.linalg.eigh(tensor)
        # the axes form a right-handed frame: no quaternion is a reflection
        handed = np.sign(np.linalg.det(axes))
        axes[..., 2] *= handed[..., None]
        scalar_last = Rotation.from_matrix(axes.reshape(-1, 3, 3)).as_quat()
        quaternion = np.roll(scalar_last, 1, axis=-1).reshape(*shapes, 4)
        return {
            "body_mass": mass,
            "body_ipos": centre,
            "body_iquat": quaternion,
            "body_inertia": inertia,
        }


def lock(spec: mujoco.MjSpec, arm: Arm, moving: Mask, pose: Array) -> LockedArm:
    """Lock all joints of an arm's model but the `moving` ones, (J,), one at least.

    `pose` has the angles [rad], shape (J,), in the order of `arm.joint_names`;
    a moving joint's is its start.
    """
    names = np.array(arm.joint_names)
    columns = np.flatnonzero(moving)
    fixed = np.flatnonzero(~moving)
    with quiet_mujoco():
        full = spec.compile()
    data = mujoco.MjData(full)
    for joint in fixed:
        data.joint(names[joint]).qpos[0] = pose[joint]
    mujoco.mj_kinematics(full, data)
    held = dict[str, tuple[Array, Array]]()
    for name in names[fixed]:
        body = int(full.joint(name).bodyid[0])
        above = int(full.body_parentid[body])
        held[full.body(body).name] = _place(data, body, above)
    joints = tuple(names[columns].tolist())
    model, parts = _fused(full, data, arm, joints)
    locked = LockedArm(model, joints, columns, pose[columns], parts, held)
    for name, value in locked.inertials(arm.masses[None]).items():
        getattr(model, name)[:] = value[0]
    with quiet_mujoco():
        mujoco.mj_setConst(model, mujoco.MjData(model))
    return locked


def _place(data: mujoco.MjData, body: int, above: int) -> tuple[Array, Array]:
    """Return a body's place in another's frame: [m], (3,), and a quaternion (w, x, y,
    z)."""
    turn = np.empty(4)
    # the conjugate of a unit quaternion is its inverse
    inverse = data.xquat[above] * [1, -1, -1, -1]
    mujoco.mju_mulQuat(turn, inverse, data.xquat[body])
    frame = data.xmat[above].reshape(3, 3)
    away = data.xpos[body] - data.xpos[above]
    return frame.T @ away, turn


def _fused(
    full: mujoco.MjModel, data: mujoco.MjData, arm: Arm, joints: Sequence[str]
) -> tuple[mujoco.MjModel, Any]:
    """Return the chain of bodies that joints move, without what they weigh,
    and every body that is part of them."""
    column_of = dict[int, int]()
    for column, name in enumerate(arm.link_names):
        column_of[full.body(name).id] = column
    moved = dict[int, Any]()
    for joint in map(full.joint, joints):
        moved[int(joint.bodyid[0])] = joint
    spec = mujoco.MjSpec()
    bodies = [spec.worldbody]
    # the body of `full` that each of `bodies` is
    kept = [0]
    # place in `bodies` of what each body of `full` is part of
    carriers = list[int]()
    parts = list[tuple[Any, ...]]()
    for number, parent in enumerate(full.body_parentid):
        carrier = 0
        if number:
            carrier = carriers[parent]
        if number in moved:
            position, turn = _place(data, number, kept[carrier])
            name = full.body(number).name
            bodies.append(_add(bodies[carrier], name, position, turn, moved[number]))
            kept.append(number)
            carrier = len(kept) - 1
        carriers.append(carrier)
        # the world, and what cannot move, weighs nothing in a simulation
        if carrier and full.body_mass[number]:
            # -1: no link whose mass a parameter may set
            column = column_of.get(number, -1)
            inertial = _part(full, data, number, kept[carrier])
            parts.append((carrier, column, *inertial))
    with quiet_mujoco():
        model = spec.compile()
    _take_over(model, full, [moved[number].id for number in kept[1:]])
    model.opt.disableflags = full.opt.disableflags | IDLE
    return model, np.array(parts, PART).view(np.recarray)


def _part(
    full: mujoco.MjModel, data: mujoco.MjData, body: int, carrier: int
) -> tuple[float, Array, Array]:
    """Return a body's mass [kg], its centre [m], (3,), and its inertia for 1 kg [m²],
    (3, 3), in the frame of the body that it is part of."""
    mass = float(full.body_mass[body])
    inverse = data.xmat[carrier].reshape(3, 3).T
    axes = inverse @ data.ximat[body].reshape(3, 3)
    centre = inverse @ (data.xipos[body] - data.xpos[carrier])
    principal = full.body_inertia[body] / mass
    inertia = (axes * principal) @ axes.T
    return mass, centre, inertia


def repeat(model: mujoco.MjModel, copies: int) -> mujoco.MjModel:
    """Return a `LockedArm`'s model as often as asked for, side by side;
    bodies weigh nothing in particular.

    None changes a bit of another, and a step of many costs little more than a step of
    one.
    """
    spec = mujoco.MjSpec()
    for copy in range(copies):
        bodies = [spec.worldbody]
        # each joint has a body of its own
        for number, joint in enumerate(map(model.joint, range(model.njnt)), 1):
            body = model.body(number)
            above = bodies[body.parentid[0]]
            name = f"{body.name} {copy}"
            bodies.append(_add(above, name, body.pos, body.quat, joint, copy))
    with quiet_mujoco():
        repeated = spec.compile()
    # as they are in the model, to the last bit
    repeated.body_pos[1:] = np.tile(model.body_pos[1:], (copies, 1))
    repeated.body_quat[1:] = np.tile(model.body_quat[1:], (copies, 1))
    _take_over(repeated, model, [*range(model.njnt)] * copies)
    repeated.stat.meaninertia = model.stat.meaninertia
    # each copy is an island of constraints of its own, and is solved apart
    islands = int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
    repeated.opt.disableflags = model.opt.disableflags & ~islands
    return repeated


def _add(
    above: Any,
    name: str,
    position: Array,
    turn: Array,
    joint: Any,
    copy: int | str = "",
) -> Any:
    """Add a body to another that moves like a model's joint, without what it weighs."""
    body = above.add_body(
        name=name,
        pos=position,
        quat=turn,
        # MuJoCo's short cut for aligned inertias, which other masses would break
        simple=False,
        explicitinertial=True,
        mass=1.0,
        inertia=[1.0, 1.0, 1.0],
    )
    body.add_joint(
        name=f"{joint.name}{copy}", type=joint.type[0], pos=joint.pos, axis=joint.axis
    )
    return body


def _take_over(
    model: mujoco.MjModel, source: mujoco.MjModel, ids: Sequence[int]
) -> None:
    for name in _JOINT_FIELDS:
        getattr(model, name)[:] = getattr(source, name)[ids]
    for name in _OPTIONS:
        setattr(model.opt, name, getattr(source.opt, name))
