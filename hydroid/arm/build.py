"""Settings and meshes -> MJCF: a serial arm on a fixed base that MuJoCo can show, step and save.

Each link is one body with its frame in its joint. Its inertia is that of the settings, or else that of its
mesh or shape with the nominal mass.
Damping, stiffness and friction stay zero: they are what a fit finds. Cylinders are drawn as spatial tendons
between their pivots and carry no force; torque enters by one motor a joint.
"""

import math
import os
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from hydroid.arm.mesh import mass_properties, read_mesh, shape_properties
from hydroid.arm.model import mujoco_errors
from hydroid.files import write_atomic
from hydroid.settings.arm import Arm, Joint, LinearActuator
from hydroid.settings.parts import Box, Cylinder, Link

Array = NDArray[np.float64]

VISUAL_GROUP, COLLISION_GROUP = 2, 3
CHROME = [0.62, 0.65, 0.68, 1.0]
SCENE = """
<mujoco>
  <option timestep="0.01" integrator="Euler"/>
  <visual>
    <headlight ambient="0.25 0.25 0.25" diffuse="0.2 0.2 0.2"/>
    <global offwidth="1600" offheight="1200"/>
  </visual>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient" rgb1="0.86 0.9 0.94" rgb2="0.5 0.57 0.65"
             width="128" height="128"/>
    <texture name="floor" type="2d" builtin="checker" rgb1="0.58 0.6 0.62" rgb2="0.52 0.54 0.56"
             width="256" height="256"/>
    <material name="paint" rgba="0.94 0.53 0.08 1" specular="0.35" shininess="0.35"/>
    <material name="steel" rgba="0.25 0.27 0.3 1"/>
    <material name="floor" texture="floor" texrepeat="10 10"/>
  </asset>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 0.1" material="floor"/>
    <light name="key" type="directional" dir="-0.6 1.6 -3" diffuse="0.5 0.5 0.5" specular="0.15 0.15 0.15"/>
    <light name="fill" type="directional" dir="-1.2 -2 -2.2" diffuse="0.2 0.2 0.2"
           specular="0.06 0.06 0.06" castshadow="false"/>
    <camera name="side" pos="0 -1 0.15" xyaxes="1 0 0 0 0.15 1" fovy="40"/>
    <camera name="corner" pos="0.75 -0.75 0.5" xyaxes="1 1 0 -0.5 0.5 1.5" fovy="40"/>
  </worldbody>
</mujoco>
"""
"""what makes a model pleasant to look at; lights and cameras are placed around the arm"""


def build_model(arm: Arm, mesh_folder: Path | None = None) -> mujoco.MjSpec:
    """Build the arm's model from its meshes, in `mesh_folder` or where the settings say.

    Raises:
        MeshError: a mesh from which no mass properties can be computed.
        ModelError: a mesh that MuJoCo cannot show, such as one of more than 200,000 faces.
    """
    folder = (mesh_folder or arm.meshes).resolve()
    spec = mujoco.MjSpec.from_string(SCENE)
    spec.modelname, spec.meshdir = arm.name, str(folder)
    spec.comment = f"{arm.name}: built by `hydroid build-model` from the arm's YAML and meshes; edit those"
    spec.compiler.savecompiled = spec.compiler.savecanonical = False
    body = spec.worldbody.add_body(name="base", pos=arm.base.at)
    if arm.base.mesh is not None:
        read_mesh(folder / arm.base.mesh)  # it may be open: it is only shown
        add_mesh(spec, body, arm.base.mesh, "steel")
    for link, joint in zip(arm.links, arm.joints, strict=True):
        child = body.add_body(name=link.name, pos=joint.at)
        _add_joint(spec, child, joint)
        if isinstance(joint.actuator, LinearActuator) and joint.actuator.four_bar is None:
            _add_cylinder(spec, body, child, joint, joint.actuator)
        _add_part(spec, child, link, folder, "steel" if link is arm.links[-1] else "paint")
        for part in arm.fixed:
            if part.carried_by == link.name:
                _add_part(spec, child.add_body(name=part.name, pos=part.at), part, folder, "steel")
        body = child
    for name in arm.poses:
        spec.add_key(name=name, qpos=arm.pose(name))
    exclude_contacts(spec)
    base = np.array(arm.base.at)
    place_scene(spec, base, base + np.sum([joint.at for joint in arm.joints], axis=0))
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


