"""An arm's MJCF, built here or a user's own: read and checked, with a payload where a log has one."""

import warnings
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import mujoco

from hydroid.errors import ModelError, SettingsError
from hydroid.files import is_file
from hydroid.settings.arm import Arm

PAYLOAD_RADIUS = 0.05
"""of the ball that a payload is taken for [m] (ours): its inertia is small beside what its distance makes"""


def load_model(path: Path, arm: Arm) -> mujoco.MjSpec:
    """Read an MJCF, built here or a user's own, and check that it has the joints and links of the settings.

    Raises:
        ModelError: missing or refused by MuJoCo; without a joint or link of the settings; with a joint that
            no setting names, that is not a hinge, or that shares its body; with an equality constraint.
    """
    where = str(path)
    if not is_file(path):
        raise ModelError("no such model", where=where, hint="`hydroid build-model` writes it")
    with mujoco_errors(where):
        spec = mujoco.MjSpec.from_file(where)
        spec.compile()
    _match(spec, arm, where)
    return spec


def _match(spec: mujoco.MjSpec, arm: Arm, where: str) -> None:
    joints = [joint.name for joint in spec.joints]
    bodies = [body.name for body in spec.bodies]
    for what, wanted, present in (("joint", arm.joint_names, joints), ("body", arm.link_names, bodies)):
        for name in wanted:
            if name not in present:
                raise ModelError(
                    f"has no {what} {name!r}", where=where, hint=f"it has: {', '.join(filter(None, present))}"
                )
    for joint in spec.joints:
        if joint.name not in arm.joint_names:
            raise ModelError(f"joint {joint.name!r} is not in the arm's settings", where=where)
        if joint.type != mujoco.mjtJoint.mjJNT_HINGE or len(joint.parent.joints) > 1:
            raise ModelError(f"joint {joint.name!r} must be a hinge, alone on its body", where=where)
    if joints != list(arm.joint_names):
        raise ModelError(
            f"joints come in the order {', '.join(joints)}", where=where, hint="list them so in the settings"
        )
    if spec.equalities:
        raise ModelError("has equality constraints, which hydroid does not simulate", where=where)


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
        inertia=[0.4 * mass * PAYLOAD_RADIUS**2] * 3,
    )
    return loaded


@contextmanager
def mujoco_errors(where: str) -> Generator[None]:
    """Turn MuJoCo's errors into one line; `quiet_mujoco` beside."""
    try:
        with quiet_mujoco():
            yield
    except (ValueError, mujoco.FatalError) as error:
        raise ModelError(f"MuJoCo refuses it ({' '.join(str(error).split())})", where=where) from None


@contextmanager
def quiet_mujoco() -> Generator[None]:
    """Keep MuJoCo from printing a warning for every diverged candidate, and from writing MUJOCO_LOG.TXT."""
    before, silent = mujoco.MjLogConfig.get(), mujoco.MjLogConfig.get()
    silent.logto_console = silent.logto_file = False
    mujoco.MjLogConfig.set(silent)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # MuJoCo's own, of the same things
            yield
    finally:
        mujoco.MjLogConfig.set(before)
