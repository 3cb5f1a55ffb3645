"""Structured arrays of the hydraulics: what an actuator is, what it carries from step to step, scratch space.

A population's parameters are a record array, shape (n, J), with one field per quantity of
`hydroid.settings.hydraulics` in SI: `parameters.area_a` is an array, shape (n, J), and `parameters[i, j]`
one actuator. Of a rotary actuator area_a and area_b are displacements [m³/rad], dead_volume is the constant
volume of a chamber, and dry_friction a torque [N·m]. Quantities that may be null are inf where they are.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import SettingsError
from hydroid.hydraulics.solenoid import curve_exists, force_curve
from hydroid.hydraulics.valve import conductance
from hydroid.settings.arm import Arm, Joint
from hydroid.settings.hydraulics import QUANTITIES, TARGETS, HydraulicSettings, actuator_values
from hydroid.settings.linkage import LinearActuator, four_bar, triangle

Array = NDArray[np.float64]
Records: TypeAlias = np.recarray[Any, Any]

NONE, LINEAR, ROTARY = 0, 1, 2
"""kinds of actuator; a joint with none keeps the constant torque that holds its start pose"""


def _fields(names: str) -> list[tuple[str, type]]:
    return [(name, np.float64) for name in names.split()]


PARAMETERS = np.dtype([(name, np.float64) for name in QUANTITIES])
"""all quantities of an actuator, in SI"""

BARS = ("ground", "rocker", "coupler", "child", "phase", "branch")
LINKAGE = np.dtype([("kind", np.int64), *_fields(" ".join(("a b theta0 shortest stroke", *BARS)))])
"""how a joint is moved: kind (NONE, LINEAR or ROTARY); pivots' distances a, b [m]; their angle theta0 at
joint angle 0 [rad], below 0 if the rod runs out towards negative angles; cylinder length with the rod fully
in [m], as at the end of the joint's range; stroke [m]; ground to branch are those of `linkage.four_bar`, and
rocker is 0 where there is none"""

COEFFICIENTS = np.dtype([*PARAMETERS.descr, *LINKAGE.descr, *_fields("coil gap conductance backflow relief")])
"""what the kernel reads of an actuator: its parameters, its linkage, and constants that follow from them;
backflow is the least flow from the pump [m³/s], relief the pressure of the pump's relief valve [Pa]"""

JOINT_STATE = np.dtype(
    _fields(
        "stroke_a speed_a stroke_b speed_b "  # plungers [m, m/s]
        "oil_a oil_b flow_a flow_b "  # oil [Pa] as `cylinder` defines it; mean flows of the last step [m³/s]
        "external hold "  # torque e that is neither oil nor damping; torque that held the start pose [N·m]
        "angle velocity "  # at the start of the step [rad, rad/s]
        "way predicted torque armature "  # of the look-ahead: turn [rad], velocity v*, torque, h κ
        # contact with what the joint rests on at the start: stiffness, below 0 if from above [N·m/rad],
        # and angle at which it ends [rad]
        "contact stop "
        # of the pump, the same at all joints: pressure of its line [Pa], its φ, time of the demand [s]
        "line share demand"
    )
)
"""what a joint carries from step to step"""

SCRATCH = np.dtype(
    _fields(
        # of the whole step: running sums over its sub-steps, and where the joint is
        "inertia way speed torque resistance oil_stiffness flow_a flow_b "
        "travel arm slope pressure_a pressure_b "
        # coils A and B: sub-steps until the newer command acts, drives before and after, weight of
        # the new state
        "fresh_a fresh_b new_a new_b old_a old_b plunger_weight_a plunger_weight_b "
        # of a sub-step, chambers A and B: whether oil fills them, pressure, inflow, its fall with pressure
        "filled_a filled_b pushing_a pushing_b inflow_a inflow_b relief_a relief_b "
        # torque per pressure, pressure per volume, weight of the new state, pressure rise per flow
        "lever_a lever_b rate_a rate_b weight_a weight_b rise_a rise_b "
        # of a sub-step, the joint: damping, oil stiffness times step, weight of the new state, torque at rest
        "drag stiffness weight push "
        # of a sub-step, the pump: flows into A and B from it, their rise with its pressure, f of `pump`
        "pumped_a pumped_b give_a give_b thrust"
    )
)
"""a joint's scratch space during a look-ahead"""

LINE = np.dtype(
    _fields(
        # of the step: state, whether there is a command, decay of φ, flow into joints that follow a log
        "pressure share demand demanded decay taken "
        "drawn softness swept change"  # of a sub-step: as `pump` sums them; change of pressure
    )
)
"""scratch space of the pump's line during a look-ahead"""


