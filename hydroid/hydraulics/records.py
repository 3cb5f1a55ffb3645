"""Structured arrays of the hydraulics: what a joint is, what it carries from step to
step, scratch space.

A population's joints are one record array, shape (n, J), with a field per quantity of
`hydroid.quantity_table`, in SI: `joints.area_a` is an array, shape (n, J), and
`joints[i, j]` one joint. A rotary actuator's area_a and area_b are displacements
[m³/rad], its dead_volume is the constant volume of a chamber, its dry_friction a torque
[N·m]. Quantities that may be null are inf where they are. What the kernel reads and
writes has a record for each side, A and B, so that each law of a side is written once.
"""

import keyword
import math
from types import SimpleNamespace
from typing import Any, TypeAlias

import numpy as np

from hydroid.arrays import Array, Mask, Structs
from hydroid.hydraulics.elementwise import kept, ringing
from hydroid.hydraulics.solenoid import curve_exists, force_curve, plunger_weight
from hydroid.hydraulics.valve import KNOTS, conductance
from hydroid.quantity_table import CURVE, QUANTITIES, ROWS
from hydroid.settings.arm import Arm
from hydroid.settings.cylinder import LinearActuator
from hydroid.settings.hydraulics import HydraulicSettings, actuator_values
from hydroid.settings.linkage import four_bar, triangle

Records: TypeAlias = np.recarray[Any, Any]
Fields = list[tuple[str, Any]]

# kinds of actuator
NONE = 0
"""a joint without one keeps the constant torque that holds its start pose"""
LINEAR = 1
ROTARY = 2


def _fields(names: str) -> Fields:
    return [(name, np.float64) for name in names.split()]


BARS = ("ground", "rocker", "coupler", "child", "phase", "branch")
JOINT = np.dtype(
    [
        *((name, np.float64) for name in QUANTITIES if name != "mass"),
        ("kind", np.int64),
        *_fields(f"middle half sense retracted stroke {' '.join(BARS)}"),
    ]
)
"""all quantities of a joint and its actuator, in SI, and how it is moved: kind (NONE,
LINEAR or ROTARY); middle of its range and half of it [rad]; of a cylinder 1 if the rod
runs out towards positive angles, else -1, the angle at its triangle with the rod fully
in [rad], as at the end of the joint's range, and the stroke [m]; ground to branch are
those of `linkage.four_bar`, and rocker is 0 without one"""

_SIDED = [row.name for row in ROWS if isinstance(row.default, tuple)]
_PLAIN = [name for name in JOINT.names or () if name[:-2] not in _SIDED]
_SIDE_FIELDS = {
    name: f"{name}_" if keyword.iskeyword(name) else name for name in _SIDED
}

SIDE = np.dtype(
    [
        *((field, np.float64) for field in _SIDE_FIELDS.values()),
        ("delay_steps", np.int64),  # whole steps of the delay,
        ("fresh", np.float64),  # and sub-steps of the rest
        # part of the pilot stage's error that a sub-step leaves,
        ("pilot_keep", np.float64),
        ("pilot_steps", np.float64),  # and its lag in sub-steps
        ("plunger_weight", np.float64),  # of its new state in a sub-step
        ("lagging", np.float64),  # what lags at full opening, as `lag_of_speed` says
        ("has_curve", np.bool_),
        # parts of the opening that the power law gives where the parts of the valve's
        # curve end
        *((f"knot_{k}", np.float64) for k in range(1, len(KNOTS) + 1)),
    ]
)
"""what the kernel reads of one side of an actuator"""

COEFFICIENTS = np.dtype(
    [
        *((name, JOINT[name]) for name in _PLAIN),
        ("a", SIDE),
        ("b", SIDE),
        *_fields(
            "theta0 shortest coil gap conductance opening_keep opening_steps backflow relief"
        ),
        *_fields("ring_cosine ring_sine"),
    ]
)
"""what the kernel reads of a joint: its fields of JOINT, and constants that follow from
them; theta0 is the pivots' angle at joint angle 0 [rad], below 0 if the rod runs out
towards negative angles, shortest the cylinder's length with the rod fully in [m],
opening_keep the part of the opening's error that a sub-step leaves, opening_steps its
lag in sub-steps, backflow the least flow from the pump [m³/s], relief the pressure of
the pump's relief valve [Pa]; ring_cosine and ring_sine [s] are those of
`elementwise.ringing`"""

