"""Give a model the inertias of its meshes, and stand two of the shipped arm on their
carrier.

    python meshes/make_models.py [MODEL.xml]

Without a model it is models/hydrolek.xml, and models/hydrolek_dual.xml is written from
it. Of every body with an <inertial> and a mesh the mass stays; centre and inertia
become those of the mesh at uniform density, as trimesh integrates them.

The left arm is the right one seen in the plane y = 0. Positions and orientations are
reflected; a joint's axis is a pseudovector, so that the same angles, torques and
commands give mirrored motions.
"""

import os
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
import trimesh

from hydroid.cad.importer import arrange
from hydroid.files import fill_template

ROOT = Path(__file__).parents[1]
ARM, DUAL = ROOT / "models" / "hydrolek.xml", ROOT / "models" / "hydrolek_dual.xml"
CARRIER = ("carrier_tracks", "carrier_turret", "carrier_beam")
AT = np.array([0.0, -0.32, 0.8])
"""base of the right arm in the world [m]; the left one stands at +0.32"""
POSITION = np.array([1.0, -1.0, 1.0])
QUATERNION = np.array([1.0, -1.0, 1.0, -1.0])
INERTIA = np.array([1.0, 1.0, 1.0, -1.0, 1.0, -1.0])
"""signs of xx, yy, zz, xy, xz and yz"""


def inertial(mesh: Path, mass: float) -> dict[str, str]:
    """Centre [m] and inertia [kg·m²] of a closed mesh of some mass [kg], as attributes
    of an <inertial>."""
    solid = trimesh.load(mesh, force="mesh", process=False)
    assert isinstance(solid, trimesh.Trimesh)
    solid.merge_vertices()  # an STL names a corner anew in every face
    if not (solid.is_watertight and solid.is_winding_consistent and solid.volume > 0):
        raise SystemExit(f"{mesh} is not one closed solid that looks outward")
    tensor = np.asarray(solid.moment_inertia) / solid.mass
    tensor = mass * 0.5 * (tensor + tensor.T)
    values = {
        "pos": solid.center_mass,
        "fullinertia": tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]],
    }
    return {
        name: " ".join(repr(float(x)) for x in value) for name, value in values.items()
    }


def write_inertias(path: Path) -> None:
    """Rewrite the inertias of a model."""
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    root = ElementTree.fromstring(path.read_text(encoding="utf-8"), parser)
    compiler = root.find("compiler")
    folder = path.parent / ("" if compiler is None else compiler.get("meshdir", ""))
    files = {
        mesh.get("name"): folder / str(mesh.get("file"))
        for mesh in root.iterfind("asset/mesh")
    }
    for body in root.iter("body"):
        stated, shape = body.find("inertial"), body.find("geom[@mesh]")
        if stated is not None and shape is not None:
            stated.attrib.update(
                inertial(files[shape.get("mesh")], float(str(stated.get("mass"))))
            )
    text = ElementTree.tostring(root, encoding="unicode").replace(" />", "/>")
    path.write_text(text + "\n", encoding="utf-8")


def two_arms(arm: Path) -> str:
    """Return the MJCF of the arm and its mirror image on their carrier, with meshes
    relative to DUAL."""
    machine = mujoco.MjSpec.from_string(
        f"<mujoco>{fill_template('cad/scene.xml')}</mujoco>"
    )
    machine.modelname = "hydrolek_dual"
    machine.comment = (
        "the arm of hydrolek.xml and its mirror image, by `make model`: change that"
    )
    machine.compiler.savecompiled = machine.compiler.savecanonical = False
    machine.add_material(name="steel", rgba=[0.25, 0.27, 0.3, 1])
    carrier = machine.worldbody.add_body(name="carrier")
    for name in CARRIER:
        machine.add_mesh(name=name, file=str(ROOT / "meshes" / f"{name}.stl"))
        look = {
            "type": mujoco.mjtGeom.mjGEOM_MESH,
            "meshname": name,
            "material": "steel",
            "mass": 0,
        }
        carrier.add_geom(group=2, contype=0, conaffinity=0, **look)
        carrier.add_geom(group=3, **look)
    for side in ("right", "left"):
        attach(machine, mujoco.MjSpec.from_file(str(arm)), side)
    alone = mujoco.MjModel.from_xml_path(str(arm))
    for key in range(alone.nkey):
        machine.add_key(name=alone.key(key).name, qpos=np.tile(alone.key_qpos[key], 2))
    data = mujoco.MjData(alone)
    mujoco.mj_kinematics(alone, data)
    middle = AT * [1.0, 0.0, 1.0]
    arrange(machine, middle, middle + data.xanchor[-1] - data.xanchor[0])
    text = machine.to_xml()
    for mesh in machine.meshes:
        text = text.replace(
            f'"{mesh.file}"',
            f'"{Path(os.path.relpath(mesh.file, DUAL.parent)).as_posix()}"',
        )
    return text


def attach(machine: mujoco.MjSpec, arm: mujoco.MjSpec, side: str) -> None:
    """Attach an arm without its base's shapes, on the left its mirror image."""
    home = Path(arm.modelfiledir) / arm.meshdir
    sky = mujoco.mjtTexture.mjTEXTURE_SKYBOX
    for part in (*arm.keys, *(t for t in arm.textures if t.type == sky)):
        arm.delete(part)
    for mesh in arm.meshes:
        mesh.file = str((home / mesh.file).resolve())
    arm.meshdir = ""
    (base,) = arm.worldbody.bodies
    for geom in list(base.geoms):
        arm.delete(geom)
    shift = AT - base.pos
    if side == "left":
        mirror(arm)
        shift = shift * POSITION
    machine.worldbody.add_frame(pos=shift).attach_body(base, f"{side}_", "")


def mirror(spec: mujoco.MjSpec) -> None:
    """Reflect all bodies of a model in the plane y = 0, so that the same angles mean
    mirrored poses."""
    for mesh in spec.meshes:
        mesh.scale = mesh.scale * POSITION
        mesh.refpos, mesh.refquat = mesh.refpos * POSITION, mesh.refquat * QUATERNION
    for body in spec.bodies[1:]:
        body.ipos, body.iquat = body.ipos * POSITION, body.iquat * QUATERNION
        body.fullinertia = body.fullinertia * INERTIA
    for joint in spec.joints:
        joint.pos, joint.axis = joint.pos * POSITION, joint.axis * -POSITION
    for part in (*spec.bodies[1:], *spec.frames, *spec.geoms, *spec.sites):
        mirror_frame(spec, part)
    for part in (*spec.geoms, *spec.sites):
        part.fromto = part.fromto * np.tile(POSITION, 2)


def mirror_frame(spec: mujoco.MjSpec, part: Any) -> None:
    """Reflect a position and an orientation, however it is written."""
    turn, written = part.quat, mujoco.mjtOrientation
    if part.alt.type != written.mjORIENTATION_QUAT:
        how = {"degree": spec.compiler.degree, "sequence": spec.compiler.eulerseq}
        turn = np.array(mujoco.MjSpec.resolve_orientation(**how, orientation=part.alt))
        part.alt.type = written.mjORIENTATION_QUAT
    part.pos, part.quat = part.pos * POSITION, turn * QUATERNION


def main(path: Path) -> None:
    """Write the models."""
    write_inertias(path)
    if path == ARM:
        DUAL.write_text(two_arms(ARM), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ARM)
