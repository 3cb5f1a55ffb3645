"""An arm's compiled model: with a payload where a log has one, or beside its mirror image on one carrier."""

from collections.abc import Mapping
from functools import cached_property

import mujoco
import numpy as np

from hydroid.arm.collision import CollisionChecker
from hydroid.arrays import Array, record
from hydroid.errors import ModelError, SettingsError
from hydroid.mjcf import mujoco_errors, read_mjcf
from hydroid.settings.arm import Arm

ALONE = "alone"  # the name of the arm that is not one of two
SIDES = ("right", "left")
"""the arms of a pair in the order of its joints; the names of their parts begin with these and `_`"""


def load_model(arm: Arm) -> mujoco.MjSpec:
    """Read the arm's MJCF, which compiles."""
    spec = read_mjcf(arm.model)
    with mujoco_errors(str(arm.model)):
        spec.compile()
    return spec


def add_payload(spec: mujoco.MjSpec, arm: Arm, mass: float) -> mujoco.MjSpec:
    """Return a copy of the arm's model that carries `mass` [kg] at the site of its payload."""
    if arm.payload is None:
        hint = "name the site of the model that holds it in the arm's file, payload: SITE"
        raise SettingsError(f"{arm.name} has no place for a payload", "payloads", hint)
    loaded = spec.copy()
    # of a ball of 5 cm: its own inertia is small beside what its distance makes
    site, moment = loaded.site(arm.payload), 0.4 * mass * 0.05**2
    ball = {"explicitinertial": True, "mass": mass, "ipos": [0.0] * 3, "inertia": [moment] * 3}
    body = site.parent.add_body(name="payload", pos=site.pos, **ball)
    if site.frame is not None:
        body.set_frame(site.frame)
    return loaded


@record
class Machine:
    """A whole machine, all joints free, to be put into poses.

    Attributes:
        arm: the settings of each of its arms.
        model: compiled; its joints are those of `sides`, arm by arm.
        sides: names of its arms, `ALONE` or right and left.
    """

    arm: Arm
    model: mujoco.MjModel
    sides: tuple[str, ...]

    @cached_property
    def checker(self) -> CollisionChecker:
        """Which of its bodies meet."""
        return CollisionChecker(self.model, self.arm.name)

    def joined(self, angle: Mapping[str, Array], rest: Array) -> Array:
        """Return the angles of all joints [rad], (T, nq), of arms that move, (T, J) by name; others rest,
        (J,).
        """
        still = np.tile(rest, (max(map(len, angle.values())), 1))
        return np.hstack([angle.get(side, still) for side in self.sides])


def load_machine(arm: Arm, *, pair: bool) -> Machine:
    """Read the model of an arm alone, or that of two of them."""
    if not pair:
        return Machine(arm, load_model(arm).compile(), (ALONE,))
    if arm.pair is None:
        hint = "name its MJCF in the arm's file, pair: MODEL.xml"
        raise SettingsError(f"{arm.name} stands alone", "--arm", hint)
    spec = read_mjcf(arm.pair)
    wanted = [f"{side}_{name}" for side in SIDES for name in arm.joint_names]
    if [joint.name for joint in spec.joints] != wanted:
        hint = f"the joints of two arms are {', '.join(wanted)}"
        raise ModelError("is not the model of two of the arm", arm.pair, hint)
    with mujoco_errors(str(arm.pair)):
        return Machine(arm, spec.compile(), SIDES)
