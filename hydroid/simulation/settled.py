"""Settled speeds of all joints at once, and their inverse: the commands at which joints
move as wished.

As in `steady`, commands are held, all that starts, lags or rings has passed, and lever
and load are those of the pose; here the joints share the pump's line. At a line
pressure P each joint is alone: its speed rises with its command, so that halvings find
the least command that is enough. What the joints then draw from the line rises with P,
and what the pump gives falls, so that there is one P.

What the dynamic model's oil takes in because load and lever change on the way is left
out.
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from hydroid.arrays import Array
from hydroid.hydraulics.cylinder import weigh
from hydroid.hydraulics.elementwise import compilable
from hydroid.hydraulics.kernel import Plugin, make_pad, source_key
from hydroid.hydraulics.pump import centre_left, delivery, lowest, past_valves
from hydroid.rungs import Rung
from hydroid.simulation.laws import LAWS
from hydroid.simulation.rollout import call_compiled
from hydroid.simulation.steady import false_position, illinois, steady_opening

FULL_COMMAND = 100.0  # [%]
HALVINGS = 32
"""of the full command: to 2e-8 %"""
MOST_PRESSURES = 40
"""of the line that are tried; five suffice"""
CLOSE = 1e-9  # part of the relief pressure that two pressures of the line may be apart
# part of the pump's flow that may be left: more than the halvings leave of a command
SETTLED = 1e-6


@compilable
def least_command(c, w, wished: float, supply: float, rod, reaches) -> float:
    """Least command [%] at which a rod moves as fast as wished [m/s]; the full one
    where none is enough."""
    if wished == 0.0:
        return 0.0
    sign = 1.0 if wished > 0.0 else -1.0
    low = 0.0
    high = FULL_COMMAND
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        w.open_area = steady_opening(sign * middle, c)
        if reaches(rod, c, w, wished, supply):
            high = middle
        else:
            low = middle
    return sign * high


@compilable
def nearest_command(c, w, wished: float, command: float, supply: float, rod) -> float:
    """The least command that is enough, or the one below it where that is nearer to the
    wish.

    A valve that opens with a jump has a slowest speed.
    """
    w.open_area = steady_opening(command, c)
    beyond = abs(rod(c, w, supply)[0] - wished)
    # two of the last halvings: surely on the other side of a jump
    below = command - np.sign(command) * 2.0 * FULL_COMMAND * 0.5**HALVINGS
    if below * command <= 0.0:
        below = 0.0
    w.open_area = steady_opening(below, c)
    reached = rod(c, w, supply)[0]
    if abs(reached - wished) >= beyond:
        return command
    # no command at all rather than one that moves nothing
    return 0.0 if reached == 0.0 else below


class Sought(NamedTuple):
    """What is sought: commands for speeds if `inverse`, or speeds; by what of a
    `Law`."""

    inverse: bool
    rod: Any
    reaches: Any


class Rods(NamedTuple):
    """Of the J joints: scratch space, commands [%], wished speeds [rad/s], and those of
    the rods [m/s]."""

    work: Any
    command: Any
    wished: Any
    speed: Any


class Poses(NamedTuple):
    """Where S poses have the joints [rad], and what holds them there [N·m], shape (S,
    J) each."""

    angle: Array
    load: Array


@compilable
def drawn_at(plugin: Plugin, rods: Rods, sought: Sought, pressure: float) -> float:
    """Flow from the line [m³/s] at its pressure [Pa]; writes the rods' speeds, and
    inversely commands."""
    drawn = 0.0
    for a in range(plugin.idle, plugin.order.size):
        j = plugin.order[a]
        c = plugin.coefficients[j]
        w = rods.work[j]
        supply = min(pressure, c.supply_pressure)
        if sought.inverse:
            wished = rods.wished[j] * w.arm
            rods.command[j] = least_command(
                c, w, wished, supply, sought.rod, sought.reaches
            )
        w.open_area = steady_opening(rods.command[j], c)
        rods.speed[j], flow = sought.rod(c, w, supply)
        drawn += flow
    return drawn


@compilable
def taken_at(plugin: Plugin, rods: Rods, sought: Sought, pressure: float) -> float:
    """Flow from the line [m³/s] at its pressure [Pa], what runs past the valves
    included; writes as `drawn_at`."""
    driven = plugin.order[plugin.idle :]
    pump = plugin.coefficients[plugin.order[plugin.order.size - 1]]
    drawn = drawn_at(plugin, rods, sought, pressure)
    centre = centre_left(plugin.coefficients, driven, rods.work, 0.0)
    return drawn + past_valves(pressure, centre, pump)[0]


@compilable
def shared_pressure(plugin: Plugin, rods: Rods, sought: Sought) -> float:
    """Pressure of the line [Pa] at which the pump gives what joints draw; inf where it
    has no limit.

    Regula falsi by the Illinois rule: what joints draw at wished speeds hardly depends
    on the pressure.
    """
    pump = plugin.coefficients[plugin.order[plugin.order.size - 1]]
    if pump.pump_flow == np.inf:
        return np.inf
    low = lowest(pump)
    high = pump.relief
    over = taken_at(plugin, rods, sought, high)
    if over <= 0.0:
        return high
    # where the pump gives this flow; at less pressure no more is taken
    if over < pump.pump_flow:
        part = (over / pump.pump_flow) ** pump.pump_exponent
        low = max(low, high - pump.pump_droop * part)
    given = delivery(low, 1.0, pump)[0]
    under = taken_at(plugin, rods, sought, low) - given
    left = SETTLED * pump.pump_flow
    if under >= -left:
        return low
    last = 0
    for count in range(MOST_PRESSURES):
        # a pump without a droop gives any flow there
        if high - low <= CLOSE * pump.relief:
            break
        pressure = false_position(low, high, under, over)
        # where the rule creeps
        if count % 4 == 3:
            pressure = 0.5 * (low + high)
        given = delivery(pressure, 1.0, pump)[0]
        excess = taken_at(plugin, rods, sought, pressure) - given
        if abs(excess) <= left:
            return pressure
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
    return 0.5 * (low + high)


@compilable
def _settle(plugin, poses, sought, command, velocity) -> None:
    """Replace velocities [rad/s], (S, J), by the settled ones; inversely commands by
    those that do it."""
    joints = plugin.order.size
    work = make_pad(joints).joints
    speed = np.zeros(joints)
    wished = np.zeros(joints)
    for k in range(poses.angle.shape[0]):
        for a in range(plugin.idle, joints):
            j = plugin.order[a]
            c = plugin.coefficients[j]
            weigh(c, work[j], poses.angle[k, j], poses.load[k, j])
        wished[:] = velocity[k]
        rods = Rods(work, command[k], wished, speed)
        pressure = shared_pressure(plugin, rods, sought)
        drawn_at(plugin, rods, sought, pressure)
        for a in range(plugin.idle, joints):
            j = plugin.order[a]
            c = plugin.coefficients[j]
            w = work[j]
            if sought.inverse and wished[j] != 0.0:
                supply = min(pressure, c.supply_pressure)
                command[k, j] = nearest_command(
                    c, w, wished[j] * w.arm, command[k, j], supply, sought.rod
                )
                w.open_area = steady_opening(command[k, j], c)
                speed[j] = sought.rod(c, w, supply)[0]
            velocity[k, j] = speed[j] / w.arm + 0.0  # no -0


@cache
def _compiled(rod: Any, reaches: Any) -> Any:
    """Return `_settle` by a law."""

    @njit(cache=True, nogil=True, error_model="numpy")
    def settle(
        plugin,
        poses,
        inverse: bool,
        command,
        velocity,
        source: int = source_key(rod, reaches, _settle),
    ) -> None:
        _settle(plugin, poses, Sought(inverse, rod, reaches), command, velocity)

    return settle


def settled_speeds(
    plugin: Plugin, angle: Array, load: Array, command: Array, rung: Rung
) -> Array:
    """Return the settled velocities of J joints [rad/s] under commands [%], shape (S,
    J), on a rung that has settled speeds.

    Args:
        plugin: the actuators of one candidate.
        angle: [rad], shape (S, J).
        load: torques that hold the joints against gravity and springs [N·m], shape (S,
            J).
        command: [%], shape (S, J).

    Of a joint that slides they are in m/s, and loads are forces [N]. One without
    actuator has 0.
    """
    velocity = np.zeros(angle.shape)
    _call(rung, plugin, Poses(angle, load), False, command.copy(), velocity)
    return velocity


def settled_commands(
    plugin: Plugin, angle: Array, load: Array, velocity: Array, rung: Rung
) -> tuple[Array, Array]:
    """Return commands [%] at which joints have wished velocities [rad/s], (S, J), and
    those they then have.

    Where a wish cannot be had it is the nearest of what the joint can do beside the
    others. Arguments are as of `settled_speeds`.
    """
    command = np.zeros(angle.shape)
    reached = velocity.copy()
    _call(rung, plugin, Poses(angle, load), True, command, reached)
    return command, reached


def _call(rung: Rung, plugin: Plugin, poses: Poses, *arguments: Any) -> None:
    """Settle joints by the law of a rung."""
    # of one layout, for which the law is compiled once
    poses = Poses(*map(np.ascontiguousarray, poses))
    if not rung.has("pump_flow"):
        endless = plugin.coefficients.copy()
        endless["pump_flow"] = np.inf
        plugin = plugin._replace(coefficients=endless)
    law = LAWS[rung]
    call_compiled(_compiled(law.rod, law.reaches), plugin, poses, *arguments)
