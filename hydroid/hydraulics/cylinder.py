"""Cylinder or rotary actuator (article 2.2, equation (9)) and the oil in its two
chambers.

    ṗ_A = β/V_A (Q_A − A_A ẋ),   ṗ_B = β/V_B (A_B ẋ − Q_B),   F_R = A_A p_A − A_B p_B − F_c

with V = dead volume + area × travel. A rotary actuator has D_m for both areas, the
joint's angle for its travel, and chambers of constant volume. The block that the
article used has stiff oil; a large β is that limit.

What is stored is not pressure but *oil*: y = p + β ln(V/V_0) (for a rotary chamber y =
p ± β D_m q/V_0). It changes by valve flow alone, ẏ = β Q / V, whatever the joint does,
so that shut chambers conserve their oil to the last digit and pressures come back with
the angle. Where oil alone does not fill the chamber, the pressure rests at vapour
pressure, which is taken for 0, and y remembers the missing volume: no oil is made or
lost.
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

from typing import Any

import numpy as np

from hydroid.arrays import Array
from hydroid.hydraulics.elementwise import compilable
from hydroid.hydraulics.records import LINEAR, ROTARY
from hydroid.settings import linkage

SLIDING = 1e-3  # speed [m/s, or rad/s] above which dry friction is nearly full; ours
# what a joint's rest gives under the load that it carries at the start [rad]; ours
GIVE = 5e-4
SMALLEST = 0.1
"""part of the dead volume that a chamber keeps, however far a joint is driven beyond
its stops; ours"""

triangle = compilable(linkage.triangle)
four_bar = compilable(linkage.four_bar)


@compilable
def volume(travel, area, dead) -> Any:
    """Volume of a chamber [m³] that opens with `travel` [m] at `area` [m²]."""
    return np.maximum(dead + area * travel, SMALLEST * dead)


@compilable
def filling(travel, area, dead) -> Any:
    """ln(V/V_0) of a chamber that opens with `travel` [m] at `area` [m²]."""
    return np.log(volume(travel, area, dead) / dead)


@compilable
def rod(angle: float, c) -> Any:
    """Travel x [m], moment arm r = dx/dq [m/rad] and dr/dq of one cylinder at a joint
    angle [rad]."""
    # angle at the cylinder's triangle, and its first two derivatives by the joint's
    psi = angle
    first = 1.0
    second = 0.0
    if c.rocker > 0.0:
        psi, first, second = four_bar(angle, c)
    travel, arm, slope = triangle(
        psi, c.pivot_distance_1, c.pivot_distance_2, c.theta0, c.shortest
    )
    return travel, arm * first, slope * first * first + arm * second


@compilable
def bent(angle, c) -> Any:
    """Way of a rotary actuator at an angle [rad], its moment arm, relative to that in
    the middle, and slope.

    A joint that a linkage of unknown size turns is taken for a rotary actuator whose
    moment arm r = 1 + slope s + bend s² depends on where the joint is in its range, s
    from -1 to 1. The way is its integral.
    """
    s = (angle - c.middle) / c.half
    way = angle + c.half * s * s * (0.5 * c.lever_slope + c.lever_bend * s / 3.0)
    arm = 1.0 + s * (c.lever_slope + c.lever_bend * s)
    slope = (c.lever_slope + 2.0 * c.lever_bend * s) / c.half
    return way, arm, slope


def fills(angle: Array, c) -> list[Array]:
    """ln(V/V_0) of chambers A and B at angles [rad] of COEFFICIENTS; ± D_m q/V_0 of a
    rotary actuator."""
    travel = rod_motion(angle, c)[0]
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


def rod_motion(angle: Array, c) -> list[Array]:
    """Travel x [m], moment arm r = dx/dq [m/rad] and dr/dq of COEFFICIENTS at angles
    [rad], elementwise.

    Of a rotary actuator x is the angle, and r is 1, unless its moment arm is `bent`.
    """
    still = (angle, 1.0, 0.0)
    has_rocker = c.rocker > 0
    with np.errstate(all="ignore"):  # joints without a range, a rocker or a triangle
        turned = bent(angle, c)
        rocked = four_bar(angle, c)
        psi, first, second = (
            np.where(has_rocker, with_rocker, without)
            for with_rocker, without in zip(rocked, still, strict=True)
        )
        travel, arm, slope = triangle(
            psi, c.pivot_distance_1, c.pivot_distance_2, c.theta0, c.shortest
        )
        cylinder = (travel, arm * first, slope * first**2 + arm * second)
    kinds = [c.kind == LINEAR, c.kind == ROTARY]
    return [
        np.select(kinds, [linear, rotary], without)
        for linear, rotary, without in zip(cylinder, turned, still, strict=True)
    ]


@compilable
def stop_damping(travel, speed, stroke, penetration) -> Any:
    """F_c / ẋ of the hard stops [N·s/m], equation (9): K_p × penetration, only while
    moving further in.

    F_c opposes the motion at both ends; the article's sign at the lower one would push
    the rod out of the barrel. Travel x and stroke S [m], speed ẋ [m/s], K_p [N·s/m²].
    """
    beyond = 0.0
    if speed > 0.0:
        beyond = travel - stroke
    elif speed < 0.0:
        beyond = -travel
    return penetration * np.maximum(beyond, 0.0)


@compilable
def friction_damping(speed, friction) -> Any:
    """Dry friction [N] of the seals over speed [m/s], smooth through rest [N·s/m]."""
    return friction / np.sqrt(speed * speed + SLIDING * SLIDING)


@compilable
def contact_torque(depth, contact) -> Any:
    """Torque [N·m] of what a joint rests on, at the angle [rad] left until they part.

    The stiffness `contact` [N·m/rad] is below 0, and so is the angle, if it holds the
    joint from above.
    """
    return np.abs(contact) * depth if depth * contact > 0.0 else 0.0


def holding_pressures(force, area_a, area_b, supply, tank, level) -> tuple[Any, Any]:
    """Chamber pressures p_A, p_B [Pa] that hold the arm at the start of a run,
    elementwise (ours).

    They satisfy A_A p_A − A_B p_B = force. Balance leaves their common level open: p_B
    is `level`, raised or lowered until both pressures lie between tank and supply. For
    a load too heavy for that, the nearest pressures that hold it are returned, one of
    them above supply. Of a rotary actuator the force is the torque [N·m] and both areas
    are D_m [m³/rad].
    """
    low = np.maximum(tank, (area_a * tank - force) / area_b)
    high = np.minimum(supply, (area_a * supply - force) / area_b)
    pressure_b = np.maximum(low, np.minimum(high, level))
    return (force + area_b * pressure_b) / area_a, pressure_b
