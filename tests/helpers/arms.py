"""Small arms of a few lines of MJCF and YAML."""

from pathlib import Path
from typing import Any

import yaml

from hydroid.settings.arm import Arm, load_arm

MODELS = Path(__file__).parents[1] / "models"
BOOM = (MODELS / "boom.xml").read_text()
"""two joints, a hook that is fixed to the boom, no cylinders"""
CYLINDER = {"kind": "linear", "area_a": 5000, "area_b": 3000, "max_opening": 20}
PARENT, CHILD = [4.2, 0.05, 2.4], [6.5, 0.05, 2.5]
"""pivots of a cylinder of the tilt in the world, all joints at 0"""


def write_arm(folder: Path, model: str = BOOM, **settings: Any) -> Arm:
    """Write arm.xml and arm.yaml, and read them."""
    (folder / "arm.xml").write_text(model)
    (folder / "arm.yaml").write_text(yaml.safe_dump({"model": "arm.xml"} | settings))
    return load_arm(folder / "arm.yaml")
