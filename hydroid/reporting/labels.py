"""What a page calls parameters and errors."""

import numpy as np

from hydroid.parameters import Array
from hydroid.quantity_table import CHOICES
from hydroid.settings.fit import FitSettings
from hydroid.settings.problem import ObjectiveSettings


def plain_name(settings: FitSettings, parameter: str) -> str:
    """Say in plain words what a parameter is, and where it acts if several joints are compared."""
    own = settings.parameters[parameter]
    plain = CHOICES[own.quantity].plain
    if own.link is not None:
        return f"{plain} of {own.link}"
    joints = [] if len(settings.outputs) == 1 else own.joints or []
    return f"{plain}, {settings.arm.joint_names[joints[0] - 1]}" if len(joints) == 1 else plain


def norm_label(objective: ObjectiveSettings) -> str:
    """Name the objective, with its unit."""
    label = {1: "mean absolute error", 2: "rms error", "inf": "largest error"}[objective.norm]
    return f"relative {label} [-]" if objective.relative else f"{label} [deg]"


def in_reader_units(objective: ObjectiveSettings, values: Array) -> Array:
    """Return objectives in deg, or as they are where relative."""
    return values if objective.relative else np.degrees(values)
