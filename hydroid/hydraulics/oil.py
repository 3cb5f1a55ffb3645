"""The oil in an actuator's two chambers (article 2.2, part of equation (9)), in both
models.

    ṗ_A = β/V_A (Q_A − A_A ẋ),   ṗ_B = β/V_B (A_B ẋ − Q_B)

with V = dead volume + area × travel. A rotary actuator has D_m for both areas, the
joint's angle for its travel, and chambers of constant volume. The block that the
article used has stiff oil; a large β is that limit.

What is stored is not pressure but *oil*: y = p + β ln(V/V_0) (for a rotary chamber y =
p ± β D_m q/V_0). It changes by valve flow alone, ẏ = β Q / V, whatever the joint does,
so that shut chambers conserve their oil to the last digit and pressures come back with
the angle. Where oil alone does not fill the chamber, the pressure rests at vapour
pressure, which is taken for 0, and y remembers the missing volume: no oil is made or
lost.

dynamic         y is integrated: `begin_oil`, then `press` and `take_flow` in each
                sub-step
quasi-static    pressures follow from load and speed at once: `store_oil` writes the y
                that has them, for those who read pressures. No oil is compressed, and
                none is missing where a chamber cavitates. Of the spring that oil is,
                a joint may have what a log shows (`overshoot`).
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

from typing import Any

import numpy as np

from hydroid.arrays import Array
from hydroid.hydraulics.cylinder import bent, rod, rod_way
from hydroid.hydraulics.elementwise import compilable, implicit_weight
from hydroid.hydraulics.records import LINEAR, ROTARY

SMALLEST = 0.1
"""part of the dead volume that a chamber keeps, however far a joint is driven beyond
its stops; ours"""


@compilable
def volume(travel, area, dead) -> Any:
    """Volume of a chamber [m³] that opens with `travel` [m] at `area` [m²]."""
    return np.maximum(dead + area * travel, SMALLEST * dead)


@compilable
def volumes(travel, c) -> Any:
    """Volumes of chambers A and B of a cylinder [m³] whose rod stands at `travel`
    [m]."""
    volume_a = volume(travel, c.a.area, c.dead_volume)
    volume_b = volume(c.stroke - travel, c.b.area, c.dead_volume)
    return volume_a, volume_b


@compilable
def filling(travel, area, dead) -> Any:
    """ln(V/V_0) of a chamber that opens with `travel` [m] at `area` [m²]."""
    return np.log(volume(travel, area, dead) / dead)


def fills(travel: Array, c) -> list[Array]:
    """ln(V/V_0) of chambers A and B of COEFFICIENTS at rods' travels [m]; ± D_m q/V_0
    of a rotary actuator, which travels by its angle q [rad]."""
    linear = c.kind == LINEAR
    dead = c.dead_volume
    cylinder_a = filling(travel, c.a.area, dead)
    cylinder_b = filling(c.stroke - travel, c.b.area, dead)
    turned_a = travel * c.a.area / dead
    turned_b = -travel * c.b.area / dead
    return [
        np.where(linear, cylinder_a, turned_a),
        np.where(linear, cylinder_b, turned_b),
    ]


@compilable
def begin_oil(c, z, w, angle: float) -> None:
    """Geometry and chamber pressures of a joint at the start of a step, from its oil."""
    bulk = c.bulk_modulus
    dead = c.dead_volume
    if c.kind == LINEAR:
        w.travel, w.arm, w.slope = rod(angle, c)
        w.a.pressure = z.a.oil - bulk * filling(w.travel, c.a.area, dead)
        w.b.pressure = z.b.oil - bulk * filling(c.stroke - w.travel, c.b.area, dead)
    elif c.kind == ROTARY:
        turned, w.arm, w.slope = bent(angle, c)
        # its chambers have a constant volume
        w.travel = 0.0
        w.a.pressure = z.a.oil - bulk * c.a.area * turned / dead
        w.b.pressure = z.b.oil + bulk * c.b.area * turned / dead


@compilable
def press(w, lever: float, rate: float) -> float:
    """How a chamber answers to flow and motion; its stiffness at the joint times the
    step.

    `lever` is the torque per pressure [m³/rad], `rate` the pressure per volume [Pa/m³]
    times the step [s].
    """
    w.lever = lever
    w.rate = rate
    relax = w.filled * rate * w.relief
    w.weight = implicit_weight(relax)
    w.rise = rate / (1.0 + w.weight * relax)
    return w.filled * lever * lever * w.rise


@compilable
def take_flow(z, w, mean: float) -> None:
    """Take over pressure and oil of a chamber at the mean velocity [rad/s] of a
    sub-step."""
    gain = w.rise * (w.inflow - w.lever * mean)
    # the valve gives less as the pressure rises: so much of it passed in the mean
    flow = w.inflow - w.weight * w.filled * w.relief * gain
    w.pressure += gain
    z.oil += w.rate * flow
    w.flow += flow


@compilable
def store_oil(c, z, w, speed: float, angle: float, supply: float) -> None:
    """Store the oil and flows of a quasi-static joint as `actuator.pressures` reads
    them.

    A joint that stands has tank pressure in one chamber, and in the other what holds
    the load w.push [N]; or, if its valve is open to a `supply` [Pa] that cannot lift
    the load, at least that pressure.
    """
    a = c.a.area
    b = c.b.area
    tank = c.tank_pressure
    edge = c.conductance * (1.0 + w.faster) * abs(w.open_area)
    pressure_a = max(tank, (tank * b + w.push) / a)
    pressure_b = max(tank, (tank * a - w.push) / b)
    if speed != 0.0:
        # the tank edge gives the pressure behind the piston, forces the one before it
        against = w.thrust + w.drag * speed
        if w.open_area > 0.0:
            pressure_b = tank + (speed * b / (edge * c.b.return_)) ** 2
            pressure_a = (pressure_b * b + against + w.push) / a
        else:
            pressure_a = tank + (speed * a / (edge * c.a.return_)) ** 2
            pressure_b = (pressure_a * a + against - w.push) / b
    elif w.open_area > 0.0:
        pressure_a = max(supply, (tank * b + w.push - w.thrust) / a)
    elif w.open_area < 0.0:
        pressure_b = max(supply, (tank * a - w.push - w.thrust) / b)
    # what `actuator.pressures` takes off again
    out = rod_way(c, angle)[0]
    fill_a = out * a / c.dead_volume
    fill_b = -out * b / c.dead_volume
    if c.kind == LINEAR:
        fill_a = filling(out, a, c.dead_volume)
        fill_b = filling(c.stroke - out, b, c.dead_volume)
    z.a.oil = max(pressure_a, 0.0) + c.bulk_modulus * fill_a
    z.b.oil = max(pressure_b, 0.0) + c.bulk_modulus * fill_b
    sign = 1.0 if w.open_area > 0.0 else -1.0
    z.a.flow = sign * a * speed
    z.b.flow = -sign * b * speed


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
