"""Stage 1: the hydraulics as a gain, tau = K u + tau0 on every driven joint (article section 3)."""

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from hydroid.arm.locked import lock
from hydroid.log import Log
from hydroid.settings.arm import Arm
from hydroid.settings.simulation import SimulationSettings
from hydroid.simulation.population import ArmParameters, Population, Response
from hydroid.simulation.prescribed import Prescribed


class ArmSimulation:
    """One log's record on an arm: its commands drive, its first angles are the start pose.

    Args:
        spec: the arm's MJCF model.
        arm: the arm's settings.
        log: the record.
        outputs: joints whose angles are wanted, 0-based.
        settings: what the other joints do, steps, threads, memory.
    """

    def __init__(
        self, spec: mujoco.MjSpec, arm: Arm, log: Log, outputs: list[int], settings: SimulationSettings
    ) -> None:
        self._settings = settings
        active = log.driven.copy()
        active[outputs] = True
        moving = np.flatnonzero(active | (settings.other_joints != "locked"))
        self._arm = lock(spec, arm, [arm.joint_names[j] for j in moving], log.angle[0])
        self._arm.model.opt.timestep = log.period / settings.steps_per_sample
        self._arm.model.qpos_spring[:] = log.angle[0, moving]  # slack at the start
        self._joints: NDArray[np.intp] = moving
        self._outputs = np.searchsorted(moving, outputs)
        self._pose = log.angle[0, moving]
        self._command = np.repeat(log.command[:-1, moving], settings.steps_per_sample, axis=0)
        self._prescribed = None
        if settings.other_joints == "measured" and not active.all():
            follows = np.flatnonzero(~active)
            columns = np.searchsorted(moving, follows)
            self._prescribed = Prescribed(self._arm.model, log, follows, columns, settings)
        self._population: Population | None = None

    @property
    def chunk(self) -> int:
        """Members simulated together: as many as the memory setting allows."""
        member = 2 * 8 * self._command.size  # torque in, angle out [bytes]
        return max(1, self._settings.chunk_mib * 2**20 // max(member, 1))

    def simulate(self, parameters: ArmParameters) -> Response:
        """Simulate n members, whatever n is.

        Returns:
            Angles of the outputs at the log's samples, shape (n, T, K); the first sample is the start pose.
        """
        size = self.chunk
        parts = [self._simulate_chunk(parameters[i : i + size]) for i in range(0, len(parameters), size)]
        return Response(np.concatenate([p.angle for p in parts]), np.concatenate([p.feasible for p in parts]))

    def _simulate_chunk(self, parameters: ArmParameters) -> Response:
        n, steps = len(parameters), self._settings.steps_per_sample
        population = self._room(n)
        balance = population.start(parameters, self._joints, self._pose)
        torque, angle = self._torque[:n], self._angle[:n]
        np.multiply(parameters.gain[:, None, self._joints], self._command, out=torque)
        torque += balance[:, None]
        if self._prescribed is not None:
            torque[:, :, self._prescribed.columns] = self._prescribed.torque
        feasible = population.roll(torque, angle)
        out = np.empty((n, 1 + angle.shape[1] // steps, len(self._outputs)))
        out[:, 0] = self._pose[self._outputs]
        out[:, 1:] = angle[:, steps - 1 :: steps, self._outputs]
        out[~feasible] = np.nan
        return Response(out, feasible)

    def _room(self, n: int) -> Population:
        """The population to step, with its buffers: made once, and again only for a larger one."""
        if self._population is None or self._population.size < n:
            self._population = Population(self._arm, n, self._settings.threads)
            if self._prescribed is not None:
                self._population.follow(self._prescribed)
            self._torque, self._angle = np.empty((2, n, *self._command.shape))
        return self._population

    def __getstate__(self) -> dict[str, Any]:
        """Leave threads and buffers behind when a simulation is sent to another process."""
        return self.__dict__ | {"_population": None, "_torque": None, "_angle": None}
