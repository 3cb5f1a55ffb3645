"""Parameters in plain words, for readers who do not know their symbols."""

from hydroid.quantity_table import CHOICES
from hydroid.settings.fit import FitSettings


def plain_name(settings: FitSettings, parameter: str) -> str:
    """Say in plain words what a parameter is, and where it acts if several joints are compared."""
    own = settings.parameters[parameter]
    plain = CHOICES[own.quantity].plain
    if own.link is not None:
        return f"{plain} of {own.link}"
    joints = [] if len(settings.outputs) == 1 else own.joints or []
    where = f", {settings.arm.joint_names[joints[0] - 1]}" if len(joints) == 1 else ""
    return f"{plain}{where}"
