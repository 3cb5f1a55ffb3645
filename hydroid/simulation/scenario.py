"""What is simulated of one log: which joints move, from where, under which commands."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from hydroid.arm.locked import LockedArm, lock
from hydroid.log import Log
from hydroid.settings.arm import Arm
from hydroid.settings.simulation import SimulationSettings
from hydroid.simulation.candidates import Array, Candidates
from hydroid.simulation.prescribed import Prescribed


class Scenario:
    """A log made ready for simulation: its commands drive, from the pose in which it rests before them.

    Joints that the log drives or that are compared are *active*; what the others do is a setting.

    Args:
        spec: the arm's MJCF model.
        arm: the arm's settings.
        log: the log.
        outputs: joints whose angles are wanted, 0-based.
        settings: what the other joints do, steps, memory.

    Attributes:
        arm: the arm reduced to its V moving joints, springs slack in the start pose.
        active: shape (J,).
        outputs: columns of the outputs among the moving joints, shape (K,).
        command: held during each step [%], shape (steps, V).
        prescribed: the joints that follow the log, if any.
    """

    def __init__(
        self, spec: mujoco.MjSpec, arm: Arm, log: Log, outputs: list[int], settings: SimulationSettings
    ) -> None:
        self._settings = settings
        self.active = log.driven.copy()
        self.active[outputs] = True
        moving = self.active | (settings.other_joints != "locked")
        self.arm: LockedArm = lock(spec, arm, np.array(arm.joint_names)[moving].tolist(), log.start)
        self.arm.model.opt.timestep = log.period / settings.steps_per_sample
        self.arm.model.qpos_spring[:] = self.arm.pose
        self.outputs = np.searchsorted(self.arm.columns, outputs)
        self.command = np.repeat(log.command[:-1, moving], settings.steps_per_sample, axis=0)
        self.prescribed = None
        if settings.other_joints == "measured" and not self.active.all():
            follows = np.flatnonzero(~self.active)
            columns = np.searchsorted(self.arm.columns, follows)
            self.prescribed = Prescribed(self.arm.model, log, follows, columns, settings)

    def values(self, candidates: Candidates) -> dict[str, Array]:
        """Return what candidates change in the model, the prescribed joints' servo included."""
        values = model_values(self.arm, candidates)
        if self.prescribed is not None:
            columns = self.prescribed.columns
            values["dof_damping"][:, columns] = self.prescribed.damping
            values["jnt_stiffness"][:, columns] = self.prescribed.stiffness
            values["dof_frictionloss"][:, columns] = 0.0
        return values

    @property
    def chunk(self) -> int:
        """Candidates simulated together: as many as the memory setting allows."""
        candidate = 2 * 8 * self.command.size  # torque in, angle out [bytes]
        return max(1, self._settings.chunk_mib * 2**20 // max(candidate, 1))

    def sampled(self, angle: Array) -> Array:
        """Return angles at the log's samples, start pose first, from those after each step.

        Args:
            angle: of the outputs after each step [rad], shape (n, steps, K).
        """
        steps = self._settings.steps_per_sample
        out = np.empty((len(angle), 1 + angle.shape[1] // steps, len(self.outputs)))
        out[:, 0] = self.arm.pose[self.outputs]
        out[:, 1:] = angle[:, steps - 1 :: steps]
        return out


def model_values(arm: LockedArm, candidates: Candidates) -> dict[str, NDArray[np.float64]]:
    """Return the fields of mjModel that n candidates change, by name, shape (n, ...) each."""
    return arm.inertials(candidates.mass) | {
        "dof_damping": candidates.damping[:, arm.columns],
        "jnt_stiffness": candidates.stiffness[:, arm.columns],
        "dof_frictionloss": candidates.friction[:, arm.columns],
    }
