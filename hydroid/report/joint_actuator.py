"""One joint's actuator, taken out of a candidate with hydraulics."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hydroid.errors import SettingsError
from hydroid.hydraulics.records import coefficients, linkages
from hydroid.hydraulics.solenoid import curve_exists
from hydroid.settings.arm import Arm
from hydroid.settings.linkage import LinearActuator, RotaryActuator
from hydroid.simulation import Candidates


@dataclass(frozen=True)
class JointActuator:
    """One joint's actuator: its COEFFICIENTS as one record, its linkage, the joint's range [deg]."""

    title: str
    parameters: Any
    linkage: LinearActuator | RotaryActuator
    range: tuple[float, float]


def joint_actuator(arm: Arm, candidate: Candidates, joint: int, source: str) -> JointActuator:
    """Return one joint's actuator, joint 1-based, of a candidate with hydraulics.

    Raises:
        SettingsError: no such joint, or no force-stroke curve runs through its two points.
    """
    if not 1 <= joint <= len(arm.joints):
        raise SettingsError(f"the arm has joints 1 to {len(arm.joints)}", where=f"joint {joint}")
    assert candidate.actuators is not None
    one = candidate.actuators[:1, [joint - 1]].view(np.recarray)
    p = coefficients(one, linkages(arm, [joint - 1], [joint - 1])).view(np.recarray)[0, 0]
    if not curve_exists(p.force_1, p.force_2, p.stroke_1, p.stroke_2):
        raise SettingsError(
            f"joint {joint}: no force-stroke curve runs through {p.force_1:g} N at {1e3 * p.stroke_1:g} mm "
            f"and {p.force_2:g} N at {1e3 * p.stroke_2:g} mm",
            where=source,
            hint="it needs F1 > F2 > 0, x2 > x1 > 0 and F1/F2 < (x2/x1)²",
        )
    settings = arm.joints[joint - 1]
    return JointActuator(f"Joint {joint}, {settings.name}", p, settings.actuator, settings.range)
