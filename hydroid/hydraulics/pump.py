"""One pump for all actuators: the pressure of the line between pump and valves.

Without a `pump_flow` every valve has supply pressure at its port, whatever flows. With
one, the line has a pressure P of its own. Its oil is compressible, as in the chambers:

    Ṗ = β/V_line (Q_P(P) − Σ Q_i),   P ≤ supply pressure, where the relief valve opens,

with Q_i the flow that actuator i takes from it: its `draw` times what enters its chamber.
The rest comes from the other chamber, through a regeneration valve, or from the tank.
So P falls until the flows, opening times root of what the load leaves of P, add up to
what the pump gives, and no equation has to be solved for it. The pump gives

    Q_P = φ Q_max min(1, (p_S − P)/droop)^(1/n) − past,

so that the pressure falls with the n-th power of the flow (`pump_exponent`; a large one
holds the pressure up to a flow), by no more than `pump_limit`: there it gives whatever
is taken. Where valves have an open centre, oil runs past them back to the tank,

    past = g Q_max (1 − s) √(P/p_S),

s the largest share that one is open, and g `pump_bypass`. The pump comes up after a
demand: φ is `pump_idle` at rest, and from `pump_delay` after the first command on it
rises to 1 with the time constant `pump_rise`. Every section of the valve has a load
check valve: oil never runs back to the pump. A joint whose own supply pressure is lower
than the line's has a reducing valve. Joints without an actuator take nothing. One that
follows a log takes what its actuator's chamber swallows at the logged speed, however
low P falls; its commands bring the pump up, and its valve shuts the open centre as far
as they say.

A sub-step is implicit in P, as it is in the chamber pressures and velocities. With the
chambers eliminated, P changes by

    δ = (R − Σ g_i v̄_i) / D,   D = V_line/(β h) − dQ_P/dP + Σ draw k (1 − k r) > 0,

v̄ the joints' mean velocities, k = dQ/dP of a metering edge and r a chamber's rise of
pressure per flow. It pushes joint i with the torque f_i δ, and g_i is f_i times the
draw. To the symmetric system of the velocities that adds the matrix √(f g) √(f g)ᵀ h /
D, which is positive: the sub-step stays as stable as it is without a pump. (Between
joints whose draws differ this is not f gᵀ: the predicted velocities err in the second
order of the sub-step, no oil is lost.) Where P would pass the relief pressure, or the
limit of its fall, δ is what is missing to it.

Q_max is stated at a reference of the engine speed. Where the log has the speed n, the
pump turns with the engine, and φ above stands for φ n/n_ref. What runs past the valves
is a matter of the pressure alone.

dynamic         `draw_from_line` to `close_line`: P is integrated, V_line has a volume
quasi-static    `line_pressure`: P satisfies Q_P(P) = Σ Q_i(P) at once, without V_line

In both the pump comes up after a demand as `come_up` says.
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

from typing import Any

import numpy as np

from hydroid.hydraulics.elementwise import compilable
from hydroid.hydraulics.valve import rod_speed

ITERATIONS = 60  # for a quasi-static line's pressure at most; three to five suffice
FEW = 8
"""iterations after which every other one is a halving"""
# part of the pump's flow, or of the way along its curve, that may be left when they end
SETTLED = 1e-9
# part of the droop below which a pump's curve is taken for no steeper
LEAST_FALL = 1e-3


@compilable
def delivery(pressure: float, share: float, c) -> Any:
    """Flow [m³/s] of the pump at a line pressure [Pa], and how it falls with the
    pressure; `share` is φ."""
    full = share * c.pump_flow
    below_relief = c.relief - pressure
    if below_relief >= c.pump_droop:
        return full, 0.0
    if c.pump_exponent == 1.0:
        return full * max(below_relief, 0.0) / c.pump_droop, full / c.pump_droop
    part = max(below_relief, 0.0) / c.pump_droop
    flow = full * part ** (1.0 / c.pump_exponent)
    # at no flow the curve has an infinite slope
    part = max(part, LEAST_FALL)
    slope = full * part ** (1.0 / c.pump_exponent - 1.0)
    return flow, slope / (c.pump_exponent * c.pump_droop)


@compilable
def left_open(centre: float, c, opening: float) -> float:
    """Part of the open centre of all valves that is left of a part when a valve's
    opening is as it is [m²], below 0 towards B."""
    side = c.a if opening > 0.0 else c.b
    if opening == 0.0 or side.opening <= 0.0:
        return centre
    return min(centre, max(1.0 - abs(opening) / side.opening, 0.0))


@compilable
def centre_left(coefficients, driven, work, shut: float) -> float:
    """Part of the open centre of all valves that the openings `open_area` of the driven
    joints leave of what others have not shut."""
    centre = 1.0 - shut
    for a in range(driven.size):
        j = driven[a]
        centre = left_open(centre, coefficients[j], work[j].open_area)
    return centre


@compilable
def past_valves(pressure: float, centre: float, c) -> Any:
    """Flow [m³/s] through a part of the open centre at a line pressure [Pa], and how it
    rises with the pressure."""
    if c.pump_bypass == 0.0 or pressure <= 0.0:
        return 0.0, 0.0
    flow = c.pump_bypass * c.pump_flow * centre * np.sqrt(pressure / c.relief)
    return flow, 0.5 * flow / pressure


@compilable
def lowest(c) -> float:
    """Pressure of the line [Pa] below which nothing that joints take brings it."""
    return max(c.relief - c.pump_limit, 0.0)


@compilable
def come_up(line, c, step: float) -> float:
    """Advance φ and the time of the demand by a sub-step [s]; the mean of φ, times the
    engine speed over its reference."""
    before = line.share
    target = c.pump_idle
    if line.demanded > 0.0:
        line.demand += step
        # part of this sub-step that lies after the delay
        late = (line.demand - c.pump_delay) / step
        target += (1.0 - c.pump_idle) * min(max(late, 0.0), 1.0)
    else:
        line.demand = 0.0
    line.share = target + (before - target) * line.decay
    return (1.0 + line.faster) * (0.5 * (before + line.share))


@compilable
def take_others(line, others) -> None:
    """Take what joints that follow a log do in a step, a row of `Course.others`."""
    line.taken = others[0]
    line.shut = others[1]
    line.asked = others[2]


@compilable
def begin_line(line, c, z, demanded: bool, step: float) -> None:
    """Begin a step with the line as the state of a joint has it; `demanded`: whether a
    command is not 0, besides those of joints that follow a log."""
    line.pressure = z.line
    line.share = z.share
    line.demand = z.demand
    line.demanded = 1.0 if demanded else line.asked
    line.decay = 0.0
    if c.pump_rise > 0.0:
        line.decay = np.exp(-step / c.pump_rise)
    line.drawn = line.taken
    line.centre = 1.0 - line.shut


@compilable
def draw_from_line(line, c, w) -> None:
    """Add what one actuator takes from the line in a sub-step, and how that answers to
    pressure and speed."""
    if line.pressure > c.supply_pressure:
        # behind a reducing valve that works, the line's pressure is not felt
        w.a.give = 0.0
        w.b.give = 0.0
    # k r of either chamber: it fills, so its pressure rises and slows the flow
    back_a = w.a.filled * w.a.give * w.a.rise
    back_b = w.b.filled * w.b.give * w.b.rise
    a = c.a.draw
    b = c.b.draw
    # at the pressure and the speed at which the sub-step begins
    line.drawn += (
        a * w.a.pumped
        - a * back_a * w.a.inflow
        + b * w.b.pumped
        - b * back_b * w.b.inflow
    )
    line.softness += a * w.a.give * (1.0 - back_a) + b * w.b.give * (1.0 - back_b)
    w.thrust = back_a * w.a.lever + back_b * w.b.lever
    w.sweep = a * back_a * w.a.lever + b * back_b * w.b.lever
    # f and g enter one symmetric system: their geometric mean keeps it symmetric
    w.pull = np.copysign(np.sqrt(max(w.thrust * w.sweep, 0.0)), w.thrust)
    line.swept += w.sweep * w.speed


@compilable
def open_line(line, c, step: float) -> None:
    """Turn the sums of `draw_from_line` into δ at the present speeds, and 1/D."""
    flow, fall = delivery(line.pressure, come_up(line, c, step), c)
    past, rise = past_valves(line.pressure, line.centre, c)
    stored = c.line_volume / (c.bulk_modulus * step)
    line.softness = 1.0 / (stored + fall + rise + line.softness)
    line.change = line.softness * (flow - past - line.drawn - line.swept)
    most = c.relief - line.pressure
    least = lowest(c) - line.pressure
    # at a limit the pressure is given: the speeds no longer change it
    if line.change >= most:
        line.change = most
        line.softness = 0.0
    elif line.change <= least and c.pump_limit < np.inf:
        line.change = least
        line.softness = 0.0


@compilable
def fill(line, w, step: float) -> None:
    """Give one actuator the flow and the torque of the line's change."""
    w.a.inflow += w.a.give * line.change
    w.b.inflow += w.b.give * line.change
    w.push += w.weight * w.thrust * line.change
    w.oil_stiffness += line.softness * w.thrust * w.sweep / step


