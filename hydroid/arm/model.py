"""Settings and meshes -> MJCF: a serial arm on a fixed base that MuJoCo can show, step and save.

Each link is one body with its frame in its joint; mass and inertia come from the mesh and the nominal mass.
Damping, stiffness and friction stay zero: they are what a fit finds. Cylinders are drawn as spatial tendons
between their pivots and carry no force; torque enters by one motor a joint.
"""

import math
import os
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from hydroid.arm.mesh import MassProperties, mass_properties
from hydroid.arm.pivots import pivots
from hydroid.arm.quiet import quiet_mujoco
from hydroid.arm.scene import CHROME, PAINT, STEEL, add_scene
from hydroid.errors import ModelError
from hydroid.files import is_file, write_atomic
from hydroid.settings.arm import Arm, Joint, LinearActuator, Link

TIMESTEP = 0.01  # [s]; the logs' sample period
VISUAL_GROUP, COLLISION_GROUP = 2, 3


def build_model(arm: Arm, mesh_folder: Path | None = None) -> mujoco.MjSpec:
    """Build the arm's model.

    Args:
        arm: its settings.
        mesh_folder: where the meshes lie, where not in `arm.meshes`.

    Raises:
        MeshError: a mesh from which no mass properties can be computed.
        ModelError: a mesh that MuJoCo cannot show, such as one of more than 200,000 faces.
    """
    folder = (mesh_folder or arm.meshes).resolve()
    spec = mujoco.MjSpec()
    spec.modelname = arm.name
    spec.meshdir = str(folder)
    spec.comment = f"{arm.name}: built by `hydroid build-model` from the arm's YAML and meshes; edit those"
    spec.compiler.savecompiled = spec.compiler.savecanonical = False
    spec.option.timestep = TIMESTEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    add_scene(spec, *_room(arm))

    body = spec.worldbody.add_body(name="base", pos=arm.base.at)
    mass_properties(folder / arm.base.mesh)
    _add_shape(spec, body, arm.base.mesh, STEEL)
    for link, joint in zip(arm.links, arm.joints, strict=True):
        child = body.add_body(name=link.name, pos=joint.at)
        _add_joint(spec, child, joint)
        if isinstance(joint.actuator, LinearActuator):
            _add_cylinder(spec, body, child, joint, joint.actuator)
        _add_part(spec, child, link, folder, STEEL if link is arm.links[-1] else PAINT)
        for part in arm.fixed:
            if part.carried_by == link.name:
                _add_part(spec, child.add_body(name=part.name, pos=part.at), part, folder, STEEL)
        body = child
    for name in arm.poses:
        spec.add_key(name=name, qpos=arm.pose(name))
    _exclude_contacts(spec)
    return spec


def write_model(arm: Arm, path: Path, mesh_folder: Path | None = None) -> None:
    """Build the arm's model and write it to `path`, whole or not at all; meshes are named relative to it.

    Raises:
        MeshError: a mesh from which no mass properties can be computed.
        RunError: `path` cannot be written.
    """
    spec = build_model(arm, mesh_folder)
    spec.modelfiledir = str(path.resolve().parent)
    spec.meshdir = Path(os.path.relpath(spec.meshdir, spec.modelfiledir)).as_posix()
    write_atomic(path, spec.to_xml())


def load_model(path: Path, arm: Arm) -> mujoco.MjSpec:
    """Read an MJCF, built here or a user's own, and check that it is the arm of the settings.

    Args:
        path: the MJCF.
        arm: the settings that name its joints and links.

    Raises:
        ModelError: missing or refused by MuJoCo; without a joint or link of the settings; with a joint that
            no setting names, that is not a hinge, or that shares its body; with an equality constraint.
    """
    where = str(path)
    if not is_file(path):
        raise ModelError("no such model", where=where, hint="`hydroid build-model` writes it")
    try:
        with quiet_mujoco():
            spec = mujoco.MjSpec.from_file(where)
    except (ValueError, mujoco.FatalError) as error:
        raise _refused(error, where) from None
    _compile(spec, where)
    _match(spec, arm, where)
    return spec


def _compile(spec: mujoco.MjSpec, where: str) -> mujoco.MjModel:
    try:
        with quiet_mujoco():
            return spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise _refused(error, where) from None


def _refused(error: Exception, where: str) -> ModelError:
    return ModelError(f"MuJoCo refuses it ({' '.join(str(error).split())})", where=where)


