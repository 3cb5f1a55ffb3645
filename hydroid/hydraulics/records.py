"""The records that the compiled loops work on: named fields instead of two hundred arguments."""

from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from hydroid.hydraulics.parameters import ActuatorParameters, Linkages
from hydroid.hydraulics.solenoid import force_curve
from hydroid.hydraulics.valve import conductance
from hydroid.settings.hydraulics import HydraulicSettings


def _record(names: str) -> np.dtype[np.void]:
    return np.dtype([(name, np.float64) for name in names.split()])


COEFFICIENTS = np.dtype(
    [(f.name, np.float64) for f in (*fields(ActuatorParameters), *fields(Linkages)) if f.name != "kind"]
    + [(name, np.float64) for name in ("coil", "gap", "conductance")]
    + [("kind", np.int64), ("quasi_static", np.int64)]
)
"""what the kernel reads of an actuator: its parameters, its linkage, and what follows from them"""

JOINT = _record(
    "stroke_a speed_a stroke_b speed_b oil_a oil_b flow_a flow_b external hold "
    "angle velocity way predicted torque armature"
)
"""what a joint carries from step to step: plungers, oil, the torque e, and its last look-ahead"""

WORK = _record(
    "inertia way speed torque resistance oil_stiffness flow_a flow_b travel arm slope pressure_a pressure_b "
    "fresh new_a new_b old_a old_b plunger_share wet_a wet_b pushed_a pushed_b q_a q_b g_a g_b "
    "resist arm_a arm_b rate_a rate_b share_a share_b give_a give_b stiff share push"
)
"""a joint's scratch pad during a look-ahead"""


def coefficients(
    parameters: ActuatorParameters, linkages: Linkages, settings: HydraulicSettings
) -> NDArray[np.void]:
    """Lay out what the kernel reads of n candidates' J actuators, shape (n, J)."""
    table = np.zeros(parameters.area_a.shape, COEFFICIENTS)
    for source in (parameters, linkages):
        for f in fields(source):
            table[f.name] = getattr(source, f.name)
    p = parameters
    table["coil"], table["gap"] = force_curve(p.force_1, p.force_2, p.stroke_1, p.stroke_2, p.rated_current)
    table["conductance"] = conductance(p.flow_coefficient, p.density)
    table["quasi_static"] = not settings.plunger_dynamics
    return table
