"""Four-way spool valve (article 2.2, equations (6) to (8)).

For x > 0 oil runs from the pump to chamber A and from B to the tank, for x < 0 from the
pump to B and from A to the tank; the article prints x > 0 only. Its law
Q = C_q A sgn(Δp) √(2|Δp|/ρ) has an infinite slope at Δp = 0, so below the transition
pressure p_cr it becomes a straight line:

    Q = C_q A √(2/ρ) Δp / (Δp² + p_cr²)^(1/4).

The article leaves A(x) open. Ours: A_max min((|x| − overlap)/w, 1)^n, each direction
with its own A_max, overlap, w and n, plus a leakage area on all four edges. With a flow
limit, the pump gives no more than that to this actuator; with a check valve
(`hydroid.hydraulics.pump`) no oil runs back to it.

A spool is cut with notches, and a servo may drive it through a small part of its
travel, so its opening is no one power of the travel. Four factors, `curve_1` to
`curve_4`, multiply the increments of the power law over the first 4, to 15, to 40 and
to 70 % of the travel (`KNOTS`). That of the last part is 1. So the curve is monotone,
and it still ends at A_max: what counts is how steep a part is beside the last one. The
first part is so short that it stands for a jump.

The article's edges open alike. A real spool's do not: `return_a` and `return_b` are the
openings of A→T and B→T as multiples of those of P→B and P→A. So a load that is lowered
can be held by the oil that leaves, while the other chamber fills from the tank through
an anti-cavitation check valve.

A pressure compensator before the pump edge leaves the edge a drop of MARGIN p_S, so
that a load does not slow the motion while the supply can lift it. The drop is

    Δp = p_S - p - κ max(p_S - p - MARGIN p_S, 0),

with `compensation` κ: 0 without a compensator, as in the article, 1 with an ideal one.

Where a model of load and pump predicts a joint no better than its command alone,
`by_command` 1 leaves both out. The edge then always has its margin, whatever load,
friction or supply: what an ideal compensator on an endless supply gives,

    v = C_q a √(2/ρ) √(MARGIN p_S) / A_in.

Its oil still comes from the shared pump.

Oil that is warmer flows more easily, and where a pump has no limit in the model, an
engine that turns faster moves the joints faster. So all openings are multiplied by

    (n/n_ref)^e exp(k (T - T_ref)),

with the engine speed n and the oil temperature T of the log, e `engine_exponent` and k
`temperature_effect`. At the references, and with e and k at 0, that is 1. A speed is in
proportion to it but for what damping takes. Flow limit, leakage and anti-cavitation
valve stay as they are.

dynamic         `port_flow` and `meter`: flows that follow from the pressures of the
                chambers, with leakage, an anti-cavitation valve and p_cr
quasi-static    `rod_speed`: the same edges solved for the speed at which forces
                balance, without these three. A flow never runs back to the pump. It
                alone has joints by command.
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

from typing import Any

import numpy as np

from hydroid.hydraulics.elementwise import compilable

DENSITY = 860.0  # ρ of the oil [kg/m³]; ours

# part of the supply pressure that a compensator leaves the pump edge; ours
MARGIN = 0.25
# parts of the spool's travel where the parts of a valve's curve end; ours
KNOTS = (0.04, 0.15, 0.4, 0.7)
# part of the travel over which a power law is a line: no edge is sharper; ours
EDGE = 1e-3


@compilable
def slot_share(travel, side) -> Any:
    """Part of a side's slot that spool travel towards it [m] has passed, 0 to 1."""
    return np.minimum(np.maximum(travel - side.overlap, 0.0) / side.slot_width, 1.0)


@compilable
def power_law(share: float, exponent: float) -> float:
    """Part of the full opening at a part of the travel; a line over the first EDGE of
    it.

    An exponent below 1 alone would open a spool that rests at its neutral but for
    rounding: 1e-15 of the travel to the power of 0.2 is 0.1 %.
    """
    if share < EDGE:
        return share * EDGE ** (exponent - 1.0)
    return share**exponent


