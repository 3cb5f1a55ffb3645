"""The smallest model that moves exactly like the arm with some of its joints locked.

A locked joint makes its link one rigid body with the link before it. `lock` builds the model of those
rigid bodies, and `LockedArm.inertials` gives their mass, centre and inertia for any masses of the links, by
Steiner's theorem; links that cannot move at all become part of the world and drop out. With every joint
moving nothing but the fixed parts is fused, and the result is the whole arm without shapes or contacts.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from hydroid.arm.quiet import quiet_mujoco
from hydroid.errors import ModelError
from hydroid.settings.arm import Arm

Array = NDArray[np.float64]

_OPTIONS = [
    "timestep",
    "gravity",
    "integrator",
    "solver",
    "iterations",
    "tolerance",
    "jacobian",
    "enableflags",
]
_JOINT_FIELDS = ["range", "limited", "margin", "solref", "solimp", "stiffness", "stiffnesspoly"]
_DOF_FIELDS = ["damping", "dampingpoly", "armature", "frictionloss", "solref", "solimp"]


@dataclass(frozen=True)
class _Part:
    """A link, or another body of the model, as a rigid part of a fused body and in its frame."""

    body: int
    """the fused body"""
    column: int | None
    """of its mass in `masses`; None where no setting names it"""
    mass: float
    """in the model [kg]"""
    centre: Array
    """[m], shape (3,)"""
    inertia: Array
    """about its centre, for 1 kg [m²], shape (3, 3)"""


@dataclass(frozen=True)
class LockedArm:
    """A model with only the moving joints, and the way from link masses to its bodies."""

    model: mujoco.MjModel
    """one body per moving joint, no actuator: torques go to qfrc_applied [N·m]; contacts, auto-reset off"""
    joints: tuple[str, ...]
    """the moving joints in the order of qpos and qvel, (V,)"""
    columns: NDArray[np.intp]
    """the same among the arm's joints, 0-based, shape (V,)"""
    pose: Array
    """where they start [rad], shape (V,)"""
    parts: tuple[_Part, ...]

    def inertials(self, masses: Array) -> dict[str, Array]:
        """Fuse the links; row k depends on masses[k] alone, to the last bit.

        Args:
            masses: of the links [kg], shape (n, L), columns as in `Arm.link_names`.

        Returns:
            The fields of mjModel that describe the B bodies, the world first: body_mass [kg], shape (n, B);
            body_ipos [m], shape (n, B, 3); body_iquat (w, x, y, z), shape (n, B, 4); body_inertia [kg·m²],
            shape (n, B, 3).
        """
        n, bodies = len(masses), self.model.nbody
        weights = [np.full(n, p.mass) if p.column is None else masses[:, p.column] for p in self.parts]
        mass = np.zeros((n, bodies))
        ipos = np.zeros((n, bodies, 3))
        tensor = np.zeros((n, bodies, 3, 3))
        for part, weight in zip(self.parts, weights, strict=True):
            mass[:, part.body] += weight
            ipos[:, part.body] += weight[:, None] * part.centre
        ipos[:, 1:] /= mass[:, 1:, None]
        for part, weight in zip(self.parts, weights, strict=True):
            away = part.centre - ipos[:, part.body]
            tensor[:, part.body] += weight[:, None, None] * (part.inertia + _steiner(away))
        inertia, iquat = _principal(tensor)
        return {"body_mass": mass, "body_ipos": ipos, "body_iquat": iquat, "body_inertia": inertia}


class Fusion:
    """Which bodies move as one while some joints are locked.

    Args:
        spec: the arm's model, as `load_model` returns it.
        arm: its settings, which name joints and links.
        moving: names of the joints that stay, in any order.
        pose: angles [rad], shape (J,), in the order of `arm.joint_names`; a moving joint's is ignored.

    Attributes:
        joints: the moving joints in the arm's order.
        kept: bodies that remain, the world first.
        carrier: for each body the kept body that it moves with.

    Raises:
        ModelError: nothing to move, or a name that is no joint.
    """

    def __init__(self, spec: mujoco.MjSpec, arm: Arm, moving: Sequence[str], pose: Array) -> None:
        self.joints = tuple(name for name in arm.joint_names if name in moving)
        if not self.joints or len(self.joints) < len(set(moving)):
            wrong = sorted(set(moving) - set(self.joints))
            what = f"no joint is named {wrong[0]!r}" if wrong else "no joint is left to move"
            raise ModelError(what, where=arm.name, hint=f"joints: {', '.join(arm.joint_names)}")
        with quiet_mujoco():
            self.full = spec.compile()
        self.data = mujoco.MjData(self.full)
        for name, angle in zip(arm.joint_names, pose, strict=True):
            if name not in self.joints:
                self.data.joint(name).qpos[0] = angle
        mujoco.mj_kinematics(self.full, self.data)
        self.kept = [0, *(int(self.full.joint(name).bodyid[0]) for name in self.joints)]
        self.carrier: list[int] = []
        for body in range(self.full.nbody):
            parent = self.full.body_parentid[body]
            self.carrier.append(body if body in self.kept else self.carrier[parent])

    def place(self, body: int, carrier: int) -> tuple[Array, Array]:
        """Return position [m] and quaternion (w, x, y, z) of a body in a carrier's frame."""
        data, turn = self.data, np.empty(4)
        mujoco.mju_mulQuat(turn, data.xquat[carrier] * [1, -1, -1, -1], data.xquat[body])
        return data.xmat[carrier].reshape(3, 3).T @ (data.xpos[body] - data.xpos[carrier]), turn


