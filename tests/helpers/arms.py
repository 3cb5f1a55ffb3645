"""Small arms of a few lines of MJCF and YAML, and what plain MuJoCo makes of any
arm."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import yaml

from hydroid.arm.model import load_model
from hydroid.settings.arm import Arm, load_arm

MODELS = Path(__file__).parents[1] / "models"
BOOM = (MODELS / "boom.xml").read_text()
"""two joints, a hook that is fixed to the boom, no cylinders"""
CRANE = """<mujoco model="crane"><worldbody><body name="mast" pos="0 0 1">
  <joint name="luff" axis="0 -1 0" range="0 80"/>
  <inertial pos="1 0 0" mass="100" diaginertia="1 30 30"/>
  <body name="inner" pos="2 0 0"><joint name="telescope" type="slide" axis="1 0 0" range="0 3"/>
    <inertial pos="1 0 0" mass="50" diaginertia="1 10 10"/></body></body></worldbody></mujoco>"""
"""a mast that luffs, and a telescope on it, no cylinders"""
CYLINDER = {"kind": "linear", "area_a": 5000, "area_b": 3000, "max_opening": 20}
FOUR_BAR = {
    "ground": 0.35,
    "rocker": 0.45,
    "coupler": 0.4,
    "child": 0.35,
    "phase_deg": 69.0,
    "side": "right",
}
"""a bucket's linkage; ours"""
PARENT, CHILD = [4.2, 0.05, 2.4], [6.5, 0.05, 2.5]
"""pivots of a cylinder of the tilt in the world, all joints at 0"""


def write_arm(folder: Path, model: str = BOOM, **settings: Any) -> Arm:
    (folder / "arm.xml").write_text(model)
    (folder / "arm.yaml").write_text(yaml.safe_dump({"model": "arm.xml"} | settings))
    return load_arm(folder / "arm.yaml")


def posed(model: mujoco.MjModel, pose: Any) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_forward(model, data)
    return data


def with_masses(arm: Arm, masses: np.ndarray) -> mujoco.MjModel:
    """The whole arm with each link's inertia scaled with its mass, contacts off."""
    model = load_model(arm).compile()
    links = [model.body(name).id for name in arm.link_names]
    model.body_inertia[links] *= (masses / model.body_mass[links])[:, None]
    model.body_mass[links] = masses
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model
