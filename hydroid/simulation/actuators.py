"""The actuators of one arm, whatever the candidate: which joints have them, where they meet MuJoCo's model."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from hydroid.arm.locked import LockedArm
from hydroid.hydraulics.actuator import Actuator, ActuatorState
from hydroid.hydraulics.records import Records, linkages
from hydroid.settings.arm import Arm
from hydroid.settings.hydraulics import HydraulicSettings
from hydroid.simulation.candidates import Array, Candidates


class ArmActuators:
    """What stage 2 adds to an arm.

    Args:
        arm: the arm's settings, for the cylinders' triangles.
        locked: the arm that is stepped.
        active: which of the arm's joints have hydraulics, shape (J,).
        settings: of the hydraulics.
        follows: columns of the moving joints that follow a log, which have a servo instead.

    Attributes:
        columns: all other moving joints, with and without actuator: they couple through their inertia.
        joints: the same among the arm's joints, 0-based.
    """

    def __init__(
        self,
        arm: Arm,
        locked: LockedArm,
        active: NDArray[np.bool_],
        settings: HydraulicSettings,
        follows: NDArray[np.intp],
    ) -> None:
        self.columns = np.setdiff1d(np.arange(len(locked.columns)), follows)
        self.joints = locked.columns[self.columns]
        everyone = [int(j) for j in self.joints]
        self._linkages = linkages(arm, everyone, [j for j in everyone if active[j]])
        self._entries = mass_entries(locked.model)[np.ix_(self.columns, self.columns)]
        self._period, self._settings = locked.model.opt.timestep, settings

    def start(self, candidates: Candidates, pose: Array, balance: Array) -> tuple[Actuator, ActuatorState]:
        """Return the actuators of n candidates and their state at rest.

        Args:
            candidates: with a force-stroke curve each.
            pose: of the moving joints [rad], shape (V,).
            balance: what must hold them there [N·m], shape (n, V).
        """
        assert candidates.actuators is not None
        chosen: Records = candidates.actuators[:, self.joints]  # pyright: ignore[reportAssignmentType]
        damping = candidates.damping[:, self.joints]
        actuator = Actuator(chosen, self._linkages, damping, self._period, self._settings, self._entries)
        angle = np.tile(pose[self.columns], (len(balance), 1))
        return actuator, actuator.start(angle, balance[:, self.columns])


def mass_entries(model: mujoco.MjModel) -> NDArray[np.intp]:
    """Where M[i, j] stands in a row of MuJoCo's sparse mass matrix, shape (V, V)."""
    entries = np.zeros((model.nv, model.nv), np.intp)
    for i in range(model.nv):
        for place in range(model.M_rowadr[i], model.M_rowadr[i] + model.M_rownnz[i]):
            j = model.M_colind[place]
            entries[i, j] = entries[j, i] = place
    return entries
