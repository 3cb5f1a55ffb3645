"""The steady velocity of one joint that has the pump to itself, of many candidates."""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

from functools import cache
from typing import Any

import numpy as np
from numba import njit

from hydroid.arrays import Array
from hydroid.hydraulics.actuator import make_plugin
from hydroid.hydraulics.kernel import make_pad, source_key
from hydroid.hydraulics.records import Records, coefficients, has_force_curve
from hydroid.rungs import Rung
from hydroid.simulation.laws import LAWS
from hydroid.simulation.settled import settled_speeds
from hydroid.simulation.steady import steady_opening


@cache
def _compiled(lone: Any) -> Any:
    """Return what fills in the velocities [rad/s] of n candidates' joint under m
    commands [%], (n, m), by `Law.lone`; loads are (n, 3), COEFFICIENTS (n,)."""

    @njit(cache=True, nogil=True, error_model="numpy")
    def fill(
        coefficients,
        angle,
        load,
        commands,
        velocity,
        source: int = source_key(lone, steady_opening),
    ) -> None:
        pad = make_pad(1)
        for i in range(coefficients.size):
            alone = coefficients[i : i + 1]
            for k in range(commands.size):
                pad.joints[0].open_area = steady_opening(commands[k], coefficients[i])
                velocity[i, k] = lone(alone, pad, angle, load[i])

    return fill


def steady_velocity(
    joint: Records, angle: float, load: Array, commands: Array, rung: Rung
) -> Array:
    """Return the velocities [rad/s] at which a joint turns steadily under m commands
    [%], shape (n, m), on a rung that has settled speeds.

    Args:
        joint: n candidates' values, of JOINT, shape (n,).
        angle: of the pose [rad].
        load: torques that hold the joint against gravity and springs, at the angle -
            NEAR, at the angle, and at the angle + NEAR [N·m], shape (n, 3).

    Of a joint that slides they are in m/s, and loads are forces [N]. NaN where no
    force-stroke curve exists.
    """
    alone: Records = joint[:, None]  # pyright: ignore[reportAssignmentType]
    velocity = np.empty((len(joint), len(commands)))
    lone = LAWS[rung].lone
    if lone is not None:
        table = coefficients(alone)[:, 0].view(np.ndarray)
        _compiled(lone)(table, angle, load, commands, velocity)
    else:
        plugin = make_plugin(alone, np.zeros((1, 1), np.intp), 1.0, 1)
        shape = (len(commands), 1)
        for row, held in enumerate(load[:, 1]):
            settled = settled_speeds(
                plugin.candidate(row),
                np.full(shape, angle),
                np.full(shape, held),
                commands[:, None],
                rung,
            )
            velocity[row] = settled[:, 0]
    velocity[~has_force_curve(alone)] = np.nan
    return velocity
