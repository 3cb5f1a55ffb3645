"""Stage 2: what the whole chain from command to torque adds to an arm that is stepped."""

import mujoco
import numpy as np

from hydroid.arm.locked import LockedArm
from hydroid.arrays import Array, Index, Mask, Structs
from hydroid.hydraulics.actuator import at_rest, make_plugin, swallowed
from hydroid.hydraulics.kernel import Plugin
from hydroid.hydraulics.records import NONE, Records, coefficients, without_actuator
from hydroid.settings.arm import Arm
from hydroid.simulation.scenario import Candidates

STOP_REACH = np.radians(1.0)
"""how near an end of its range a joint must start to rest on its stop"""


class Chain:
    """The actuators of an arm, for any candidates.

    Args:
        arm: the arm's settings, for its stops and actuators.
        locked: the arm that is stepped.
        active: which of the arm's joints have hydraulics, shape (J,).
        substeps: of valves and oil in one MuJoCo step.
        pushed: columns of the moving joints whose torques are given instead: in stage 1 all.

    Attributes:
        columns: all other moving joints, with and without actuator: they couple through their inertia.
        joints: the same among the arm's joints, 0-based.
        pushed: as given.
    """

    def __init__(self, arm: Arm, locked: LockedArm, active: Mask, substeps: int, pushed: Index) -> None:
        self.columns = np.setdiff1d(np.arange(len(locked.columns)), pushed)
        self.joints, self.pushed = locked.columns[self.columns], pushed
        self._pushed = locked.columns[pushed].tolist()
        self._idle = ~active[self.joints]
        for joint in self.joints[active[self.joints]].tolist():
            if arm.joints[joint].actuator is None:
                raise without_actuator(arm, joint)
        self._range = np.array([arm.lower, arm.upper])[:, self.joints]
        self._entries = mass_entries(locked.model)[np.ix_(self.columns, self.columns)]
        self._period, self._substeps = locked.model.opt.timestep, substeps

    def start(
        self, candidates: Candidates, pose: Array, balance: Array, pressure: Array | None = None
    ) -> tuple[Plugin, Structs]:
        """Return the actuators of n candidates, with a force-stroke curve each, and their states at rest.

        `pose` is the moving joints' [rad], shape (V,); `balance` holds them there [N·m], shape (n, V).
        Chamber pressures measured there [Pa], shape (V, 2), NaN where there are none, are taken by
        candidates that have no start pressure of their own.
        """
        joints: Records = candidates.joints[:, self.joints]  # pyright: ignore[reportAssignmentType]
        away = np.min(abs(self._range - pose[self.columns]), axis=0) > STOP_REACH
        joints.trapped_pressure[:, away] = np.inf
        if pressure is not None:
            trapped, level = pressure[self.columns].T
            asked = np.isinf(joints.start_pressure) & np.isfinite(pressure[self.columns]).all(axis=1)
            rests = asked & np.isfinite(joints.trapped_pressure)
            joints["trapped_pressure"] = np.where(rests, trapped, joints.trapped_pressure)
            joints["start_pressure"] = np.where(asked, level, joints.start_pressure)
        joints.kind[:, self._idle] = NONE
        plugin = make_plugin(joints, self._entries, self._period, self._substeps)
        angle = np.tile(pose[self.columns], (len(balance), 1))
        return plugin, at_rest(plugin, angle, balance[:, self.columns])

    def taken(self, candidates: Candidates, angle: Array, velocity: Array) -> Array:
        """What P joints that follow a log take from the pump [m³/s], (n, steps); (n, 0) if there are none.

        Angle [rad] and velocity [rad/s] of their motion have the shape (steps, P).
        """
        joints: Records = candidates.joints[:, self._pushed]  # pyright: ignore[reportAssignmentType]
        if not self.joints.size or np.isinf(joints.pump_flow).all():
            return np.empty((len(candidates), 0))
        each: Records = coefficients(joints)[:, None]  # pyright: ignore[reportAssignmentType]
        return swallowed(each, angle, velocity).sum(axis=2)


def mass_entries(model: mujoco.MjModel) -> Index:
    """Where M[i, j] stands in a row of MuJoCo's sparse mass matrix, shape (V, V)."""
    entries = np.zeros((model.nv, model.nv), np.intp)
    rows, columns = np.repeat(np.arange(model.nv), model.M_rownnz), model.M_colind
    entries[rows, columns] = entries[columns, rows] = np.arange(model.nC)
    return entries
