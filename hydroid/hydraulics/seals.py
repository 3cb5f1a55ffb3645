"""Friction of an actuator's seals and of its joint, in both models.

dynamic         The seals' dry friction is smooth through rest: a damping that falls
                with speed, so that a joint creeps under it. The joint's own `friction`
                is MuJoCo's, which holds.
quasi-static    Both act in full against a motion, whatever its speed, and both hold a
                joint that stands: no creep, and no breaking loose.

In both, the joint's `damping` is viscous.
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

from typing import Any

import numpy as np

from hydroid.hydraulics.elementwise import compilable

SLIDING = 1e-3  # speed [m/s, or rad/s] above which dry friction is nearly full; ours
LEAST_LEVER = 1e-6  # moment arm below which a cylinder stands at its dead centre [m]


@compilable
def friction_damping(speed, friction) -> Any:
    """Dry friction [N] of the seals over speed [m/s], smooth through rest [N·s/m]."""
    return friction / np.sqrt(speed * speed + SLIDING * SLIDING)


@compilable
def joint_friction(c, arm: float) -> Any:
    """Force [N] by which a joint's own friction holds the rod, at its moment arm
    [m]."""
    return c.friction / max(abs(arm), LEAST_LEVER)


@compilable
def sliding_friction(c, w) -> None:
    """Write the friction `thrust` [N] and the damping `drag` [N·s/m] of a quasi-static
    joint's rod, at its moment arm `arm` [m]."""
    lever = max(abs(w.arm), LEAST_LEVER)
    w.thrust = c.dry_friction + c.friction / lever
    w.drag = c.damping / (lever * lever)
