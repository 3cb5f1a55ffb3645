"""The quasi-static rollout: speed follows valve and load at once, without oil stiffness
and inertia.

For a cylinder that moves at speed v towards the chamber it fills, with openings a_in
and a_out, areas A_in and A_out, k = C_q √(2/ρ), the load F (gravity, springs, dry
friction against the motion) and damping d:

    p_in = P − (v A_in/(k a_in))²,   p_out = p_T + (v A_out/(k a_out))²,
    p_in A_in − p_out A_out = F + d v,

which is a quadratic equation in v. A compensator (`hydroid.hydraulics.valve`) makes it
another one; the slower of both speeds holds, or that of the flow limit, v = Q_max/A_in,
where it is slower still. Where the load overruns this speed, p_in would fall below 0:
the chamber then cavitates, and what leaves the other one governs. So speed and
pressures are continuous in the load. A load that the supply cannot lift is held. All
actuators share the pump's line, whose pressure P satisfies one equation, Σ Q_i(P) =
Q_P(P) of `hydroid.hydraulics.pump`, with Q_i the flow into the chamber times its
`draw`.

A joint whose speed follows its command alone (`by_command`) feels none of that, but
takes its flow from the line: a pump that gives less is empty for the others. Its
pressures are those that its load asks for.

Commands, delays, coils and plungers are those of the dynamic rollout, law by law. Steps
are long: what is integrated is the angle alone, with load and lever arm taken at the
middle of the step. Joints without an actuator stand still. Leakage is left out, so
nothing sags, and so is the anti-cavitation valve. Of oil and inertia a joint may have
what a log shows of both, a natural frequency and a damping ratio (`overshoot`).
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

from typing import Any

import numpy as np

from hydroid.hydraulics.cylinder import weigh
from hydroid.hydraulics.elementwise import compilable
from hydroid.hydraulics.joint import mean_opening
from hydroid.hydraulics.kernel import make_pad, take_conditions
from hydroid.hydraulics.oil import overshoot, store_oil
from hydroid.hydraulics.pump import (
    begin_line,
    centre_left,
    come_up,
    line_pressure,
    take_others,
)
from hydroid.hydraulics.valve import rod_speed
from hydroid.simulation.gravity import hold, load_links
from hydroid.simulation.rollout import write_sample


@compilable
def share_pump(
    coefficients, driven, state, pad, demanded: bool, period: float
) -> float:
    """Advance the pump over a step; the pressure of its line [Pa], inf where its flow
    has no limit."""
    last = driven[driven.size - 1]
    pump = coefficients[last]
    line = pad.line[0]
    if pump.pump_flow == np.inf:
        return np.inf
    begin_line(line, pump, state[last], demanded, period)
    share = come_up(line, pump, period)
    line.centre = centre_left(coefficients, driven, pad.joints, line.shut)
    pressure = line_pressure(coefficients, driven, pad.joints, line, share)
    for j in range(state.size):
        z = state[j]
        z.line = pressure
        z.share = line.share
        z.demand = line.demand
    return pressure


@compilable
def turn(c, z, w, supply: float, limits, period: float) -> Any:
    """Turn a joint over a step of the period [s], within its `limits` [rad], (2,); the
    speed of its rod [m/s] and the angle after it [rad]."""
    speed = rod_speed(c, w, supply)[0]
    velocity = (speed if w.open_area > 0.0 else -speed) / w.arm
    way = period * velocity
    if c.oil_frequency != np.inf:
        way += overshoot(c, z, velocity)
    free = z.angle + way
    # a joint that starts beyond a limit may stay there, or come back
    lower = min(limits[0], z.angle)
    upper = max(limits[1], z.angle)
    after = min(max(free, lower), upper)
    # a stop ends what rings towards it; what leads away from it goes on
    if after < free:
        z.turning = min(z.turning, 0.0)
        z.surge = min(z.surge, 0.0)
    elif after > free:
        z.turning = max(z.turning, 0.0)
        z.surge = max(z.surge, 0.0)
    z.velocity = (after - z.angle) / period
    return speed, after


@compilable
def quasi_static_rod(c, w, supply: float) -> Any:
    """Speed of a rod [m/s] and the flow that it takes from the line [m³/s]."""
    speed, drawn, _ = rod_speed(c, w, supply)
    return speed if w.open_area > 0.0 else -speed, drawn


@compilable
def lone_quasi_static(coefficients, pad, angle: float, loads) -> float:
    """Velocity [rad/s] of the only joint on the pump, as `Law.lone` has it."""
    c = coefficients[0]
    w = pad.joints[0]
    line = pad.line[0]
    weigh(c, w, angle, loads[1])
    supply = c.supply_pressure
    if c.pump_flow < np.inf:
        driven = np.zeros(1, np.intp)
        # where the search for the line's pressure begins
        line.pressure = c.relief
        line.centre = centre_left(coefficients, driven, pad.joints, 0.0)
        shared = line_pressure(coefficients, driven, pad.joints, line, 1.0)
        supply = min(supply, shared)
    return quasi_static_rod(c, w, supply)[0] / w.arm


@compilable
def roll_quasi_static(arm, plugin, state, course, trace) -> None:
    """Roll one candidate out, as `rollout.roll` does; joints that follow a log take its
    angle.

    Valves open as the course says, or, where it does not, as their state follows from
    the commands.
    """
    coefficients = plugin.coefficients
    driven = plugin.order[plugin.idle :]
    period = plugin.period
    commands, followed, others, opening, conditions = course
    steps = followed.shape[0]
    past = commands.shape[0] - steps
    pad = make_pad(plugin.order.size)
    work = pad.joints
    line = pad.line[0]
    links = arm.links.copy()
    load_links(links, arm.body_mass, arm.body_centre)
    held = np.empty(arm.angle.size)
    for k in range(steps):
        now = past + k
        # of states that nobody reads, only the last is stored
        observed = trace.states.size > 0 or k + 1 == steps
        demanded = False
        for i in range(arm.pushed.size):
            arm.angle[arm.pushed[i]] = followed[k, i]
        for a in range(driven.size):
            j = driven[a]
            c = coefficients[j]
            z = state[j]
            w = work[j]
            column = arm.columns[j]
            z.angle = arm.angle[column]
            # load and lever are those of the middle of the step, as far as the last
            # velocity tells
            arm.angle[column] = z.angle + 0.5 * period * z.velocity
            if opening.size:
                w.open_area = opening[k, j]
            else:
                w.open_area = mean_opening(c, z, w, commands[:, j], now, plugin)
            demanded |= commands[now, j] != 0.0
        if conditions.size:
            take_conditions(plugin, pad, conditions[k])
        hold(links, arm.angle, held)
        for a in range(driven.size):
            j = driven[a]
            c = coefficients[j]
            column = arm.columns[j]
            angle = arm.angle[column]
            spring = c.stiffness * (angle - arm.slack[column])
            weigh(c, work[j], angle, held[column] + spring)
        if others.size:
            take_others(line, others[k])
        pressure = np.inf
        if driven.size:
            pressure = share_pump(coefficients, driven, state, pad, demanded, period)
        for a in range(driven.size):
            j = driven[a]
            c = coefficients[j]
            z = state[j]
            w = work[j]
            column = arm.columns[j]
            supply = min(pressure, c.supply_pressure)
            speed, after = turn(c, z, w, supply, arm.limits[column], period)
            arm.angle[column] = after
            if observed:
                store_oil(c, z, w, speed, after, supply)
        write_sample(arm, trace, state, k)
