"""A known mass in the gripper, for logs that were recorded with one."""

import mujoco

from hydroid.errors import SettingsError
from hydroid.settings.arm import Arm

RADIUS = 0.05
"""of the ball that a payload is taken for [m] (ours): its inertia is small beside what its distance makes"""


def add_payload(spec: mujoco.MjSpec, arm: Arm, mass: float) -> mujoco.MjSpec:
    """Return a copy of the arm's model that carries `mass` [kg] where the arm's settings put a payload.

    Raises:
        SettingsError: they do not say where.
    """
    if arm.payload is None:
        hint = "add payload: {carried_by: LINK, at: [x, y, z]} to the arm's file"
        raise SettingsError(f"{arm.name} has no place for a payload", where="payloads", hint=hint)
    loaded = spec.copy()
    loaded.body(arm.payload.carried_by).add_body(
        name="payload",
        pos=arm.payload.at,
        ipos=[0.0, 0.0, 0.0],
        explicitinertial=True,
        mass=mass,
        inertia=[0.4 * mass * RADIUS**2] * 3,
    )
    return loaded