SIDE_STATE = np.dtype(
    _fields(
        "stroke speed drive "  # of the plunger [m, m/s], its coil [N·m²]
        "held "  # command that has settled, of which `drive` is [%]; else NaN
        # delayed command towards this side [%], and what the pilot stage has of it
        "asked pilot "
        # oil [Pa] as `cylinder` defines it; mean flow into the chamber over the last
        # step [m³/s]
        "oil flow"
    )
)
JOINT_STATE = np.dtype(
    [
        ("a", SIDE_STATE),
        ("b", SIDE_STATE),
        *_fields(
            # torque e that is neither oil nor damping; torque that held the start [N·m]
            "external hold "
            "angle velocity "  # at the start of the step [rad]; at its end [rad/s]
            # on ringing oil: velocity [rad/s], and how it changes without what passes
            # the oil at once [rad/s²]
            "turning surge "
            # how far the valve is open, of what `lag_of_speed` lets lag, from -1 (B) to
            # 1 (A): with the lag of its opening, and without
            "lagged unlagged "
            "displacement "  # of the spool [m], NaN before the first
            # of the look-ahead: turn [rad], velocity v*, torque, h κ
            "way predicted torque armature "
            # contact with what the joint rests on at the start: stiffness, below 0 if
            # from above [N·m/rad], and angle at which it ends [rad]
            "contact stop "
            # of the pump, the same at all joints: pressure of its line [Pa], its φ,
            # time of the demand [s]
            "line share demand"
        ),
    ]
)
"""what a joint carries from step to step"""

SIDE_SCRATCH = np.dtype(
    _fields(
        # of the step: pressure, sum of flows, delayed command before and after
        "pressure flow before after "
        # of a sub-step: whether oil fills the chamber, pressure, inflow and its fall
        # with the pressure
        "filled pushing inflow relief "
        # torque per pressure, pressure per volume, weight of the new state, pressure
        # rise per flow
        "lever rate weight rise "
        "pumped give"  # flow from the pump, its rise with the pump's pressure
    )
)
SCRATCH = np.dtype(
    [
        ("a", SIDE_SCRATCH),
        ("b", SIDE_SCRATCH),
        *_fields(
            # of the whole step: running sums over its sub-steps, and where the joint is
            "inertia way speed torque resistance oil_stiffness travel arm slope "
            # net opening of the valve [m²], below 0 towards B
            "open_area "
            # part by which oil is faster through the valve than at the references
            "faster "
            # of a sub-step: damping, oil stiffness times step, weight of the new state,
            # torque at rest, f and g of `pump`, and the mean of both
            "drag stiffness weight push thrust sweep pull"
        ),
    ]
)
"""a joint's scratch space during a look-ahead"""

LINE = np.dtype(
    _fields(
        # of the step: state, whether there is a command, decay of φ
        "pressure share demand demanded decay "
        # of joints that follow a log: flow into them, the part of the open centre that
        # their valves shut, and whether they have a command
        "taken shut asked "
        "centre "  # part of the valves' open centre that is left
        "faster "  # part by which the engine is faster than at the reference
        # of a sub-step: as `pump` sums them; change of pressure
        "drawn softness swept change"
    )
)
"""scratch space of the pump's line during a look-ahead"""


def unpacked(table: Structs) -> Any:
    """Return the fields of records as attributes, those of a side as attributes of it:
    plain arrays that share the records' memory.

    A record array looks each field up in 2 µs, which tells where laws read a hundred.
    """
    plain = table.view(np.ndarray)
    fields = SimpleNamespace()
    for name in table.dtype.names or ():
        column = plain[name]
        if column.dtype.names:
            column = unpacked(column)
        setattr(fields, name, column)
    return fields


