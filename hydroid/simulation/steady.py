"""The speed at which a joint moves steadily in a pose: the law itself of either model, no simulated motion.

The command is held, and all that starts, lags or rings has passed: the plungers rest, the pump gives its full
flow, pressures and speed no longer change. Lever and load are those of the pose. Then what a chamber takes in
is its area times the speed of the rod,

    Q_A(p_A, P) = A_A v,   Q_B(p_B, P) = −A_B v,   A_A p_A − A_B p_B = F + d v + dry friction,

with the flows of `valve.port_flow`, the pump's line at P where the pump gives what is drawn, and a chamber at
0 where it cavitates. The force that is left falls with v, and the pressures are monotone in it, so there is
one speed. It is 0 where the joint's dry friction holds the load. In the quasi-static model the speed is that
of `quasi_static.rod_speed`.
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

from typing import Any

import numpy as np
from numba import njit

from hydroid.arrays import Array
from hydroid.hydraulics.cylinder import friction_damping
from hydroid.hydraulics.elementwise import compilable
from hydroid.hydraulics.joint import opened
from hydroid.hydraulics.kernel import Plugin, make_pad, source_key
from hydroid.hydraulics.pump import delivery
from hydroid.hydraulics.records import Records, coefficients, has_force_curve
from hydroid.hydraulics.solenoid import beyond_dead_band, drive, resting_stroke, side_voltage
from hydroid.hydraulics.valve import port_flow
from hydroid.simulation import quasi_static, rollout
from hydroid.simulation.quasi_static import LEAST_LEVER, line_pressure, rod_speed, weigh

SOURCE = source_key(rollout.__file__, quasi_static.__file__)
FIRST_SPEED, MOST_SPEED = 1e-6, 1e3
"""a rod's speeds between which the steady one is sought [m/s], or [rad/s]"""
MOST_PRESSURE = 1e12  # of a chamber from which nothing can leave [Pa]
PRECISE = 1e-13  # relative error at which a search ends
HALVINGS = 60  # of the line's pressure: to rounding


@compilable
def steady_stroke(asked: float, side, c) -> float:
    """Stroke [m] of a side's plunger under a command towards it [%] that is held."""
    beyond, part = beyond_dead_band(asked, asked, 0.0, 0.0, side.dead_band)
    pull = drive(side_voltage(beyond, part, side.onset, side.dead_band), c)
    return resting_stroke(pull, c.gap, c.plunger_stiffness)


@compilable
def steady_opening(command: float, c) -> float:
    """Net opening [m²] of a valve under a command [%] that is held, below 0 towards B."""
    travel = steady_stroke(command, c.a, c) - steady_stroke(-command, c.b, c)
    return opened(c.a, travel) if travel > 0.0 else -opened(c.b, -travel)


@compilable
def chamber_pressure(flow: float, supply: float, pump_area: float, tank_area: float, c) -> Any:
    """Pressure [Pa] at which a flow [m³/s] enters a chamber through its edges [m²], and what the pump gives.

    It is 0 where the flow is more than an empty chamber takes in.
    """
    into, _, pumped, _ = port_flow(0.0, supply, pump_area, tank_area, c)
    if into <= flow:
        return 0.0, pumped
    low, high = 0.0, max(supply, c.tank_pressure)
    while high < MOST_PRESSURE and port_flow(high, supply, pump_area, tank_area, c)[0] > flow:
        low, high = high, 2.0 * high
    pressure, change = 0.5 * (low + high), high - low
    while True:  # Newton's method, or a halving where its steps do not halve: at an edge without a drop
        into, fall, pumped, _ = port_flow(pressure, supply, pump_area, tank_area, c)
        if into > flow:
            low = pressure
        else:
            high = pressure
        after = pressure + (into - flow) / fall if fall > 0.0 else low
        if not low < after < high or abs(after - pressure) > 0.5 * change:
            after = 0.5 * (low + high)
        change = abs(after - pressure)
        if change <= PRECISE * high:
            return pressure, pumped
        pressure = after


@compilable
def surplus(speed: float, supply: float, c, w) -> Any:
    """Force [N] that oil at a rod's speed [m/s] has beyond load and damping, and flow from the pump [m³/s].

    `w` has the net opening `travel` [m²], the load `push` [N], and the damping `drag` [N·s/m].
    """
    a, b = max(w.travel, 0.0), max(-w.travel, 0.0)
    edges_a = c.leakage + a, c.leakage + b * c.a.return_
    edges_b = c.leakage + b, c.leakage + a * c.b.return_
    pressure_a, pumped_a = chamber_pressure(c.a.area * speed, supply, edges_a[0], edges_a[1], c)
    pressure_b, pumped_b = chamber_pressure(-c.b.area * speed, supply, edges_b[0], edges_b[1], c)
    against = w.push + (w.drag + friction_damping(speed, c.dry_friction)) * speed
    force = c.a.area * pressure_a - c.b.area * pressure_b - against
    return force, c.a.draw * pumped_a + c.b.draw * pumped_b


