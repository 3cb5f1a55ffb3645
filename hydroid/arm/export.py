"""An arm with locked joints as an MJCF with its looks: what a plant steps and shows,
and what is exported.

The bodies are those of `hydroid.arm.locked`, with the inertia of all that is fused into
them. Shapes, sites, cameras and lights of a fused body hang on the body that carries
it; contacts are off, as in every simulation.
"""

import math
from pathlib import Path

import mujoco
import numpy as np

from hydroid.arm.locked import LockedArm
from hydroid.arrays import Array
from hydroid.files import Plain, fill_template, write_atomic, yaml_text
from hydroid.mjcf import mjcf_text, quiet_mujoco

_FIELDS = (
    "body_pos", "body_quat", "body_ipos", "body_iquat", "body_mass", "body_inertia", "body_simple",
    "body_sameframe", "jnt_pos", "jnt_axis", "dof_simplenum"
)  # fmt: skip
"""of a model, whose last bits depend on how its bodies were fused"""


def dressed_model(
    spec: mujoco.MjSpec, locked: LockedArm, *, shapes: bool = True
) -> mujoco.MjModel:
    """Return the locked arm's model with shapes, cameras and one idle motor per joint.

    It steps as `locked.model` does, bit for bit: motors are switched off, and their
    controls are free to hold commands in %. Without `shapes` it does so faster, as
    MuJoCo places each of them at every step, but nothing of it can be drawn.
    """
    source = locked_spec(spec, locked, locked.model, np.zeros((2, len(locked.joints))))
    if not shapes:
        drawn = [*source.tendons, *source.geoms, *source.sites]
        for part in [*drawn, *source.meshes, *source.hfields]:
            source.delete(part)
    with quiet_mujoco():
        model = source.compile()
    for name in _FIELDS:
        getattr(model, name)[:] = getattr(locked.model, name)
    model.opt.disableflags = locked.model.opt.disableflags
    return model


def locked_spec(
    spec: mujoco.MjSpec, locked: LockedArm, model: mujoco.MjModel, motors: Array
) -> mujoco.MjSpec:
    """Return an arm's MJCF with joints locked; inertia, joints and time step are those
    of `model`.

    `motors` are torque per command [N·m/%] and torque without one [N·m] of the moving
    joints, shape (2, V); shape (2, 0): no motors.
    """
    source = spec.copy()
    forces = [*source.actuators, *source.sensors, *source.equalities]
    others = [
        *source.keys,
        *source.excludes,
        *source.pairs,
        *source.flexes,
        *source.skins,
    ]
    for part in forces + others:
        source.delete(part)
    _draw_tendons(source)
    for name, (position, turn) in locked.held.items():
        body = source.body(name)
        # the body's own frame is part of its place
        body.set_frame(body.parent.add_frame())
        body.pos = position
        body.quat = turn
        body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
        source.delete(body.first_joint())
    source.fuse_static()
    # inertias stand in the file to the last bit, and nothing is to change them
    compiler = source.compiler
    compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    compiler.balanceinertia = False
    compiler.boundmass = compiler.boundinertia = 0.0
    compiler.settotalmass = -1.0
    compiler.fusestatic = False
    source.option.timestep = model.opt.timestep
    source.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    for number, joint in enumerate(map(source.joint, locked.joints)):
        _take_inertia(joint.parent, model, model.jnt_bodyid[number])
        _take_joint(joint, model, number, in_degrees=bool(compiler.degree))
    for name, gain, bias in zip(locked.joints, *motors, strict=False):
        source.add_actuator(
            name=name,
            target=name,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            gainprm=[gain] + [0.0] * 9,
            biastype=mujoco.mjtBias.mjBIAS_AFFINE,
            biasprm=[bias] + [0.0] * 9,
            ctrllimited=mujoco.mjtLimited.mjLIMITED_TRUE,
            ctrlrange=[-100.0, 100.0],
        )
    source.add_key(name="start", qpos=model.qpos_spring)
    return source


def _take_inertia(body: mujoco.MjsBody, model: mujoco.MjModel, number: int) -> None:
    """Give a body what one of a model weighs."""
    body.explicitinertial = True
    body.mass = model.body_mass[number]
    body.ipos = model.body_ipos[number]
    body.iquat = model.body_iquat[number]
    body.ialt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    body.inertia = model.body_inertia[number]
    # MuJoCo's word for one that is not given
    body.fullinertia = [np.nan, 0, 0, 0, 0, 0]


def _take_joint(
    joint: mujoco.MjsJoint, model: mujoco.MjModel, number: int, *, in_degrees: bool
) -> None:
    """Give a joint the damper, spring and friction of one of a model."""
    joint.damping = [model.dof_damping[number], 0, 0]
    joint.stiffness = [model.jnt_stiffness[number], 0, 0]
    joint.frictionloss = model.dof_frictionloss[number]
    joint.armature = model.dof_armature[number]
    # a URDF's effort is of another motor
    joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
    rest = model.qpos_spring[number]
    turns = joint.type == mujoco.mjtJoint.mjJNT_HINGE
    joint.springref = math.degrees(rest) if in_degrees and turns else rest


def _draw_tendons(spec: mujoco.MjSpec) -> None:
    """Keep tendons as drawings of cylinders: none of their forces is simulated."""
    for tendon in list(spec.tendons):
        if any(wrap.type == mujoco.mjtWrap.mjWRAP_JOINT for wrap in tendon.path):
            spec.delete(tendon)
            continue
        tendon.limited = tendon.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
        tendon.stiffness = tendon.damping = np.zeros(3)
        tendon.frictionloss = tendon.armature = 0.0


def write_fitted(
    folder: Path, fitted: mujoco.MjSpec, joints: str, actuators: Plain
) -> None:
    """Write the fitted arm to `model/`, beside `arm.xml`,
    and a README that says what it is good for.

    `joints` names those that take commands; `actuators` are hydraulic parameters by
    joint; of stage 1 there are none: the MJCF has motors.
    """
    name = "fitted"
    if actuators:
        name = "mechanics"
        write_atomic(folder / "actuators.yaml", yaml_text(actuators))
    write_atomic(folder / f"{name}.xml", mjcf_text(fitted))
    readme = fill_template(
        f"arm/{name}.txt.j2", timestep=fitted.option.timestep, joints=joints
    )
    write_atomic(folder / "README.txt", readme)
