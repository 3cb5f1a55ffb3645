"""The speed at which a joint of the dynamic model moves steadily through a pose: the
law itself, without a simulated motion.

The command is held, and all that starts, lags or rings has passed: the plungers rest,
and the pump gives its full flow. Lever and load are those of the pose. The flow into a
chamber is then its area times the speed of the rod,

    Q_A(p_A, P) = A_A v,   Q_B(p_B, P) = −A_B v,   A_A p_A − A_B p_B = F + d v + dry friction,

with the flows of `valve.port_flow`, the pump's line at P where the pump gives what is
drawn, and a chamber at 0 where it cavitates. The force that is left falls with v, and
the pressures are monotone in it, so there is one speed. It is 0 where the joint's dry
friction holds the load.

Lever and load change on the way, and the oil yields to that: a chamber takes in V/β ṗ
more. With the steady pressures at both sides of the pose, ṗ = v dp/dx, which counts as
a change of the area that oil has to fill. What is left out is of second order: the
joint's acceleration on the way.
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

from typing import Any

import numpy as np

from hydroid.hydraulics.cylinder import rod_way, weigh
from hydroid.hydraulics.elementwise import compilable
from hydroid.hydraulics.joint import open_share
from hydroid.hydraulics.oil import volumes
from hydroid.hydraulics.pump import delivery, left_open, lowest, past_valves
from hydroid.hydraulics.records import LINEAR
from hydroid.hydraulics.seals import LEAST_LEVER, friction_damping, joint_friction
from hydroid.hydraulics.solenoid import (
    beyond_dead_band,
    drive,
    resting_stroke,
    side_voltage,
)
from hydroid.hydraulics.valve import port_flow

# a rod's speeds between which the steady one is sought [m/s], or [rad/s]
FIRST_SPEED = 1e-6
MOST_SPEED = 1e3
MOST_PRESSURE = 1e12  # of a chamber from which nothing can leave [Pa]
# how far from the pose pressures are compared with those in it [rad], or [m]
NEAR = 1e-2
LEAST_AREA = 0.1
"""part of its area by which a chamber takes in oil at least, however much the oil
yields on the way"""
PRECISE = 1e-13  # relative error at which a search ends


@compilable
def false_position(low: float, high: float, under: float, over: float) -> float:
    """Where a line through values at both ends of a bracket is 0."""
    return low + (high - low) * under / (under - over)


@compilable
def illinois(value: float, again: bool) -> float:
    """Value at the end of a bracket that stays, after the other one moved, `again` or
    not.

    By the Illinois rule it counts for half where the other end moved twice in a row:
    else a curved function would keep that end for ever.
    """
    return 0.5 * value if again else value


@compilable
def steady_stroke(asked: float, side, c) -> float:
    """Stroke [m] of a side's plunger under a command towards it [%] that is held."""
    beyond, part = beyond_dead_band(asked, asked, 0.0, 0.0, side.dead_band)
    pull = drive(side_voltage(beyond, part, side.onset, side.dead_band), c)
    return resting_stroke(pull, c.gap, c.plunger_stiffness)


@compilable
def steady_opening(command: float, c) -> float:
    """Net opening [m²] of a valve under a command [%] that is held, below 0 towards
    B."""
    # the spool stands where both plungers push it
    pushed_a = steady_stroke(command, c.a, c)
    pushed_b = steady_stroke(-command, c.b, c)
    travel = pushed_a - pushed_b
    if travel > 0.0:
        return c.a.opening * open_share(c.a, travel)
    return -c.b.opening * open_share(c.b, -travel)


@compilable
def chamber_pressure(
    flow: float, supply: float, pump_area: float, tank_area: float, c
) -> Any:
    """Pressure [Pa] at which a flow [m³/s] enters a chamber through its edges [m²], and
    what the pump gives.

    It is 0 where the flow is more than an empty chamber takes in.
    """
    into, _, pumped, _ = port_flow(0.0, supply, pump_area, tank_area, c)
    if into <= flow:
        return 0.0, pumped
    low = 0.0
    high = max(supply, c.tank_pressure)
    # a load may press beyond both
    while (
        high < MOST_PRESSURE
        and port_flow(high, supply, pump_area, tank_area, c)[0] > flow
    ):
        low = high
        high = 2.0 * high
    pressure = 0.5 * (low + high)
    change = high - low
    # Newton's method, or a halving where its steps do not halve: at an edge without a
    # drop
    while True:
        into, fall, pumped, _ = port_flow(pressure, supply, pump_area, tank_area, c)
        if into > flow:
            low = pressure
        else:
            high = pressure
        after = low
        if fall > 0.0:
            after = pressure + (into - flow) / fall
        if not low < after < high or abs(after - pressure) > 0.5 * change:
            after = 0.5 * (low + high)
        change = abs(after - pressure)
        if change <= PRECISE * high:
            return pressure, pumped
        pressure = after