@compilable
def bent_opening(share, factors, ends) -> Any:
    """Part of the full opening, from the part that the power law gives: 0 to 1, as the
    result.

    Its slope has a factor of each part, up to each of `ends`, and 1 beyond the last
    one. Where all factors are 1, the result is the power law's, to the bit.
    """
    # what factors other than 1 add up to the share, and up to the full opening
    more = 0.0
    whole = 0.0
    low = 0.0
    for factor, high in zip(factors, ends):  # noqa: B905  # compiled code knows no strict=
        passed = np.minimum(np.maximum(share - low, 0.0), high - low)
        more = more + (factor - 1.0) * passed
        whole = whole + (factor - 1.0) * (high - low)
        low = high
    return (share + more) / (1.0 + whole)


@compilable
def curved(share, side) -> Any:
    """Part of the full opening on the side's curve, from the part that the power law
    gives."""
    factors = (side.curve_1, side.curve_2, side.curve_3, side.curve_4)
    ends = (side.knot_1, side.knot_2, side.knot_3, side.knot_4)
    return bent_opening(share, factors, ends)


def conductance(flow_coefficient) -> Any:
    """C_q √(2/ρ) [m/(s √Pa)]: flow per opening and root of the pressure drop."""
    return flow_coefficient * np.sqrt(2.0 / DENSITY)


@compilable
def faster(c, engine: float, warmer: float) -> float:
    """Part by which oil is faster through a valve than at the references, with the
    engine speed over its own, and the oil `warmer` than its own [K]."""
    return engine**c.engine_exponent * np.exp(c.temperature_effect * warmer) - 1.0


@compilable
def root(drop, transition) -> Any:
    """Regularised sgn(Δp) √|Δp| [√Pa] and its derivative [1/√Pa] at a pressure drop [Pa]."""
    square = drop * drop
    scale = square + transition * transition
    inverse = 1.0 / np.sqrt(np.sqrt(scale))
    slope = (1.0 - 0.5 * square * (inverse * inverse) ** 2) * inverse
    return drop * inverse, slope


@compilable
def port_flow(pressure, supply, pump_area, tank_area, c) -> Any:
    """Flow Q [m³/s] into a chamber at a pressure [Pa] through its two edges, openings
    [m²], (7) and (8).

    Also returns -dQ/dp [m³/(s Pa)], which is never negative, the part of Q that comes
    from the pump, at `supply` pressure [Pa], and its rise with that pressure.
    """
    drop = supply - pressure
    # how the drop over the edge answers to the pressures of chamber and supply
    kept = 1.0
    fed = 1.0
    if c.compensation > 0.0 and drop > MARGIN * supply:
        drop = drop - c.compensation * (drop - MARGIN * supply)
        kept = 1.0 - c.compensation
        fed = 1.0 - c.compensation * (1.0 - MARGIN)
    into, into_slope = root(drop, c.transition_pressure)
    out, out_slope = root(pressure - c.tank_pressure, c.transition_pressure)
    pumped = c.conductance * pump_area * into
    pumped_slope = c.conductance * pump_area * into_slope
    if pumped >= c.flow_limit or pumped < c.backflow:
        pumped = np.maximum(np.minimum(pumped, c.flow_limit), c.backflow)
        pumped_slope = 0.0
    filling = c.anticavitation if pressure < c.tank_pressure else 0.0
    drained = c.conductance * (tank_area + filling)
    return (
        pumped - drained * out,
        kept * pumped_slope + drained * out_slope,
        pumped,
        fed * pumped_slope,
    )