def _match(spec: mujoco.MjSpec, arm: Arm, where: str) -> None:
    joints = [joint.name for joint in spec.joints]
    bodies = [body.name for body in spec.bodies]
    for what, wanted, present in (("joint", arm.joint_names, joints), ("body", arm.link_names, bodies)):
        for name in wanted:
            if name not in present:
                raise ModelError(
                    f"has no {what} {name!r}", where=where, hint=f"it has: {', '.join(filter(None, present))}"
                )
    for joint in spec.joints:
        if joint.name not in arm.joint_names:
            raise ModelError(f"joint {joint.name!r} is not in the arm's settings", where=where)
        if joint.type != mujoco.mjtJoint.mjJNT_HINGE or len(joint.parent.joints) > 1:
            raise ModelError(f"joint {joint.name!r} must be a hinge, alone on its body", where=where)
    if joints != list(arm.joint_names):
        raise ModelError(
            f"joints come in the order {', '.join(joints)}", where=where, hint="list them so in the settings"
        )
    if spec.equalities:
        raise ModelError("has equality constraints, which hydroid does not simulate", where=where)


def _add_part(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, part: Link, folder: Path, colour: Sequence[float]
) -> None:
    _set_inertial(body, part.mass, mass_properties(folder / part.mesh))
    _add_shape(spec, body, part.mesh, colour)


def _set_inertial(body: mujoco.MjsBody, mass: float, properties: MassProperties) -> None:
    i = mass * properties.inertia
    body.explicitinertial = True
    body.mass = mass
    body.ipos = properties.centre
    body.fullinertia = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]


def _add_shape(spec: mujoco.MjSpec, body: mujoco.MjsBody, mesh: str, material: str) -> None:
    """Show the mesh, and collide with the capsule that MuJoCo fits to it."""
    name = Path(mesh).with_suffix("").as_posix()
    if spec.mesh(name) is None:
        spec.add_mesh(name=name, file=mesh)
    for kind, group in (
        (mujoco.mjtGeom.mjGEOM_MESH, VISUAL_GROUP),
        (mujoco.mjtGeom.mjGEOM_CAPSULE, COLLISION_GROUP),
    ):
        solid = group == COLLISION_GROUP
        body.add_geom(
            type=kind,
            meshname=name,
            material=material,
            group=group,
            mass=0,
            contype=int(solid),
            conaffinity=int(solid),
        )


def _add_joint(spec: mujoco.MjSpec, body: mujoco.MjsBody, joint: Joint) -> None:
    limited = mujoco.mjtLimited
    body.add_joint(
        name=joint.name,
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=joint.axis,
        range=joint.range,
        limited=limited.mjLIMITED_FALSE if joint.continuous else limited.mjLIMITED_TRUE,
    )
    motor = spec.add_actuator(name=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=joint.name)
    motor.set_to_motor()


def _add_cylinder(
    spec: mujoco.MjSpec,
    parent: mujoco.MjsBody,
    child: mujoco.MjsBody,
    joint: Joint,
    actuator: LinearActuator,
) -> None:
    bore = math.sqrt(1e-6 * actuator.area_a / math.pi)
    cylinder = spec.add_tendon(name=f"{joint.name}_cylinder", width=round(bore, 4), rgba=CHROME)
    on_parent, on_child = pivots(joint, actuator)
    for end, body, at in (("parent", parent, on_parent), ("child", child, on_child)):
        name = f"{joint.name}_pivot_{end}"
        body.add_site(name=name, pos=np.round(at, 12) + 0.0, size=[0.004] * 3, group=COLLISION_GROUP)
        cylinder.wrap_site(name)


def _room(arm: Arm) -> tuple[NDArray[np.float64], float]:
    """Middle of the stretched arm (3,) [m], and how far it reaches from there as it moves [m]."""
    base = np.array(arm.base.at)
    tip = base + np.sum([joint.at for joint in arm.joints], axis=0)
    return np.round(0.5 * (base + tip), 6), round(0.8 * float(np.linalg.norm(tip - base)), 6)


def _exclude_contacts(spec: mujoco.MjSpec) -> None:
    """Let no named pose start in contact: what touches there is close by design, or its capsule is wide."""
    model = _compile(spec, spec.modelname)
    data = mujoco.MjData(model)
    pairs: set[tuple[int, int]] = set()
    for key in range(model.nkey):
        mujoco.mj_resetDataKeyframe(model, data, key)
        with quiet_mujoco():
            mujoco.mj_forward(model, data)
        pairs |= {(int(pair.min()), int(pair.max())) for pair in model.geom_bodyid[data.contact.geom]}
    for first, second in sorted(pairs):
        spec.add_exclude(bodyname1=model.body(first).name, bodyname2=model.body(second).name)