@compilable
def oil_at(speed: float, supply: float, c, w, takes) -> Any:
    """Pressures of chambers A and B [Pa] at a rod's speed [m/s], and flow from the pump
    [m³/s].

    `w` has the valve's net opening `open_area` [m²]. The chambers take in oil as pistons
    of the areas that `takes` has [m²] do.
    """
    a = max(w.open_area, 0.0)
    b = max(-w.open_area, 0.0)
    return_a = c.leakage + b * c.a.return_
    return_b = c.leakage + a * c.b.return_
    flow_a = takes[0] * speed
    flow_b = -takes[1] * speed
    pressure_a, pumped_a = chamber_pressure(flow_a, supply, c.leakage + a, return_a, c)
    pressure_b, pumped_b = chamber_pressure(flow_b, supply, c.leakage + b, return_b, c)
    return pressure_a, pressure_b, c.a.draw * pumped_a + c.b.draw * pumped_b


@compilable
def surplus(speed: float, supply: float, c, w, takes) -> Any:
    """Force [N] that oil at a rod's speed [m/s] has beyond load and damping, and flow
    from the pump [m³/s].

    `w` has the load `push` [N], and the damping `drag` [N·s/m].
    """
    pressure_a, pressure_b, drawn = oil_at(speed, supply, c, w, takes)
    against = w.push + (w.drag + friction_damping(speed, c.dry_friction)) * speed
    return c.a.area * pressure_a - c.b.area * pressure_b - against, drawn


@compilable
def balanced_speed(supply: float, c, w, takes) -> Any:
    """Speed [m/s] of the rod at which no force is left, and flow from the pump [m³/s],
    at a supply [Pa]."""
    left, drawn = surplus(0.0, supply, c, w, takes)
    # a joint at rest is held by its dry friction, whatever the direction
    held = joint_friction(c, w.arm)
    if abs(left) <= held:
        return 0.0, drawn
    sign = 1.0 if left > 0.0 else -1.0
    # the force beyond friction is above 0 at `low`, and below it at `high`
    low = 0.0
    force_low = abs(left) - held
    high = FIRST_SPEED
    force_high = sign * surplus(sign * high, supply, c, w, takes)[0] - held
    while force_high > 0.0 and high < MOST_SPEED:
        low = high
        force_low = force_high
        high = 4.0 * high
        force_high = sign * surplus(sign * high, supply, c, w, takes)[0] - held
    speed = high
    last = 0
    count = 0
    while high - low > PRECISE * high:
        before = speed
        count += 1
        speed = false_position(low, high, force_low, force_high)
        # where the rule creeps, a halving now and then
        if count % 8 == 0 or not low < speed < high:
            speed = 0.5 * (low + high)
        left, drawn = surplus(sign * speed, supply, c, w, takes)
        force = sign * left - held
        if force == 0.0 or abs(speed - before) <= PRECISE * speed:
            break
        if force > 0.0:
            low = speed
            force_low = force
            force_high = illinois(force_high, last > 0)
            last = 1
        else:
            high = speed
            force_high = force
            force_low = illinois(force_low, last < 0)
            last = -1
    return sign * speed, drawn


@compilable
def excess_at(pressure: float, c, w, takes) -> float:
    """Flow [m³/s] by which more is taken from the line at a pressure [Pa] than the pump
    gives."""
    _, drawn = balanced_speed(min(pressure, c.supply_pressure), c, w, takes)
    past, _ = past_valves(pressure, left_open(1.0, c, w.open_area), c)
    return drawn + past - delivery(pressure, 1.0, c)[0]