@compilable
def _fill(c, w, supply: float, pump_area: float, tank_area: float) -> None:
    # oil that cavitates pushes with vapour pressure, whatever volume is missing, and
    # does not resist
    w.filled = 1.0 if w.pressure > 0.0 else 0.0
    w.pushing = max(w.pressure, 0.0)
    w.inflow, w.relief, w.pumped, w.give = port_flow(
        w.pushing, supply, pump_area, tank_area, c
    )


@compilable
def meter(c, w, area: float, supply: float) -> None:
    """Flows into both chambers from `supply` pressure [Pa], and how they fall with the
    chambers' own.

    `area` is the net opening [m²]; w is the joint's scratch space of a look-ahead.
    """
    eased = (1.0 + w.faster) * area
    a = np.maximum(eased, 0.0)
    b = np.maximum(-eased, 0.0)
    _fill(c, w.a, supply, c.leakage + a, c.leakage + b * c.a.return_)
    _fill(c, w.b, supply, c.leakage + b, c.leakage + a * c.b.return_)


@compilable
def speed_against(force: float, drag: float, edges: float) -> Any:
    """Speed v > 0 at which `edges` v² + `drag` v = `force`, and the root of the
    equation's discriminant."""
    root = np.sqrt(drag * drag + 4.0 * force * edges)
    return 2.0 * force / (drag + root), root


@compilable
def rod_speed(c, w, supply: float) -> Any:
    """Speed at which a quasi-static joint's chamber fills [m/s], its flow from the pump
    [m³/s], and how that rises with P [Pa].

    The scratch space w has the net opening `open_area` [m²], above 0 towards A, the load
    `push` of gravity and springs, dry friction `thrust` [N], damping `drag` [N·s/m]; of
    a rotary actuator torques. It is `faster` by a part. P is `supply`.
    """
    if w.open_area == 0.0:
        return 0.0, 0.0, 0.0
    side, other, sign = (c.a, c.b, 1.0) if w.open_area > 0.0 else (c.b, c.a, -1.0)
    area = (1.0 + w.faster) * abs(w.open_area)
    if c.by_command >= 0.5:
        flow = c.conductance * area * np.sqrt(MARGIN * c.supply_pressure)
        return flow / side.area, side.draw * flow, 0.0
    load = sign * w.push + w.thrust
    drag = w.drag
    # what the drops over both edges take from the force of the oil, over v²
    pump_edge = c.conductance * area
    tank_edge = c.conductance * area * other.return_
    into = (side.area / pump_edge) ** 2 * side.area
    back = (other.area / tank_edge) ** 2 * other.area
    free = supply * side.area - c.tank_pressure * other.area - load
    if free <= 0.0:
        return 0.0, 0.0, 0.0
    speed, root = speed_against(free, drag, into + back)
    rise = side.area * side.area / root
    drop = supply  # over the pump edge of an empty chamber
    if c.compensation > 0.0:
        # beyond its margin the edge feels only a part of drop and pressures
        left = 1.0 - c.compensation
        fed = 1.0 - c.compensation * (1.0 - MARGIN)
        drop = fed * supply
        push = left * free + c.compensation * MARGIN * supply * side.area
        root = np.sqrt(left * left * drag * drag + 4.0 * push * (into + left * back))
        slower = 2.0 * push / (left * drag + root)
        if slower < speed:
            speed = slower
            rise = fed * side.area * side.area / root
    flow = side.area * speed
    if flow > c.flow_limit:
        speed = c.flow_limit / side.area
        flow = c.flow_limit
        rise = 0.0
    pressed = (drag + back * speed) * speed + c.tank_pressure * other.area + load
    # the load overruns the pump's oil: the chamber cavitates, and what leaves the other
    # one governs
    if pressed < 0.0:
        falling = -c.tank_pressure * other.area - load
        speed, _ = speed_against(falling, drag, back)
        flow = pump_edge * np.sqrt(drop)
        rise = 0.5 * flow / supply
        if flow > c.flow_limit:
            flow = c.flow_limit
            rise = 0.0
    return speed, side.draw * flow, side.draw * rise
