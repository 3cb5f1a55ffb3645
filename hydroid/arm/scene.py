"""What makes a model pleasant to look at: floor, sky, lights, cameras, paint. None of it moves or weighs."""

import mujoco
import numpy as np
from numpy.typing import NDArray

PAINT = "paint"
STEEL = "steel"
CHROME = [0.62, 0.65, 0.68, 1.0]

_COLOURS = {PAINT: ([0.94, 0.53, 0.08, 1.0], 0.35), STEEL: ([0.25, 0.27, 0.30, 1.0], 0.5)}
_LIGHTS = {"key": ((0.6, -1.6, 3.0), 0.5), "fill": ((1.2, 2.0, 2.2), 0.2)}
_VIEWS = {
    "side": ((0.0, -1.0, 0.15), (1.0, 0.0, 0.0)),
    "corner": ((0.75, -0.75, 0.5), (1.0, 1.0, 0.0)),
}  # where the camera stands, seen from the arm, and what is to the right in its picture


def add_scene(spec: mujoco.MjSpec, centre: NDArray[np.float64], reach: float) -> None:
    """Add a floor at z = 0, sky, lights, materials, and cameras for `reach` [m] around `centre` (3,) [m]."""
    _add_materials(spec)
    world = spec.worldbody
    world.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 0.1], material="floor")
    for name, (offset, strength) in _LIGHTS.items():
        world.add_light(
            name=name,
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            pos=centre + offset,
            dir=-np.array(offset),
            diffuse=[strength] * 3,
            specular=[0.3 * strength] * 3,
            castshadow=name == "key",
        )
    for name, (direction, right) in _VIEWS.items():
        axes = np.column_stack([right, np.cross(direction, right), direction])
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, (axes / np.linalg.norm(axes, axis=0)).ravel())
        world.add_camera(
            name=name, pos=np.round(centre + 2.3 * reach * np.array(direction), 3), quat=quat, fovy=40
        )
    spec.visual.headlight.ambient = [0.25, 0.25, 0.25]
    spec.visual.headlight.diffuse = [0.2, 0.2, 0.2]
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1600, 1200
    spec.stat.center, spec.stat.extent = centre, reach


def _add_materials(spec: mujoco.MjSpec) -> None:
    for name, (colour, shine) in _COLOURS.items():
        spec.add_material(name=name, rgba=colour, specular=shine, shininess=shine)
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.86, 0.90, 0.94],
        rgb2=[0.50, 0.57, 0.65],
        width=128,
        height=128,
    )
    spec.add_texture(
        name="floor",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[0.58, 0.60, 0.62],
        rgb2=[0.52, 0.54, 0.56],
        width=256,
        height=256,
    )
    floor = spec.add_material(name="floor", texrepeat=[10, 10])
    floor.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "floor"