def nominal_joints(arm: Arm, settings: HydraulicSettings) -> Structs:
    """Return what the settings and the arm's file say of the arm's joints, of JOINT,
    shape (J,)."""
    table = np.zeros(len(arm.joints), JOINT)
    for row, joint in zip(table, arm.joints, strict=True):
        actuator = joint.actuator
        # of the joint's range: middle, half and the retracted rod follow from them
        ends = np.array(joint.limits)
        for name, value in actuator_values(actuator, settings).items():
            if name == "mass":
                continue
            row[name] = math.inf if value is None else value * QUANTITIES[name].factor
        if actuator is not None:
            row["kind"] = ROTARY
            row["middle"] = ends.mean()
            row["half"] = 0.5 * np.ptp(ends)
        if isinstance(actuator, LinearActuator):
            row["kind"] = LINEAR
            _describe_cylinder(row, actuator, ends)
    return table


def _describe_cylinder(row: Any, actuator: LinearActuator, ends: Array) -> None:
    """Write what is of a cylinder to its joint, a row of JOINT, whose range has these
    ends [rad]."""
    row["sense"] = actuator.sense
    row["stroke"] = 1e-3 * actuator.stroke
    row["retracted"] = ends[np.argmin(actuator.length(ends))]
    bars = actuator.settings.four_bar
    if bars is None:
        return
    for name in BARS:
        row[name] = getattr(bars, name)
    # the triangle then has the angle of the rocker instead of the joint's
    row["retracted"] = four_bar(row["retracted"], bars)[0]


def has_force_curve(joints: Any) -> Mask:
    """Return which candidates have a force-stroke curve at every actuator, shape
    (n,)."""
    return curve_exists(
        joints.force_1, joints.force_2, joints.stroke_1, joints.stroke_2
    ).all(axis=1)


def coefficients(joints: Records, period: float = 0.01, substeps: int = 1) -> Records:
    """Lay out what the kernel reads of n candidates' V joints, of COEFFICIENTS, shape
    (n, V).

    `period` is that of a step [s].
    """
    table = np.zeros(joints.shape, COEFFICIENTS)
    c = unpacked(table)
    p = unpacked(joints)
    for name in _PLAIN:
        table[name] = getattr(p, name)
    table["theta0"] = p.sense * p.pivot_angle
    with np.errstate(invalid="ignore"):  # joints without a cylinder have no triangle
        triangles = triangle(
            p.retracted, p.pivot_distance_1, p.pivot_distance_2, c.theta0
        )
    table["shortest"] = triangles[0]
    table["coil"], table["gap"] = force_curve(
        p.force_1, p.force_2, p.stroke_1, p.stroke_2, p.rated_current
    )
    table["conductance"] = conductance(p.flow_coefficient)
    table["opening_steps"] = p.opening_lag * substeps / period
    table["opening_keep"] = kept(c.opening_steps)
    table["ring_cosine"], table["ring_sine"] = ringing(
        p.oil_frequency, p.oil_damping, period
    )
    # a pump with a limit has check valves
    table["backflow"] = np.where(np.isinf(p.pump_flow), -np.inf, 0.0)
    # the pump's relief valve opens where the joint of the highest pressure has it
    driven = p.kind != NONE
    relief = np.max(p.supply_pressure, axis=1, where=driven, initial=0.0)
    table["relief"] = relief[:, None]
    both = np.maximum(p.opening_a + p.opening_b, np.finfo(float).tiny)
    for end, side in (("a", c.a), ("b", c.b)):
        written = table[end]
        for name, field in _SIDE_FIELDS.items():
            written[field] = getattr(p, f"{name}_{end}")
        steps = side.delay / period
        written["delay_steps"] = np.floor(steps)
        written["fresh"] = (steps - side.delay_steps) * substeps
        # a side that never opens has a share, too: something must be left to divide by
        least = 1e-3 * both
        share = np.maximum(side.opening, least) / both
        written["lagging"] = share**p.lag_of_speed
        written["pilot_steps"] = side.pilot_lag * substeps / period
        written["pilot_keep"] = kept(side.pilot_steps)
        written["plunger_weight"] = plunger_weight(
            side.plunger_damping, period / substeps, c
        )
        bent = [written[name] != 1.0 for name in CURVE]
        written["has_curve"] = np.any(bent, axis=0)
        # a knot is a part of the travel; the curve asks for the share that the power
        # law gives there
        for k, knot in enumerate(KNOTS, 1):
            written[f"knot_{k}"] = knot**side.opening_exponent
    return table.view(np.recarray)
