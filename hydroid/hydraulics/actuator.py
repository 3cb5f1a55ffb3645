"""The actuators of a population beside MuJoCo: how they start, and the pressures in
their chambers.

`make_plugin` lays out what compiled code reads, and `at_rest` the state that it
changes; then `hydroid.simulation.rollout` repeats, for one candidate at a time,

    kernel.look_ahead   MuJoCo's step gets qfrc_applied = torque and dof_armature =
                        armature plus the arm's own
    kernel.take_over    MuJoCo's qpos becomes the angle that follows from its new
                        velocity

J is the number of moving joints, n that of candidates. All joints that move belong in,
also those without hydraulics (kind NONE): their inertia couples. The plugin integrates
viscous damping, so MuJoCo's dof_damping must be 0.
"""

import numpy as np

from hydroid.arrays import Array, Index, Structs
from hydroid.hydraulics.cylinder import GIVE, holding_pressures, rod_motion
from hydroid.hydraulics.kernel import Plugin
from hydroid.hydraulics.oil import fills
from hydroid.hydraulics.records import (
    JOINT_STATE,
    NONE,
    Records,
    coefficients,
    unpacked,
)
from hydroid.hydraulics.solenoid import drive, resting_stroke
from hydroid.hydraulics.valve import faster

# in chamber B at the start where neither settings nor log say [Pa]; ours
START_PRESSURE = 50e5


def make_plugin(
    joints: Records, entries: Index, period: float, substeps: int
) -> Plugin:
    """Return the actuators of n candidates, of JOINT, (n, J), with substeps in MuJoCo's
    step, the period [s].

    The coil of an infeasible candidate has no force. `entries` say where M[i, j] stands
    in a row of MuJoCo's sparse mass matrix, shape (J, J).
    """
    table = coefficients(joints, period, substeps).view(np.ndarray)
    return plugin_of(table, entries, period, substeps)


def plugin_of(table: Structs, entries: Index, period: float, substeps: int) -> Plugin:
    """Return the same from what the kernel reads of them, of COEFFICIENTS, (n, J)."""
    driven = table["kind"][0] != NONE
    order = np.argsort(driven, stable=True)
    idle = int(np.sum(~driven))
    return Plugin(table, order, entries[np.ix_(order, order)], idle, period, substeps)


def under_conditions(joints: Records, engine: float, warmer: float) -> Records:
    """Return candidates' joints, of JOINT, as they are at a constant engine speed over
    its reference, with oil warmer than at its own [K].

    What `kernel.take_conditions` does to valves and pump from step to step is in their
    values here.
    """
    changed = joints.copy()
    eased = 1.0 + faster(joints, engine, warmer)
    for side in "ab":
        changed[f"opening_{side}"] = eased * joints[f"opening_{side}"]
    changed["pump_flow"] = engine * joints.pump_flow
    # a multiple of that flow, and an opening that no engine changes
    changed["pump_bypass"] = joints.pump_bypass / engine
    return changed


def at_rest(plugin: Plugin, angle: Array, torque: Array) -> Structs:
    """Return the state at rest at `angle` [rad], with the coils at I_min, of
    JOINT_STATE, shape (n, J).

    The torque g(q) [N·m] is what the actuators must hold, or what a joint rests on
    where oil is trapped; both have the shape (n, J).
    """
    c = unpacked(plugin.coefficients)
    travel, lever, _ = rod_motion(angle, c)
    stated = np.isfinite(c.start_pressure)
    level = np.where(stated, c.start_pressure, START_PRESSURE)
    pressure_a, pressure_b = holding_pressures(
        torque / lever, c.a.area, c.b.area, c.supply_pressure, c.tank_pressure, level
    )
    rests = np.isfinite(c.trapped_pressure) & (c.kind != NONE)
    pressure_a = np.where(rests, c.trapped_pressure, pressure_a)
    pressure_b = np.where(rests, level, pressure_b)
    fill_a, fill_b = fills(travel, c)
    state = np.zeros(plugin.coefficients.shape, JOINT_STATE)
    state["a"]["oil"] = pressure_a + c.bulk_modulus * fill_a
    state["b"]["oil"] = pressure_b + c.bulk_modulus * fill_b
    idle_drive = drive(0.0, c)
    for side in "ab":
        plunger = state[side]
        plunger["drive"] = idle_drive
        plunger["stroke"] = resting_stroke(idle_drive, c.gap, c.plunger_stiffness)
    # the first step has no step before it that says what else acts: it is what is held
    state["hold"] = torque
    state["external"] = -torque
    # what trapped oil does not carry, the joint rests on
    by_oil = lever * (c.a.area * pressure_a - c.b.area * pressure_b)
    carried = np.where(rests, torque - by_oil, 0.0)
    state["contact"] = carried / GIVE
    state["stop"] = angle + np.sign(carried) * GIVE
    state["line"] = c.relief
    state["share"] = c.pump_idle
    # equal to no displacement: the first sub-step works out the opening
    state["displacement"] = np.nan
    return state


def pressures(coefficients: Structs, state: Structs, angle: Array) -> Array:
    """Return the pressures of chambers A and B [Pa], shape (n, J, 2), 0 of a joint
    without actuator.

    They are those of COEFFICIENTS and states at `angle` [rad], shape (n, J). With the
    coefficients of one candidate, shape (J,), n may as well be the samples of its
    record.
    """
    c = unpacked(coefficients)
    fill_a, fill_b = fills(rod_motion(angle, c)[0], c)
    pressure_a = state["a"]["oil"] - c.bulk_modulus * fill_a
    pressure_b = state["b"]["oil"] - c.bulk_modulus * fill_b
    # less oil than the chamber's volume: it cavitates
    both = np.maximum(np.stack([pressure_a, pressure_b], axis=-1), 0.0)
    driven = c.kind != NONE
    return np.where(driven[..., None], both, 0.0)


def swallowed(c: Records, angle: Array, velocity: Array) -> Array:
    """Flow [m³/s] that a motion takes from the pump at an angle [rad] and velocity
    [rad/s].

    Elementwise over COEFFICIENTS; 0 of a joint without actuator.
    """
    speed = rod_motion(angle, c)[1] * velocity
    # the chamber that fills is fed by the pump, the other one empties to the tank
    filled_a = c.a.draw * c.a.area
    filled_b = -c.b.draw * c.b.area
    area = np.where(speed > 0, filled_a, filled_b)
    return np.where(c.kind == NONE, 0.0, area * speed)
