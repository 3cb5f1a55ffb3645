"""What is simulated: one log's joints, start and commands, for a population of candidates."""

from copy import copy
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from hydroid.arm.locked import LockedArm, lock
from hydroid.arrays import Array, Index, Mask
from hydroid.hydraulics.records import Records
from hydroid.log import Log
from hydroid.settings.arm import Arm
from hydroid.settings.problem import SimulationSettings
from hydroid.simulation.prescribed import Prescribed


@dataclass(frozen=True)
class Candidates:
    """Physical values of n candidates, joints and links in the arm's order.

    joints: of `hydroid.hydraulics.records.JOINT`, in SI but for the gain [N·m/%], shape (n, J). mass [kg]: of
    the links, shape (n, L).
    """

    joints: Records
    mass: Array

    def __len__(self) -> int:
        return len(self.mass)

    def __getitem__(self, rows: slice | Index) -> "Candidates":
        return Candidates(self.joints[rows], self.mass[rows])  # pyright: ignore[reportArgumentType]


@dataclass(frozen=True)
class Response:
    """Simulated angles [rad], shape (n, T, K), of the K output joints.

    A candidate that diverged has `feasible` False, shape (n,), and NaN throughout. `pressure` [Pa], shape
    (n, T, L, 2), are those of chambers A and B of L joints, where they were asked for.
    """

    angle: Array
    feasible: Mask
    pressure: Array | None = None


class Scenario:
    """A log made ready for simulation: its commands drive, from the pose in which it rests before them.

    Joints that the log drives, and `outputs` (0-based), whose angles are wanted, are *active*. A setting says
    what the others do.

    Attributes:
        settings: what the other joints do, steps, threads.
        arm: the arm reduced to its V moving joints, springs slack in the start pose.
        active: shape (J,).
        outputs: columns of the outputs among the moving joints, shape (K,).
        command: held during each step [%], shape (steps, V).
        period: between samples [s].
        prescribed: the joints that follow the log.
        pressure: in which the moving joints' chambers rest at the start [Pa], shape (V, 2), NaN where the log
            has none.
    """

    def __init__(
        self, spec: mujoco.MjSpec, arm: Arm, log: Log, outputs: list[int], settings: SimulationSettings
    ) -> None:
        self.settings = settings
        self.active = log.driven.copy()
        self.active[outputs] = True
        moving = self.active | (settings.other_joints != "locked")
        self.arm: LockedArm = lock(spec, arm, moving, log.start)
        self.arm.model.opt.timestep = log.period / settings.steps
        self.arm.model.qpos_spring[:] = self.arm.pose
        self.outputs = np.searchsorted(self.arm.columns, outputs)
        self.command = np.repeat(log.command[:-1, moving], settings.steps, axis=0)
        start = log.start_pressure
        self.pressure = np.full((len(self.arm.columns), 2), np.nan) if start is None else start[moving]
        self.period = log.period
        follows = np.flatnonzero(~self.active & (settings.other_joints == "measured"))
        columns = np.searchsorted(self.arm.columns, follows)
        self.prescribed = Prescribed(self.arm.model, log, follows, columns, settings)

    def restarted(self, start: Array, command: Array) -> "Scenario":
        """Return the same moving joints from another pose [rad], shape (V,), under other commands.

        `command` is held during each step [%], shape (steps, V). No joint may follow the log. Springs are
        slack where they were.
        """
        other = copy(self)
        other.arm, other.command = replace(self.arm, pose=start), command
        return other

    def values(self, candidates: Candidates) -> dict[str, Array]:
        """Return what candidates change in the model, the prescribed joints' servo included."""
        values, columns = model_values(self.arm, candidates), self.prescribed.columns
        values["dof_damping"][:, columns] = self.prescribed.damping
        values["jnt_stiffness"][:, columns] = self.prescribed.stiffness
        values["dof_frictionloss"][:, columns] = 0.0
        return values


def model_values(arm: LockedArm, candidates: Candidates) -> dict[str, Array]:
    """Return the fields of mjModel that n candidates change, by name, shape (n, ...) each."""
    return arm.inertials(candidates.mass) | {
        "dof_damping": candidates.joints.damping[:, arm.columns],
        "jnt_stiffness": candidates.joints.stiffness[:, arm.columns],
        "dof_frictionloss": candidates.joints.friction[:, arm.columns],
    }
