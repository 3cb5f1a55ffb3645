"""What makes a model pleasant to look at, and contacts that are close by design."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from hydroid.mjcf import mujoco_errors

SCENE = """
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
"""
"""sections of an MJCF; `place_scene` puts lights and cameras around the arm"""


def clear_scene(spec: mujoco.MjSpec) -> None:
    """Delete what would stand beside the scene: lights, cameras, floors and the sky."""
    plane, sky = mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtTexture.mjTEXTURE_SKYBOX
    floors = [geom for geom in spec.geoms if geom.type == plane]
    looks = [*spec.textures, *spec.materials]
    named = [look for look in looks if look.name in ("floor", "sky") or getattr(look, "type", None) == sky]
    for part in (*spec.lights, *spec.cameras, *floors, *named):
        spec.delete(part)


def place_scene(spec: mujoco.MjSpec, base: NDArray[np.float64], tip: NDArray[np.float64]) -> None:
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