@compilable
def lone_pressure(c, w, takes) -> float:
    """Pressure of the line [Pa] at which the pump gives what the only joint takes.

    What is taken rises with the pressure, and what is given falls.
    """
    low = lowest(c)
    high = c.relief
    over = excess_at(high, c, w, takes)
    if over <= 0.0:
        return high
    under = excess_at(low, c, w, takes)
    if under >= 0.0:
        return low
    pressure = low
    last = 0
    count = 0
    while high - low > PRECISE * c.relief:
        before = pressure
        count += 1
        pressure = false_position(low, high, under, over)
        # where the rule creeps, a halving now and then
        if count % 4 == 0:
            pressure = 0.5 * (low + high)
        excess = excess_at(pressure, c, w, takes)
        near = abs(pressure - before) <= PRECISE * c.relief
        if near or abs(excess) <= PRECISE * c.pump_flow:
            break
        if excess > 0.0:
            high = pressure
            over = excess
            under = illinois(under, last > 0)
            last = 1
        else:
            low = pressure
            under = excess
            over = illinois(over, last < 0)
            last = -1
    return pressure


@compilable
def fed_speed(c, w, takes) -> Any:
    """Speed [m/s] of the rod at which forces and the pump's flow balance, and the
    supply [Pa] there."""
    supply = c.supply_pressure
    if c.pump_flow != np.inf:
        supply = min(lone_pressure(c, w, takes), supply)
    return balanced_speed(supply, c, w, takes)[0], supply


@compilable
def areas_on_the_way(c, w, angle: float, load) -> Any:
    """Areas [m²] by which chambers A and B take in oil where their pressures change on
    the way.

    `load` holds the joint [N·m] at the `angle` [rad] and NEAR before and behind it,
    (3,).
    """
    areas = (c.a.area, c.b.area)
    weigh(c, w, angle - NEAR, load[0])
    speed, supply = fed_speed(c, w, areas)
    before_a, before_b, _ = oil_at(speed, supply, c, w, areas)
    weigh(c, w, angle + NEAR, load[2])
    speed, supply = fed_speed(c, w, areas)
    behind_a, behind_b, _ = oil_at(speed, supply, c, w, areas)
    travel, arm = rod_way(c, angle)
    volume_a = c.dead_volume
    volume_b = c.dead_volume
    if c.kind == LINEAR:
        volume_a, volume_b = volumes(travel, c)
    # near a dead centre the rod hardly moves, whatever the joint does
    way = 2.0 * NEAR * (arm if abs(arm) > LEAST_LEVER else LEAST_LEVER)
    a = c.a.area + volume_a / c.bulk_modulus * (behind_a - before_a) / way
    b = c.b.area - volume_b / c.bulk_modulus * (behind_b - before_b) / way
    least_a = LEAST_AREA * c.a.area
    least_b = LEAST_AREA * c.b.area
    return max(a, least_a), max(b, least_b)


@compilable
def dynamic_rod(c, w, supply: float) -> Any:
    """Speed of a rod [m/s] and the flow that it takes from the line [m³/s]."""
    if w.open_area == 0.0 and c.leakage == 0.0:
        return 0.0, 0.0
    return balanced_speed(supply, c, w, (c.a.area, c.b.area))


@compilable
def is_pushed(rod, c, w, wished: float, supply: float) -> bool:
    """Whether the oil still pushes at a wished speed [m/s], so that the rod is at least
    as fast: as `Law.reaches` has it, without the search for the speed."""
    sign = 1.0 if wished > 0.0 else -1.0
    left = surplus(wished, supply, c, w, (c.a.area, c.b.area))[0]
    return sign * left >= joint_friction(c, w.arm)


@compilable
def lone_dynamic(coefficients, pad, angle: float, loads) -> float:
    """Velocity [rad/s] of the only joint on the pump, as `Law.lone` has it."""
    c = coefficients[0]
    w = pad.joints[0]
    shut = w.open_area == 0.0 and c.leakage == 0.0
    takes = (c.a.area, c.b.area)
    if not shut:
        takes = areas_on_the_way(c, w, angle, loads)
    weigh(c, w, angle, loads[1])
    if shut:
        return 0.0 / w.arm
    return fed_speed(c, w, takes)[0] / w.arm
