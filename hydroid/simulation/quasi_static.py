"""The quasi-static rollout: speed follows valve and load at once, without oil stiffness
and inertia.

For a cylinder that moves at speed v towards the chamber it fills, with openings a_in
and a_out, areas A_in and A_out, k = C_q √(2/ρ), the load F (gravity, springs, dry
friction against the motion) and damping d:

    p_in = P − (v A_in/(k a_in))²,   p_out = p_T + (v A_out/(k a_out))²,   p_in A_in − p_out A_out = F + d v,

which is a quadratic equation in v. A compensator (`hydroid.hydraulics.valve`) makes it
another one; the slower of both speeds holds, or that of the flow limit, v = Q_max/A_in,
where it is slower still. Where the load overruns this speed, p_in would fall below 0:
the chamber then cavitates, and what leaves the other one governs. So speed and
pressures are continuous in the load. A load that the supply cannot lift is held. All
actuators share the pump's line, whose pressure P satisfies one equation, Σ Q_i(P) =
Q_P(P) of `hydroid.hydraulics.pump`, with Q_i the flow into the chamber times its
`draw`.

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
from numba import njit, types

from hydroid.hydraulics.cylinder import bent, filling, rod
from hydroid.hydraulics.elementwise import compilable
from hydroid.hydraulics.joint import mean_opening
from hydroid.hydraulics.kernel import Plugin, make_pad, source_key
from hydroid.hydraulics.pump import begin_line, come_up, delivery, lowest
from hydroid.hydraulics.records import LINEAR
from hydroid.hydraulics.valve import MARGIN
from hydroid.simulation import rollout
from hydroid.simulation.rollout import mujoco_function, write_sample

_kinematics = mujoco_function("mj_kinematics", types.intp, types.intp)
_com_pos = mujoco_function("mj_comPos", types.intp, types.intp)
_rne = mujoco_function("mj_rne", types.intp, types.intp, types.int32, types.intp)

SOURCE = source_key(rollout.__file__)
ITERATIONS = 30  # for the line's pressure at most; three to five suffice
LEAST_LEVER = 1e-6  # moment arm below which a cylinder stands at its dead centre [m]
# part of the pump's flow, or of its pressure, that may be left when they end
SETTLED = 1e-9


@compilable
def rod_speed(c, w, supply: float) -> Any:
    """Speed at which a chamber fills [m/s], its flow from the pump [m³/s], and how that
    rises with P [Pa].

    The scratch space w has the net opening `travel` [m²], above 0 towards A, the load
    `push` of gravity and springs, dry friction `thrust` [N], damping `drag` [N·s/m]; of
    a rotary actuator torques. P is `supply`.
    """
    if w.travel == 0.0:
        return 0.0, 0.0, 0.0
    side, other, sign = (c.a, c.b, 1.0) if w.travel > 0.0 else (c.b, c.a, -1.0)
    area, load, drag = abs(w.travel), sign * w.push + w.thrust, w.drag
    pump_edge, tank_edge = c.conductance * area, c.conductance * area * other.return_
    back, into = (
        (other.area / tank_edge) ** 2 * other.area,
        (side.area / pump_edge) ** 2 * side.area,
    )
    free = supply * side.area - c.tank_pressure * other.area - load
    if free <= 0.0:
        return 0.0, 0.0, 0.0
    root = np.sqrt(drag * drag + 4.0 * free * (into + back))
    speed, rise = 2.0 * free / (drag + root), side.area * side.area / root
    drop = supply  # over the pump edge of an empty chamber
    if c.compensation > 0.0:
        left, fed = 1.0 - c.compensation, 1.0 - c.compensation * (1.0 - MARGIN)
        drop = fed * supply
        push = left * free + c.compensation * MARGIN * supply * side.area
        root = np.sqrt(left * left * drag * drag + 4.0 * push * (into + left * back))
        slower = 2.0 * push / (left * drag + root)
        if slower < speed:
            speed, rise = slower, fed * side.area * side.area / root
    flow = side.area * speed
    if flow > c.flow_limit:
        speed, flow, rise = c.flow_limit / side.area, c.flow_limit, 0.0
    # cavitates
    if (drag + back * speed) * speed + c.tank_pressure * other.area + load < 0.0:
        falling = -c.tank_pressure * other.area - load
        speed = 2.0 * falling / (drag + np.sqrt(drag * drag + 4.0 * falling * back))
        flow = pump_edge * np.sqrt(drop)
        rise = 0.5 * flow / supply
        if flow > c.flow_limit:
            flow, rise = c.flow_limit, 0.0
    return speed, side.draw * flow, side.draw * rise


@compilable
def line_pressure(plugin: Plugin, work, line, share: float, some) -> float:
    """Pressure of the line [Pa] at which the actuators take what the pump gives with
    its φ at `share`.

    Newton's method from the last step's, within a bracket: what is taken rises with the
    pressure, and what is given falls.
    """
    low, high = lowest(some), some.relief
    if (
        some.pump_limit < np.inf
        and _taken_beyond(plugin, work, line, share, some, low)[0] >= 0.0
    ):
        return low  # where the pump gives whatever is taken
    pressure = min(max(line.pressure, low, 1e-3 * high), high)
    for _ in range(ITERATIONS):
        excess, slope = _taken_beyond(plugin, work, line, share, some, pressure)
        if excess > 0.0:
            high = pressure
        else:
            low = pressure
        if (
            abs(excess) <= SETTLED * share * some.pump_flow
            or high - low <= SETTLED * some.relief
        ):
            break
        after = pressure - excess / slope  # infinite where nothing flows
        if not low < after < high:
            after = high if after > high == some.relief else 0.5 * (low + high)
        pressure = after
    return pressure


@compilable
def _taken_beyond(
    plugin: Plugin, work, line, share: float, some, pressure: float
) -> Any:
    """Flow that the actuators take beyond what the pump gives at a line pressure [Pa],
    and its slope."""
    given, slope = delivery(pressure, share, some)
    excess = line.taken - given
    for a in range(plugin.idle, plugin.order.size):
        j = plugin.order[a]
        c = plugin.coefficients[j]
        _, flow, rise = rod_speed(c, work[j], min(pressure, c.supply_pressure))
        excess += flow
        if pressure <= c.supply_pressure:
            slope += rise
    return excess, slope


@compilable
def linkage(c, angle: float) -> Any:
    """Travel of a joint's rod [m] and its moment arm [m/rad] at an angle; of a rotary
    actuator as `bent`."""
    way, arm, _ = rod(angle, c) if c.kind == LINEAR else bent(angle, c)
    return way, arm


@compilable
def store_oil(c, z, w, speed: float, angle: float, supply: float) -> None:
    """Store the oil and flows of a joint's chambers as `actuator.pressures` reads them.

    A joint that stands has tank pressure in one chamber, and in the other what holds
    the load w.push [N]; or, if its valve is open to a `supply` [Pa] that cannot lift
    the load, at least that pressure.
    """
    a, b, tank, edge = (
        c.a.area,
        c.b.area,
        c.tank_pressure,
        c.conductance * abs(w.travel),
    )
    sign = 1.0 if w.travel > 0.0 else -1.0
    pressure_a, pressure_b = (
        max(tank, (tank * b + w.push) / a),
        max(tank, (tank * a - w.push) / b),
    )
    if speed != 0.0:
        against = w.thrust + w.drag * speed
        if w.travel > 0.0:
            pressure_b = tank + (speed * b / (edge * c.b.return_)) ** 2
            pressure_a = (pressure_b * b + against + w.push) / a
        else:
            pressure_a = tank + (speed * a / (edge * c.a.return_)) ** 2
            pressure_b = (pressure_a * a + against - w.push) / b
    elif w.travel > 0.0:
        pressure_a = max(supply, (tank * b + w.push - w.thrust) / a)
    elif w.travel < 0.0:
        pressure_b = max(supply, (tank * a - w.push - w.thrust) / b)
    out = linkage(c, angle)[0]
    fill_a, fill_b = out * a / c.dead_volume, -out * b / c.dead_volume
    if c.kind == LINEAR:
        fill_a, fill_b = (
            filling(out, a, c.dead_volume),
            filling(c.stroke - out, b, c.dead_volume),
        )
    z.a.oil = max(pressure_a, 0.0) + c.bulk_modulus * fill_a
    z.b.oil = max(pressure_b, 0.0) + c.bulk_modulus * fill_b
    z.a.flow, z.b.flow = sign * a * speed, -sign * b * speed


@compilable
def weigh(c, w, angle: float, torque: float) -> None:
    """Lever and load of a joint that a torque [N·m] must hold at an angle [rad]."""
    w.arm = linkage(c, angle)[1]
    lever = max(abs(w.arm), LEAST_LEVER)
    w.push = torque / w.arm
    w.thrust = c.dry_friction + c.friction / lever
    w.drag = c.damping / (lever * lever)


@compilable
def overshoot(c, z, wanted: float) -> float:
    """Advance a joint on its oil over a step; how much further than at `wanted` [rad/s]
    it turns [rad].

    Its velocity v follows that of the rod without oil, u, as v̈ + 2ζω (v̇ − σu̇) +
    ω²(v − u) = 0 with ω, ζ and the share σ of the damping that acts between valve and
    joint constant. σ = 0 is a joint with leakage or friction (H. E. Merritt, "Hydraulic
    Control Systems", 1967), σ = 1 one on hoses that damp. Exact where u is constant;
    the state is v̇ − 2ζωσu, which does not jump where u does.
    """
    pace = 2.0 * np.pi * c.oil_frequency
    drag = 2.0 * c.oil_damping * pace
    passed = c.oil_damping_share * drag * wanted
    lack = z.turning - wanted
    surge = z.surge + passed
    left = (c.ring_cosine + drag * c.ring_sine) * lack + c.ring_sine * surge
    after = c.ring_cosine * surge - pace * pace * c.ring_sine * lack
    z.turning = wanted + left
    z.surge = after - passed
    return (surge - after + drag * (lack - left)) / (pace * pace)


@compilable
def share_pump(plugin: Plugin, state, pad, demanded: bool) -> float:
    """Advance the pump over a step; the pressure of its line [Pa], inf where its flow
    has no limit."""
    last = plugin.order[plugin.order.size - 1]
    c, line = plugin.coefficients[last], pad.line[0]
    if c.pump_flow == np.inf:
        return np.inf
    begin_line(line, c, state[last], demanded, plugin.period)
    pressure = line_pressure(
        plugin, pad.joints, line, come_up(line, c, plugin.period), c
    )
    for j in range(state.size):
        state[j].line, state[j].share, state[j].demand = (
            pressure,
            line.share,
            line.demand,
        )
    return pressure


@njit(cache=True, nogil=True, error_model="numpy")
def roll_quasi_static(
    arm, plugin: Plugin, state, course, record, source: int = SOURCE
) -> None:
    """Roll one candidate out, as `rollout.roll` does; joints that follow a log take its
    angle.

    Valves open as the course says, or, where it does not, as their state follows from
    the commands.
    """
    order, idle, period = plugin.order, plugin.idle, plugin.period
    commands, followed, taken, opening = course
    pad, past = make_pad(order.size), commands.shape[0] - followed.shape[0]
    for k in range(followed.shape[0]):
        now, observed, demanded = (
            past + k,
            record.states.size > 0 or k + 1 == followed.shape[0],
            False,
        )
        for i in range(arm.pushed.size):
            arm.angle[arm.pushed[i]] = followed[k, i]
        for a in range(idle, order.size):
            j = order[a]
            c, z, place = plugin.coefficients[j], state[j], arm.columns[j]
            z.angle = arm.angle[place]
            arm.angle[place] = z.angle + 0.5 * period * z.velocity
            if opening.size:
                pad.joints[j].travel = opening[k, j]
            else:
                pad.joints[j].travel = mean_opening(
                    c, z, pad.joints[j], commands[:, j], now, plugin
                )
            demanded |= commands[now, j] != 0.0
        _kinematics(arm.model, arm.data)
        _com_pos(arm.model, arm.data)
        _rne(arm.model, arm.data, 0, arm.gravity.ctypes.data)
        for a in range(idle, order.size):
            j, place = order[a], arm.columns[order[a]]
            spring = plugin.coefficients[j].stiffness * (
                arm.angle[place] - arm.slack[place]
            )
            weigh(
                plugin.coefficients[j],
                pad.joints[j],
                arm.angle[place],
                arm.gravity[place] + spring,
            )
        pad.line[0].taken = taken[k] if taken.size else 0.0
        pressure = (
            share_pump(plugin, state, pad, demanded) if idle < order.size else np.inf
        )
        for a in range(idle, order.size):
            j, place = order[a], arm.columns[order[a]]
            c, z, w = plugin.coefficients[j], state[j], pad.joints[j]
            supply = min(pressure, c.supply_pressure)
            speed = rod_speed(c, w, supply)[0]
            velocity = (speed if w.travel > 0.0 else -speed) / w.arm
            way = period * velocity
            if c.oil_frequency != np.inf:
                way += overshoot(c, z, velocity)
            free = z.angle + way
            after = min(
                max(free, min(arm.limits[place, 0], z.angle)),
                max(arm.limits[place, 1], z.angle),
            )
            if after != free:  # a stop ends what rings
                z.turning, z.surge = 0.0, 0.0
            arm.angle[place], z.velocity = after, (after - z.angle) / period
            if observed:
                store_oil(c, z, w, speed, after, supply)
        write_sample(arm, record, state, k)