@compilable
def balanced_speed(supply: float, c, w) -> Any:
    """Speed [m/s] of the rod at which no force is left, and flow from the pump [m³/s], at a supply [Pa]."""
    left, drawn = surplus(0.0, supply, c, w)
    held = c.friction / max(abs(w.arm), LEAST_LEVER)
    if abs(left) <= held:
        return 0.0, drawn
    sign = 1.0 if left > 0.0 else -1.0
    low, high, force_low = 0.0, FIRST_SPEED, abs(left) - held
    force_high = sign * surplus(sign * high, supply, c, w)[0] - held
    while force_high > 0.0 and high < MOST_SPEED:
        low, force_low, high = high, force_high, 4.0 * high
        force_high = sign * surplus(sign * high, supply, c, w)[0] - held
    speed, last, count = high, 0, 0
    while high - low > PRECISE * high:  # regula falsi by the Illinois rule, now and then a halving
        before, count = speed, count + 1
        speed = low + (high - low) * force_low / (force_low - force_high)
        if count % 8 == 0 or not low < speed < high:
            speed = 0.5 * (low + high)
        left, drawn = surplus(sign * speed, supply, c, w)
        force = sign * left - held
        if force == 0.0 or abs(speed - before) <= PRECISE * speed:
            break
        if force > 0.0:
            low, force_low = speed, force
            force_high *= 0.5 if last > 0 else 1.0
        else:
            high, force_high = speed, force
            force_low *= 0.5 if last < 0 else 1.0
        last = 1 if force > 0.0 else -1
    return sign * speed, drawn


@compilable
def _dynamic(c, w) -> float:
    if c.pump_flow == np.inf:
        return balanced_speed(c.supply_pressure, c, w)[0]
    low, high, pressure = 0.0, c.relief, c.relief
    for _ in range(HALVINGS):  # what is drawn rises with the line's pressure, and what is given falls
        speed, drawn = balanced_speed(min(pressure, c.supply_pressure), c, w)
        if drawn > delivery(pressure, 1.0, c)[0]:
            high = pressure
        elif pressure == c.relief:
            return speed
        else:
            low = pressure
        pressure = 0.5 * (low + high)
    return balanced_speed(min(pressure, c.supply_pressure), c, w)[0]


@compilable
def _quasi_static(plugin: Plugin, pad) -> float:
    c, w, supply = plugin.coefficients[0], pad.joints[0], plugin.coefficients[0].supply_pressure
    if c.pump_flow < np.inf:
        pad.line[0].pressure = c.relief
        supply = min(supply, line_pressure(plugin, pad.joints, pad.line[0], 1.0, c))
    speed = rod_speed(c, w, supply)[0]
    return speed if w.travel > 0.0 else -speed


@njit(cache=True, nogil=True, error_model="numpy")
def _steady(plugin: Plugin, where, commands, quasi: bool, velocity, source: int = SOURCE) -> None:
    """Write the velocities [rad/s] of n candidates' joint under m commands [%], (n, m).

    `where` has the angle [rad] and the torque that holds the joint there [N·m], (n, 2).
    """
    pad = make_pad(1)
    for i in range(velocity.shape[0]):
        one = Plugin(plugin.coefficients[i : i + 1], plugin.order, plugin.entries, 0, plugin.period, 1)
        c, w = one.coefficients[0], pad.joints[0]
        weigh(c, w, where[i, 0], where[i, 1])
        for k in range(commands.size):
            w.travel = steady_opening(commands[k], c)
            still = w.travel == 0.0 and (quasi or c.leakage == 0.0)
            speed = 0.0 if still else _quasi_static(one, pad) if quasi else _dynamic(c, w)
            velocity[i, k] = speed / w.arm


def steady_velocity(
    joint: Records, angle: Array, torque: Array, commands: Array, *, quasi_static: bool
) -> Array:
    """Return the velocities [rad/s] at which a joint turns steadily under m commands [%], shape (n, m).

    Args:
        joint: n candidates' values, of JOINT, shape (n,).
        angle: of the pose [rad], shape (n,).
        torque: that holds the joint there against gravity and springs [N·m], shape (n,).
        quasi_static: whether the law is that of the quasi-static model.

    Of a joint that slides they are in m/s, and the torque is a force [N]. NaN where no force-stroke curve
    exists.
    """
    alone: Records = joint[:, None]  # pyright: ignore[reportAssignmentType]
    table, place = coefficients(alone)[:, 0].view(np.ndarray), np.zeros(1, np.intp)
    velocity, where = np.empty((len(joint), len(commands))), np.column_stack([angle, torque])
    _steady(Plugin(table, place, place[None], 0, 1.0, 1), where, commands, quasi_static, velocity)
    velocity[~has_force_curve(alone)] = np.nan
    return velocity