def lock(spec: mujoco.MjSpec, arm: Arm, moving: Sequence[str], pose: Array) -> LockedArm:
    """Lock all joints but the moving ones; arguments and errors as of `Fusion`.

    Raises:
        ModelError: also a body without mass.
    """
    fusion = Fusion(spec, arm, moving, pose)
    columns = np.array([arm.joint_names.index(name) for name in fusion.joints])
    locked = LockedArm(_skeleton(fusion), fusion.joints, columns, pose[columns], _parts(fusion, arm))
    masses = np.array([fusion.full.body(name).mass[0] for name in arm.link_names])
    for name, value in locked.inertials(masses[None]).items():
        getattr(locked.model, name)[:] = value[0]
    with quiet_mujoco():
        mujoco.mj_setConst(locked.model, mujoco.MjData(locked.model))
    return locked


def _parts(fusion: Fusion, arm: Arm) -> tuple[_Part, ...]:
    """Every body that moves and has mass, seen from its carrier."""
    full, data = fusion.full, fusion.data
    column = {full.body(name).id: place for place, name in enumerate(arm.link_names)}
    parts: list[_Part] = []
    for body, carrier in enumerate(fusion.carrier):
        mass = float(full.body_mass[body])
        if carrier == 0 or (mass == 0 and body not in column):
            continue
        if mass == 0:
            raise ModelError(f"body {full.body(body).name!r} has no mass", where=arm.name)
        frame = data.xmat[carrier].reshape(3, 3)
        axes = frame.T @ data.ximat[body].reshape(3, 3)
        centre = frame.T @ (data.xipos[body] - data.xpos[carrier])
        inertia = (axes * (full.body_inertia[body] / mass)) @ axes.T
        parts.append(_Part(fusion.kept.index(carrier), column.get(body), mass, centre, inertia))
    for place, body in enumerate(fusion.kept[1:], start=1):
        if all(part.body != place for part in parts):
            raise ModelError(f"body {full.body(body).name!r} moves and has no mass", where=arm.name)
    return tuple(parts)


def _skeleton(fusion: Fusion) -> mujoco.MjModel:
    """The chain of kept bodies with the joints' properties; what it weighs is still to be written."""
    full, spec = fusion.full, mujoco.MjSpec()
    bodies = {0: spec.worldbody}
    for name, body in zip(fusion.joints, fusion.kept[1:], strict=True):
        parent = fusion.carrier[full.body_parentid[body]]
        position, turn = fusion.place(body, parent)
        bodies[body] = bodies[parent].add_body(
            name=full.body(body).name,
            pos=position,
            quat=turn,
            simple=False,  # MuJoCo's short cut for aligned inertias, which other masses would break
            explicitinertial=True,
            mass=1.0,
            inertia=[1.0, 1.0, 1.0],
        )
        joint = full.joint(name)
        bodies[body].add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, pos=joint.pos, axis=joint.axis)
    with quiet_mujoco():
        model = spec.compile()
    for option in _OPTIONS:
        setattr(model.opt, option, getattr(full.opt, option))
    disable = mujoco.mjtDisableBit
    # looking for what the skeleton lacks takes a tenth of a step; a diverged candidate must stay diverged
    idle = disable.mjDSBL_ACTUATION | disable.mjDSBL_SENSOR | disable.mjDSBL_EQUALITY | disable.mjDSBL_ISLAND
    model.opt.disableflags = full.opt.disableflags | disable.mjDSBL_CONTACT | disable.mjDSBL_AUTORESET | idle
    chosen = [full.joint(name).id for name in fusion.joints]
    for prefix, names in (("jnt_", _JOINT_FIELDS), ("dof_", _DOF_FIELDS), ("qpos", ("0", "_spring"))):
        for name in names:
            getattr(model, prefix + name)[:] = getattr(full, prefix + name)[chosen]
    return model


def _steiner(away: Array) -> Array:
    """Inertia of 1 kg at `away` [m], shape (n, 3), about the origin [m²], shape (n, 3, 3)."""
    square = np.sum(away * away, axis=-1)[:, None, None]
    return square * np.eye(3) - away[:, :, None] * away[:, None, :]


def _principal(tensor: Array) -> tuple[Array, Array]:
    """Principal moments (..., 3) and the quaternion (w, x, y, z) of their right-handed axes (..., 4)."""
    moments, axes = np.linalg.eigh(tensor)
    axes[..., 2] *= np.sign(np.linalg.det(axes))[..., None]
    quat = Rotation.from_matrix(axes.reshape(-1, 3, 3)).as_quat()
    return moments, np.roll(quat, 1, axis=-1).reshape(*tensor.shape[:-2], 4)