@compilable
def close_line(line, c) -> None:
    """Take over the line's change, and reset its sums for the next sub-step."""
    line.pressure = min(max(line.pressure + line.change, lowest(c)), c.relief)
    line.drawn = line.taken
    line.softness = 0.0
    line.swept = 0.0
    line.centre = 1.0 - line.shut


@compilable
def on_curve(way: float, c) -> Any:
    """Pressure of the line [Pa], and its slope, on a way along the pump's curve.

    Up to a way of 1 that is the part of its flow which the pump gives; from there to 2
    the pump gives all, and the pressure falls to 0.
    """
    knee = c.relief - c.pump_droop
    if way > 1.0:
        return knee * (2.0 - way), -knee
    if c.pump_exponent == 1.0:
        return c.relief - c.pump_droop * way, -c.pump_droop
    part = way**c.pump_exponent
    slope = c.pump_exponent * part / way if way > 0.0 else 0.0
    return c.relief - c.pump_droop * part, -c.pump_droop * slope


@compilable
def way_to(pressure: float, c) -> float:
    """The way along the pump's curve at which the line has a pressure [Pa]."""
    below_relief = c.relief - pressure
    if below_relief <= 0.0:
        return 0.0
    if below_relief > c.pump_droop:
        return 2.0 - pressure / (c.relief - c.pump_droop)
    return (below_relief / c.pump_droop) ** (1.0 / c.pump_exponent)


