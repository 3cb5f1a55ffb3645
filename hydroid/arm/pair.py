"""Two arms that mirror each other, on one carrier: one MJCF from one arm, by `MjSpec.attach`.

The left arm is the right one seen in the plane y = 0. Positions and orientations are reflected; a joint's
axis is a pseudovector, so that the same angles, torques and commands give mirrored motions.
"""

import os
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from hydroid.arm.build import SCENE, add_mesh, exclude_contacts, place_scene
from hydroid.arm.mesh import read_mesh
from hydroid.errors import SettingsError
from hydroid.files import write_atomic
from hydroid.settings.arm import Arm
from hydroid.settings.parts import Pair

SIDES = ("right", "left")
"""the arms in the order of the machine's joints; the names of their parts begin with these and `_`"""

_POSITION = np.array([1.0, -1.0, 1.0])
_QUATERNION = np.array([1.0, -1.0, 1.0, -1.0])
_PSEUDOVECTOR = -_POSITION
_INERTIA = np.array([1.0, 1.0, 1.0, -1.0, 1.0, -1.0])
"""signs of xx, yy, zz, xy, xz and yz"""


def pair_of(arm: Arm) -> Pair:
    """Return where an arm's file puts two of them.

    Raises:
        SettingsError: it does not.
    """
    if arm.pair is None:
        hint = "add pair: {model: MODEL.xml, carrier: [MESH.stl], at: [x, -y, z]} to the arm's file"
        raise SettingsError(f"{arm.name} stands alone", where="--arm", hint=hint)
    return arm.pair


def build_pair(spec: mujoco.MjSpec, arm: Arm) -> mujoco.MjSpec:
    """Build the machine of two arms; the carrier stands in the place of the arm's own base.

    Args:
        spec: the arm's model, as `load_model` returns it.
        arm: its settings.

    Raises:
        SettingsError: the arm's file names no pair. MeshError, ModelError: a part that cannot be shown.
    """
    pair = pair_of(arm)
    machine = mujoco.MjSpec.from_string(SCENE)
    machine.modelname = f"{spec.modelname}_dual"
    machine.comment = f"{machine.modelname}: built by `hydroid build-model` from the arm's YAML and meshes"
    machine.compiler.savecompiled = machine.compiler.savecanonical = False
    machine.option.timestep = spec.option.timestep
    carrier = machine.worldbody.add_body(name="carrier")
    for mesh in pair.carrier:
        read_mesh(arm.meshes / mesh)
        add_mesh(machine, carrier, mesh, "steel")
    for mesh in machine.meshes:
        mesh.file = str((arm.meshes / mesh.file).resolve())
    for side in SIDES:
        _attach(machine, spec, side, np.array(pair.at) - arm.base.at)
    for name in arm.poses:
        machine.add_key(name=name, qpos=np.tile(arm.pose(name), len(SIDES)))
    exclude_contacts(machine)
    middle = np.array(pair.at) * [1.0, 0.0, 1.0]
    place_scene(machine, middle, middle + np.sum([joint.at for joint in arm.joints], axis=0))
    return machine


def write_pair(spec: mujoco.MjSpec, arm: Arm) -> Path:
    """Write the machine's model, meshes named relative to it, and return its file.

    Raises:
        RunError: it cannot be written; and what `build_pair` raises.
    """
    path, machine = pair_of(arm).model, build_pair(spec, arm)
    text = machine.to_xml()
    # in the text, not in the spec: that would look for its meshes beside the file it came from
    for mesh in machine.meshes:
        beside = Path(os.path.relpath(mesh.file, path.parent)).as_posix()
        text = text.replace(f'file="{mesh.file}"', f'file="{beside}"')
    write_atomic(path, text)
    return path


def _attach(machine: mujoco.MjSpec, spec: mujoco.MjSpec, side: str, shift: np.ndarray) -> None:
    """Attach a copy of the arm, on the left its mirror image."""
    arm, home = spec.copy(), Path(spec.modelfiledir) / spec.meshdir
    for key in list(arm.keys):
        arm.delete(key)
    arm.option.timestep = machine.option.timestep
    for texture in list(arm.textures):
        if texture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
            arm.delete(texture)  # the machine has its own sky
    for mesh in arm.meshes:
        mesh.file = mesh.file and str((home / mesh.file).resolve())
    arm.meshdir = ""
    for body in arm.worldbody.bodies:
        for geom in [] if body.joints else list(body.geoms):
            arm.delete(geom)  # of the arm's own base
    if side == "left":
        mirror(arm)
        shift = shift * _POSITION
    place = machine.worldbody.add_frame(pos=shift)
    for body in arm.worldbody.bodies:
        place.attach_body(body, f"{side}_", "")


def mirror(spec: mujoco.MjSpec) -> None:
    """Reflect all bodies of a model in the plane y = 0, so that the same angles mean mirrored poses."""
    for mesh in spec.meshes:
        mesh.scale = mesh.scale * _POSITION
        mesh.refpos, mesh.refquat = mesh.refpos * _POSITION, mesh.refquat * _QUATERNION
        mesh.uservert = (np.reshape(mesh.uservert, (-1, 3)) * _POSITION).ravel()
    for body in spec.bodies[1:]:
        _mirror_frame(spec, body)
        body.ipos = body.ipos * _POSITION
        body.iquat = body.iquat * _QUATERNION
        body.fullinertia = body.fullinertia * _INERTIA
    for joint in spec.joints:
        joint.pos, joint.axis = joint.pos * _POSITION, joint.axis * _PSEUDOVECTOR
    for part in (*spec.frames, *spec.geoms, *spec.sites, *spec.cameras):
        _mirror_frame(spec, part)
    for part in (*spec.geoms, *spec.sites):
        part.fromto = part.fromto * np.tile(_POSITION, 2)
    for light in spec.lights:
        light.pos, light.dir = light.pos * _POSITION, light.dir * _POSITION


def _mirror_frame(spec: mujoco.MjSpec, part: Any) -> None:
    """Reflect a position and an orientation, however it is written."""
    turn, written = part.quat, mujoco.mjtOrientation
    if part.alt.type != written.mjORIENTATION_QUAT:
        how = {"degree": spec.compiler.degree, "sequence": spec.compiler.eulerseq}
        turn = np.array(mujoco.MjSpec.resolve_orientation(**how, orientation=part.alt))
        part.alt.type = written.mjORIENTATION_QUAT
    part.pos, part.quat = part.pos * _POSITION, turn * _QUATERNION
