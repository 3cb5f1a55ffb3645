"""Cylinder or rotary actuator (article 2.2, equation (9)): how its rod moves with the
joint, and what acts on it beside oil.

    F_R = A_A p_A − A_B p_B − F_c

A rotary actuator has D_m for both areas, and the joint's angle for its travel.

dynamic         Way, moment arm and the arm's slope, all that a step passes through;
                stops that damp (F_c), and what a joint rests on at the start.
quasi-static    Way and moment arm at the middle of a step (`weigh`). A stop ends a
                motion at once; what a joint rests on is left out.
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

from typing import Any

import numpy as np

from hydroid.arrays import Array
from hydroid.hydraulics.elementwise import compilable
from hydroid.hydraulics.records import LINEAR, ROTARY
from hydroid.hydraulics.seals import sliding_friction
from hydroid.settings import linkage

# what a joint's rest gives under the load that it carries at the start [rad]; ours
GIVE = 5e-4

triangle = compilable(linkage.triangle)
four_bar = compilable(linkage.four_bar)


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


def rod_motion(angle: Array, c) -> list[Array]:
    """Travel x [m], moment arm r = dx/dq [m/rad] and dr/dq of COEFFICIENTS at angles
    [rad], elementwise.

    Of a rotary actuator x is the angle, and r is 1, unless its moment arm is `bent`.
    """
    still = (angle, 1.0, 0.0)
    kinds = [c.kind == LINEAR, c.kind == ROTARY]
    is_linear, is_rotary = (bool(np.any(kind)) for kind in kinds)
    with np.errstate(all="ignore"):  # joints without a range, a rocker or a triangle
        cylinder = _rods(angle, c) if is_linear else still
        turned = bent(angle, c) if is_rotary else still
    return [
        np.select(kinds, [linear, rotary], without)
        for linear, rotary, without in zip(cylinder, turned, still, strict=True)
    ]


def _rods(angle: Array, c) -> tuple[Any, Any, Any]:
    """Return the same of cylinders."""
    has_rocker = c.rocker > 0
    psi = angle
    first = 1.0
    second = 0.0
    if np.any(has_rocker):
        rocked = four_bar(angle, c)
        psi = np.where(has_rocker, rocked[0], angle)
        first = np.where(has_rocker, rocked[1], 1.0)
        second = np.where(has_rocker, rocked[2], 0.0)
    travel, arm, slope = triangle(
        psi, c.pivot_distance_1, c.pivot_distance_2, c.theta0, c.shortest
    )
    return travel, arm * first, slope * first**2 + arm * second


@compilable
def rod_way(c, angle: float) -> Any:
    """Travel of one joint's rod [m] and its moment arm [m/rad] at an angle [rad]; of a
    rotary actuator as `bent`."""
    if c.kind == LINEAR:
        way, arm, _ = rod(angle, c)
    else:
        way, arm, _ = bent(angle, c)
    return way, arm


@compilable
def weigh(c, w, angle: float, torque: float) -> None:
    """Moment arm, load and friction of the rod of a quasi-static joint that a torque
    [N·m] must hold at an angle [rad]."""
    w.arm = rod_way(c, angle)[1]
    w.push = torque / w.arm
    sliding_friction(c, w)


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
