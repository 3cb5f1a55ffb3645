"""An arm's model, with a payload where a log has one."""

import mujoco

from hydroid.errors import SettingsError
from hydroid.mjcf import mujoco_errors, read_mjcf
from hydroid.settings.arm import Arm

PAYLOAD_RADIUS = 0.05
"""of the ball that a payload is taken for [m] (ours): its inertia is small beside what its distance makes"""


def load_model(arm: Arm) -> mujoco.MjSpec:
    """Read the arm's MJCF, which compiles.

    Raises:
        ModelError: as `read_mjcf`.
    """
    spec = read_mjcf(arm.model)
    with mujoco_errors(str(arm.model)):
        spec.compile()
    return spec


def add_payload(spec: mujoco.MjSpec, arm: Arm, mass: float) -> mujoco.MjSpec:
    """Return a copy of the arm's model that carries `mass` [kg] at the site of its payload.

    Raises:
        SettingsError: the arm's file names no site.
    """
    if arm.payload is None:
        hint = "name the site of the model that holds it in the arm's file, payload: SITE"
        raise SettingsError(f"{arm.name} has no place for a payload", where="payloads", hint=hint)
    loaded = spec.copy()
    site = loaded.site(arm.payload)
    body = site.parent.add_body(
        name="payload",
        pos=site.pos,
        ipos=[0.0, 0.0, 0.0],
        explicitinertial=True,
        mass=mass,
        inertia=[0.4 * mass * PAYLOAD_RADIUS**2] * 3,
    )
    if site.frame is not None:
        body.set_frame(site.frame)
    return loaded
