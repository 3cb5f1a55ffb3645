"""One log's record on an arm: what moves, from where, under which commands; and how chunks are made."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from hydroid.arm.locked import LockedArm, lock
from hydroid.log import Log
from hydroid.settings.arm import Arm
from hydroid.settings.simulation import SimulationSettings
from hydroid.simulation.prescribed import Prescribed

Array = NDArray[np.float64]


class Record:
    """A log made ready for simulation: its commands drive, from the pose in which it rests before them.

    Joints that the log drives or that are compared are *active*; what the others do is a setting.

    Args:
        spec: the arm's MJCF model.
        arm: the arm's settings.
        log: the record.
        outputs: joints whose angles are wanted, 0-based.
        settings: what the other joints do, steps, memory.

    Attributes:
        arm: the arm reduced to its V moving joints.
        joints: these joints, 0-based among the arm's, shape (V,).
        outputs: columns of the outputs among them, shape (K,).
        pose: where they start [rad], shape (V,).
        command: held during each step [%], shape (steps, V).
        prescribed: the joints that follow the log, if any.
    """

    def __init__(
        self, spec: mujoco.MjSpec, arm: Arm, log: Log, outputs: list[int], settings: SimulationSettings
    ) -> None:
        self._settings = settings
        active = log.driven.copy()
        active[outputs] = True
        self.active = active
        self.joints: NDArray[np.intp] = np.flatnonzero(active | (settings.other_joints != "locked"))
        self.outputs = np.searchsorted(self.joints, outputs)
        self.pose = log.start[self.joints]
        self.arm: LockedArm = lock(spec, arm, [arm.joint_names[j] for j in self.joints], log.start)
        self.arm.model.opt.timestep = log.period / settings.steps_per_sample
        self.arm.model.qpos_spring[:] = self.pose  # slack at the start
        self.command = np.repeat(log.command[:-1, self.joints], settings.steps_per_sample, axis=0)
        self.prescribed = None
        if settings.other_joints == "measured" and not active.all():
            follows = np.flatnonzero(~active)
            columns = np.searchsorted(self.joints, follows)
            self.prescribed = Prescribed(self.arm.model, log, follows, columns, settings)

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
        out[:, 0] = self.pose[self.outputs]
        out[:, 1:] = angle[:, steps - 1 :: steps]
        return out