def _add_part(spec: mujoco.MjSpec, body: mujoco.MjsBody, part: Link, folder: Path, material: str) -> None:
    body.explicitinertial, body.mass = True, part.mass
    if part.inertia is not None:
        centre, i = np.array(part.inertia.centre), part.inertia.matrix
        if part.mesh is not None:
            read_mesh(folder / part.mesh)  # it may be open: it is only shown
    elif part.shape is not None:
        properties = shape_properties(part.shape)
        centre, i = properties.centre, part.mass * properties.inertia
    else:
        assert part.mesh is not None
        properties = mass_properties(folder / part.mesh)
        centre, i = properties.centre, part.mass * properties.inertia
    body.ipos = centre
    body.fullinertia = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
    if part.mesh is not None:
        add_mesh(spec, body, part.mesh, material)
    elif part.shape is not None:
        _add_shape(body, part.shape, material)


def add_mesh(spec: mujoco.MjSpec, body: mujoco.MjsBody, mesh: str, material: str) -> None:
    """Show the mesh, and collide with its convex hull."""
    name = Path(mesh).with_suffix("").as_posix()
    if spec.mesh(name) is None:
        spec.add_mesh(name=name, file=mesh)
    look = {"meshname": name, "material": material, "mass": 0}
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, group=VISUAL_GROUP, contype=0, conaffinity=0, **look)
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, group=COLLISION_GROUP, **look)


def _add_shape(body: mujoco.MjsBody, shape: Box | Cylinder, material: str) -> None:
    """Show the shape, and collide with it."""
    if isinstance(shape, Box):
        size = [0.5 * length for length in shape.size]
        form = {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": size, "pos": shape.at}
    else:
        ends = [*shape.ends[0], *shape.ends[1]]
        form = {"type": mujoco.mjtGeom.mjGEOM_CYLINDER, "size": [shape.radius, 0, 0], "fromto": ends}
    body.add_geom(group=VISUAL_GROUP, contype=0, conaffinity=0, mass=0, material=material, **form)
    body.add_geom(group=COLLISION_GROUP, mass=0, **form)


def _add_joint(spec: mujoco.MjSpec, body: mujoco.MjsBody, joint: Joint) -> None:
    limited = mujoco.mjtLimited.mjLIMITED_FALSE if joint.continuous else mujoco.mjtLimited.mjLIMITED_TRUE
    hinge = mujoco.mjtJoint.mjJNT_HINGE
    body.add_joint(name=joint.name, type=hinge, axis=joint.axis, range=joint.range, limited=limited)
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


def place_scene(spec: mujoco.MjSpec, base: Array, tip: Array) -> None:
    """Put lights and cameras around the middle of the stretched arm, as far away as it reaches.

    `base` and `tip` are its ends in the world [m], shape (3,).
    """
    centre, reach = np.round(0.5 * (base + tip), 6), round(0.8 * float(np.linalg.norm(tip - base)), 6)
    with mujoco_errors(spec.modelname):
        whole = spec.compile().stat
    if reach < 0.2 * whole.extent:  # one joint, or joints close together: the links reach farther
        centre, reach = np.round(whole.center, 6), round(0.5 * float(whole.extent), 6)
    if reach > 4.0:
        spec.geom("floor").size = [round(1.25 * reach, 3)] * 2 + [0.1]
    for light in spec.lights:
        light.pos = centre - light.dir
    for camera in spec.cameras:
        camera.pos = np.round(centre + 2.3 * reach * camera.pos, 3)
    spec.stat.center, spec.stat.extent = centre, reach


def exclude_contacts(spec: mujoco.MjSpec) -> None:
    """Let no named pose start in contact: what touches there is close by design, or its hull is wide."""
    pairs: set[tuple[int, int]] = set()
    with mujoco_errors(spec.modelname):
        model = spec.compile()
        data = mujoco.MjData(model)
        for key in range(model.nkey):
            mujoco.mj_resetDataKeyframe(model, data, key)
            mujoco.mj_forward(model, data)
            pairs |= {(int(pair.min()), int(pair.max())) for pair in model.geom_bodyid[data.contact.geom]}
    for first, second in sorted(pairs):
        spec.add_exclude(bodyname1=model.body(first).name, bodyname2=model.body(second).name)


def pivots(joint: Joint, actuator: LinearActuator) -> tuple[Array, Array]:
    """Place a cylinder's pivots so that the angle from the parent's to the child's is q ± θ0 about the axis.

    The triangle itself is `hydroid.settings.linkage`'s.

    Returns:
        The pivot on the parent link in its frame, and the one on the child in the child's [m], (3,) each.
    """
    axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
    towards = np.array(actuator.towards) - axis * (axis @ np.array(actuator.towards))
    towards /= np.linalg.norm(towards)
    theta0 = actuator.sense * math.radians(actuator.theta0)
    turned = math.cos(theta0) * towards + math.sin(theta0) * np.cross(axis, towards)
    on_parent, on_child = (actuator.a, actuator.b) if actuator.a_on == "parent" else (actuator.b, actuator.a)
    shift = actuator.offset * axis
    return np.array(joint.at) + shift + on_parent * towards, shift + on_child * turned