def nominal_parameters(
    arm: Arm, settings: HydraulicSettings, joints: Sequence[int], candidates: int = 1
) -> Records:
    """Return what the settings say of the moving joints, the same for n candidates, shape (n, J).

    Joints are 0-based, in the order of the stepped model. Areas and valve openings are the arm's.
    """
    row = [_nominal(arm.joints[j], settings) for j in joints]
    return np.tile(np.array(row, PARAMETERS), (candidates, 1)).view(np.recarray)


def _nominal(joint: Joint, settings: HydraulicSettings) -> tuple[float, ...]:
    values = actuator_values(joint.actuator, settings)
    factors = ((values[name], q.factor) for name, q in QUANTITIES.items())
    return tuple(math.inf if value is None else value * factor for value, factor in factors)


def with_values(parameters: Records, values: Mapping[str, Any]) -> Records:
    """Return the parameters, shape (n, J), with some quantities replaced; n may grow from 1.

    The values, by a name of TARGETS in the units of QUANTITIES, have shapes that broadcast to (n, J).
    """
    shape = np.broadcast_shapes(parameters.shape, *(np.shape(v) for v in values.values()))
    replaced = np.broadcast_to(parameters, shape).copy().view(np.recarray)
    for name, value in values.items():
        for target in TARGETS[name]:
            replaced[target] = np.asarray(value) * QUANTITIES[target].factor
    return replaced


def drawing_values(parameters: Records, joints: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return the units, and the parameters of some joints, shape (K,), by joint and quantity in them."""
    rows = {
        joint: {name: float(row[name] / q.factor) for name, q in QUANTITIES.items()}
        for joint, row in zip(joints, parameters, strict=True)
    }
    return {"units": {name: q.unit for name, q in QUANTITIES.items()}} | rows


def has_force_curve(parameters: Records) -> NDArray[np.bool_]:
    """Return which candidates have a force-stroke curve at every actuator, shape (n,)."""
    p = parameters
    return np.asarray(curve_exists(p.force_1, p.force_2, p.stroke_1, p.stroke_2).all(axis=1), dtype=bool)


def linkages(
    arm: Arm, joints: Sequence[int], driven: Sequence[int], parameters: Records | None = None
) -> Records:
    """Return how the moving joints (0-based, as stepped) are moved, a record array of LINKAGE, shape (n, J).

    Those that are not `driven` have no hydraulic actuator. Pivots are those of the parameters, shape (n, J),
    or the arm's own, with n = 1.
    """
    table = np.zeros((1 if parameters is None else len(parameters), len(joints)), LINKAGE)
    for place, j in enumerate(joints):
        if j not in driven:
            continue
        actuator = arm.joints[j].actuator
        if actuator is None:
            raise without_actuator(arm, j)
        one = table[:, place]
        one["kind"] = ROTARY
        if isinstance(actuator, LinearActuator):
            one["kind"], one["stroke"] = LINEAR, 1e-3 * actuator.stroke
            sides, bars = actuator.triangle, actuator.settings.four_bar
            own = sides.a, sides.b, math.radians(sides.theta0)
            if parameters is not None:
                p = parameters[:, place]
                own = p["pivot_distance_1"], p["pivot_distance_2"], p["pivot_angle"]
            one["a"], one["b"], one["theta0"] = own[0], own[1], actuator.sense * own[2]
            ends = np.radians(arm.joints[j].range)
            retracted = float(ends[int(np.argmin(actuator.length(ends)))])
            if bars is not None:
                for name in BARS:
                    one[name] = getattr(bars, name)
                retracted = four_bar(retracted, bars)[0]
            one["shortest"] = triangle(retracted, one["a"], one["b"], one["theta0"])[0]
    return table.view(np.recarray)


def without_actuator(arm: Arm, joint: int) -> SettingsError:
    """Return the error of a joint, 0-based, that is driven in stage 2 and has no actuator."""
    what = f"joint {joint + 1} ({arm.joints[joint].name}) has no actuator"
    hint = "stage 2 needs its cylinder (two pivots, areas) or rotary actuator: add actuator: to the joint"
    return SettingsError(what, where=f"the arm's file of {arm.name}", hint=hint)


def coefficients(parameters: Records, linkages: Records) -> NDArray[np.void]:
    """Lay out what the kernel reads of n candidates' J actuators, of COEFFICIENTS, shape (n, J)."""
    table = np.zeros(parameters.shape, COEFFICIENTS)
    for source in (parameters, linkages):
        for name in source.dtype.names or ():
            table[name] = source[name]
    p = parameters
    table["coil"], table["gap"] = force_curve(p.force_1, p.force_2, p.stroke_1, p.stroke_2, p.rated_current)
    table["conductance"] = conductance(p.flow_coefficient, p.density)
    table["backflow"] = np.where(np.isinf(p.pump_flow), -np.inf, 0.0)
    driven = linkages.kind != NONE
    table["relief"] = np.max(p.supply_pressure, axis=1, where=driven, initial=0.0)[:, None]
    return table