@compilable
def line_pressure(coefficients, driven, work, line, share: float) -> float:
    """Pressure of the line [Pa] at which quasi-static actuators take what the pump
    gives with its φ at `share`.

    The actuators are those of the `driven` joints, with (J,) of COEFFICIENTS and of
    SCRATCH. Newton's method from the last step's, within a bracket: what is taken falls
    on the way along the pump's curve, and what is given does not. Over the pressure the
    curve of a pump that holds it up to a flow would be steep.
    """
    pump = coefficients[driven[driven.size - 1]]
    least = lowest(pump)
    # without pressure actuators take nothing, but those by command: where these take
    # more than the pump gives, the search ends there, too
    most = line.taken
    if least > 0.0:
        most, _ = taken_from_line(coefficients, driven, work, line, least)
    if most >= delivery(least, share, pump)[0]:
        return least
    full = share * pump.pump_flow
    low = 0.0
    high = way_to(least, pump)
    way = min(way_to(line.pressure, pump), high)
    pressure = pump.relief
    for count in range(ITERATIONS):
        pressure, change = on_curve(way, pump)
        taken, rise = taken_from_line(coefficients, driven, work, line, pressure)
        excess = taken - full * min(way, 1.0)
        if excess > 0.0:
            low = way
        else:
            high = way
        if abs(excess) <= SETTLED * full or high - low <= SETTLED:
            break
        slope = rise * change
        if way < 1.0:
            slope -= full
        # infinite where nothing flows
        after = way - excess / slope
        creeps = count >= FEW and count % 2 == 0
        way = within(after, low, high, creeps)
    return pressure


@compilable
def within(after: float, low: float, high: float, creeps: bool) -> float:
    """The way to try next: Newton's, where it lies in the bracket and does not creep;
    else a halving, or the relief pressure."""
    if after < low == 0.0:
        return 0.0
    if creeps or not low < after < high:
        return 0.5 * (low + high)
    return after


@compilable
def taken_from_line(coefficients, driven, work, line, pressure: float) -> Any:
    """Flow that quasi-static actuators and the open centre take at a line pressure
    [Pa], and its slope."""
    pump = coefficients[driven[driven.size - 1]]
    past, slope = past_valves(pressure, line.centre, pump)
    taken = line.taken + past
    for a in range(driven.size):
        j = driven[a]
        c = coefficients[j]
        _, flow, rise = rod_speed(c, work[j], min(pressure, c.supply_pressure))
        taken += flow
        # behind a reducing valve that works, the line's pressure is not felt
        if pressure <= c.supply_pressure:
            slope += rise
    return taken, slope
