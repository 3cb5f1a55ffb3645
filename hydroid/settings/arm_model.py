"""What an arm's MJCF says: joints and ranges, links and masses, poses, and where cylinders are pinned."""

import mujoco
import numpy as np

from hydroid.errors import SettingsError
from hydroid.mjcf import mujoco_errors, read_mjcf
from hydroid.settings.arm import Arm, ArmFile, Joint
from hydroid.settings.linkage import DIGITS, Array, Cylinder, Vector, make_cylinder, triangle_of

HOME = "home"
"""the pose of joints at MuJoCo's start angles, unless a keyframe has this name"""
TURN = (-180.0, 180.0)
"""range of a joint without limits [deg], for sliders and tests"""


def make_arm(file: ArmFile, where: str) -> Arm:
    """Read the MJCF of an arm's settings; `where` begins messages about them."""
    spec = read_mjcf(file.model)
    name = spec.modelname
    with mujoco_errors(str(file.model)):
        model = _without_shapes(spec).compile()
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(model, data)
    names = [model.joint(j).name for j in range(model.njnt)]
    for other in file.actuators:
        if other not in names:
            hint = f"the model's joints: {', '.join(names)}"
            raise SettingsError(f"actuators.{other}: no such joint", where=where, hint=hint)
    if file.payload is not None and mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, file.payload) < 0:
        raise SettingsError(f"payload: the model has no site {file.payload!r}", where=where)
    try:
        joints = tuple(_joint(model, data, j, file) for j in range(model.njnt))
    except ValueError as error:
        raise SettingsError(str(error), where=where) from None
    moving = {int(body) for body in model.jnt_bodyid}
    bodies = [b for b in range(1, model.nbody) if model.body_weldid[b] and model.body_mass[b] > 0]
    links = sorted(bodies, key=lambda b: b not in moving)
    poses = {HOME: tuple(model.qpos0.tolist())}
    poses |= {model.key(k).name: tuple(model.key_qpos[k].tolist()) for k in range(model.nkey)}
    return Arm(
        file,
        name,
        joints,
        tuple(model.body(b).name for b in links),
        tuple(model.body_mass[links].tolist()),
        poses,
    )


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


def _joint(model: mujoco.MjModel, data: mujoco.MjData, j: int, file: ArmFile) -> Joint:
    """Return a joint with its actuator; `data` has all joints at 0."""
    name, limited = model.joint(j).name, bool(model.jnt_limited[j])
    low, high = np.degrees(model.jnt_range[j]).round(DIGITS).tolist()
    limits = (low, high) if limited else TURN
    settings = file.actuators.get(name)
    if not isinstance(settings, Cylinder):
        return Joint(name, limits, not limited, settings)
    try:
        if not limited:
            raise ValueError("a joint without limits needs a rotary actuator")
        pivots, found = None, settings.triangle
        if found is None:
            ends = _pivots(model, data, name, settings)
            parent, child = (end - data.xanchor[j] for end in ends)
            found = triangle_of(parent, child, data.xaxis[j])
            pivots = _in_links(model, data, j, ends)
        return Joint(name, limits, False, make_cylinder(settings, found, limits, pivots))
    except ValueError as error:
        raise ValueError(f"joint {name}: {error}") from None


def _pivots(model: mujoco.MjModel, data: mujoco.MjData, joint: str, settings: Cylinder) -> list[Array]:
    """Places of a cylinder's pivots on the parent and on the moved link in the world [m], (3,) each."""
    if settings.pivots is not None:
        return [np.array(settings.pivots.parent), np.array(settings.pivots.child)]
    places = []
    for end in ("parent", "child"):
        site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, f"{joint}_pivot_{end}")
        if site < 0:
            raise ValueError(f"the model has no site {joint}_pivot_{end}; add it, or give pivots")
        places.append(data.site_xpos[site].copy())
    return places


def _in_links(model: mujoco.MjModel, data: mujoco.MjData, j: int, ends: list[Array]) -> tuple[Vector, Vector]:
    """The pivots in the frames of the parent and of the moved body [m]."""
    child = int(model.jnt_bodyid[j])
    bodies = int(model.body_parentid[child]), child
    local = [data.xmat[b].reshape(3, 3).T @ (e - data.xpos[b]) for b, e in zip(bodies, ends, strict=True)]
    parent, moved = (tuple(place.round(DIGITS).tolist()) for place in local)
    return parent, moved
