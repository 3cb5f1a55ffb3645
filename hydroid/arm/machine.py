"""What stands in the scene: an arm alone, or two that mirror each other on one carrier."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from hydroid.arm.collision import CollisionChecker
from hydroid.arm.model import load_model, mujoco_errors
from hydroid.arm.pair import SIDES, build_pair
from hydroid.settings.arm import Arm

Array = NDArray[np.float64]

ALONE = "alone"
"""the name of the arm that is not one of two"""


@dataclass(frozen=True, eq=False)
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
        """Which of its bodies meet.

        Raises:
            ModelError: none can.
        """
        return CollisionChecker(self.model, self.arm.name)

    def joined(self, angle: Mapping[str, Array], rest: Array) -> Array:
        """Return the angles of all joints [rad], shape (T, nq).

        Args:
            angle: of the arms that move, by their names [rad], shape (T, J).
            rest: pose of the others [rad], shape (J,).
        """
        samples = max(map(len, angle.values()))
        still = np.tile(rest, (samples, 1))
        return np.hstack([angle.get(side, still) for side in self.sides])


def load_machine(arm: Arm, *, pair: bool) -> Machine:
    """Read an arm's model, and put two of them on their carrier where a pair is wanted.

    Raises:
        SettingsError: a pair that the arm's file does not name.
        ModelError: as `load_model`; MeshError: a part of the carrier that cannot be shown.
    """
    spec = load_model(arm.model, arm)
    if pair:
        spec = build_pair(spec, arm)
    with mujoco_errors(spec.modelname):
        model = spec.compile()
    return Machine(arm, model, SIDES if pair else (ALONE,))
