"""Small arms of a few lines of MJCF and YAML."""

from pathlib import Path
from typing import Any

import yaml

from hydroid.settings.arm import Arm, load_arm

BOOM = """
<mujoco model="boom">
  <worldbody>
    <body name="base" pos="0 0 1.5">
      <body name="boom" pos="0.2 0 0.5">
        <joint name="lift" axis="0 -1 0" range="-20 60"/>
        <geom type="box" size="3 0.15 0.25" pos="3 0 0" mass="1500"/>
        <body name="hook" pos="5 0 0"><geom size="0.1" mass="20"/></body>
        <body name="bar" pos="6 0 0">
          <joint name="tilt" axis="0 -1 0" range="-60 60"/>
          <geom type="cylinder" fromto="0 0 0 2 0 -2" size="0.1" mass="90"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
"""two joints, a hook that is fixed to the boom, no cylinders"""
CYLINDER = {"kind": "linear", "area_a": 5000, "area_b": 3000, "max_opening": 20}
PARENT, CHILD = [4.2, 0.05, 2.4], [6.5, 0.05, 2.5]
"""pivots of a cylinder of the tilt in the world, all joints at 0"""


def write_arm(folder: Path, model: str = BOOM, **settings: Any) -> Arm:
    """Write arm.xml and arm.yaml, and read them."""
    (folder / "arm.xml").write_text(model)
    (folder / "arm.yaml").write_text(yaml.safe_dump({"model": "arm.xml"} | settings))
    return load_arm(folder / "arm.yaml")
