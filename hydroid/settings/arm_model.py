"""What needs an arm's compiled MJCF: masses, poses, and where cylinders are pinned."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from hydroid.errors import ModelError, SettingsError
from hydroid.mjcf import mujoco_errors, read_mjcf
from hydroid.settings.arm import Arm, Joint
from hydroid.settings.arm_outline import DIGITS
from hydroid.settings.linkage import Array, Cylinder, Vector, make_cylinder, triangle_of

HOME = "home"
"""the pose of joints at MuJoCo's start angles, unless a keyframe has this name"""
TURN = (-180.0, 180.0)
"""range of a joint without limits [deg], for sliders and tests"""


@dataclass(frozen=True)
class ArmModel:
    """What MuJoCo makes of an arm's MJCF.

    Attributes:
        joints: in the order of the model, J of them.
        masses: of the arm's links [kg], L of them.
        poses: angle of each joint by the pose's name [rad].
    """

    joints: tuple[Joint, ...]
    masses: tuple[float, ...]
    poses: dict[str, tuple[float, ...]]


def read_model(arm: Arm) -> ArmModel:
    """Compile the MJCF of an arm.

    Raises:
        ModelError: an MJCF that hydroid cannot simulate, or of several files.
        SettingsError: a cylinder that does not fit the model.
    """
    spec = read_mjcf(arm.model)
    with mujoco_errors(str(arm.model)):
        model = _without_shapes(spec).compile()
    joints = tuple(model.joint(j).name for j in range(model.njnt))
    links = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name) for name in arm.link_names]
    if joints != arm.joint_names or min(links) < 0:
        hint = "MuJoCo adds to it by include, attach or replicate: `hydroid init` writes it as one file"
        raise ModelError("does not say itself what is in it", where=str(arm.model), hint=hint)
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(model, data)
    made: list[Joint] = []
    for name, limits in zip(joints, arm.ranges, strict=True):
        settings = arm.file.actuators.get(name)
        one = Joint(
            name, limits or TURN, limits is None, None if isinstance(settings, Cylinder) else settings
        )
        try:
            made.append(_with_cylinder(one, settings, data) if isinstance(settings, Cylinder) else one)
        except ValueError as error:
            raise SettingsError(f"joint {name}: {error}", where=arm.where) from None
    poses = {HOME: tuple(model.qpos0.tolist())}
    poses |= {model.key(k).name: tuple(model.key_qpos[k].tolist()) for k in range(model.nkey)}
    return ArmModel(tuple(made), tuple(model.body_mass[links].tolist()), poses)


def _without_shapes(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """Delete the meshes that decide no inertia and that nothing refers to: they take long to compile."""
    mesh = mujoco.mjtGeom.mjGEOM_MESH
    if spec.compiler.inertiafromgeom != mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE:
        for geom in list(spec.geoms):
            if geom.type == mesh and not geom.name and geom.parent.explicitinertial:
                spec.delete(geom)
    used = {geom.meshname for geom in spec.geoms}
    for one in list(spec.meshes):
        if one.name not in used:
            spec.delete(one)
    return spec


def _with_cylinder(joint: Joint, settings: Cylinder, data: mujoco.MjData) -> Joint:
    """Return the joint with its cylinder; `data` has all joints at 0."""
    if joint.continuous:
        raise ValueError("a joint without limits needs a rotary actuator")
    pivots, found = None, settings.triangle
    if found is None:
        ends, axis = _pivots(data, joint.name, settings), data.joint(joint.name)
        found = triangle_of(ends[0] - axis.xanchor, ends[1] - axis.xanchor, axis.xaxis)
        pivots = _in_links(data, joint.name, ends)
    return Joint(joint.name, joint.range, False, make_cylinder(settings, found, joint.range, pivots))


def _pivots(data: mujoco.MjData, joint: str, settings: Cylinder) -> list[Array]:
    """Places of a cylinder's pivots on the parent and on the moved link in the world [m], (3,) each."""
    if settings.pivots is not None:
        return [np.array(settings.pivots.parent), np.array(settings.pivots.child)]
    places = []
    for end in ("parent", "child"):
        site = mujoco.mj_name2id(data.model, mujoco.mjtObj.mjOBJ_SITE, f"{joint}_pivot_{end}")
        if site < 0:
            raise ValueError(f"the model has no site {joint}_pivot_{end}; add it, or give pivots")
        places.append(data.site_xpos[site].copy())
    return places


def _in_links(data: mujoco.MjData, joint: str, ends: Sequence[Array]) -> tuple[Vector, Vector]:
    """The pivots in the frames of the parent and of the moved body [m]."""
    child = int(data.model.joint(joint).bodyid[0])
    bodies = int(data.model.body_parentid[child]), child
    local = [data.xmat[b].reshape(3, 3).T @ (e - data.xpos[b]) for b, e in zip(bodies, ends, strict=True)]
    parent, moved = (tuple(place.round(DIGITS).tolist()) for place in local)
    return parent, moved
