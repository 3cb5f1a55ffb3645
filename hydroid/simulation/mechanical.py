"""Stage 1: the hydraulics as a gain, tau = K u + tau0 on every driven joint (article section 3)."""

from typing import Any

import numpy as np

from hydroid.settings.simulation import SimulationSettings
from hydroid.simulation.population import Candidates, Population, Response, in_chunks
from hydroid.simulation.record import Record


class MechanicalSimulation:
    """Simulates candidates on one record by `Batch.rollout`.

    Args:
        record: the record.
        settings: threads.
    """

    def __init__(self, record: Record, settings: SimulationSettings) -> None:
        self.record, self._threads = record, settings.threads
        self._population: Population | None = None

    def simulate(self, candidates: Candidates) -> Response:
        """Simulate n candidates, whatever n is.

        Returns:
            Angles of the outputs at the log's samples, shape (n, T, K); the first sample is the start pose.
        """
        return in_chunks(self._simulate_chunk, candidates, self.record.chunk)

    def _simulate_chunk(self, candidates: Candidates) -> Response:
        record, n = self.record, len(candidates)
        population = self._room(n)
        balance = population.start(candidates.arm, record.joints, record.pose)
        torque, angle = self._torque[:n], self._angle[:n]
        np.multiply(candidates.arm.gain[:, None, record.joints], record.command, out=torque)
        torque += balance[:, None]
        if record.prescribed is not None:
            torque[:, :, record.prescribed.columns] = record.prescribed.torque
        feasible = population.roll(torque, angle)
        out = record.sampled(angle[:, :, record.outputs])
        out[~feasible] = np.nan
        return Response(out, feasible)

    def _room(self, n: int) -> Population:
        """The population to step, with its buffers: made once, and again only for a larger one."""
        if self._population is None or self._population.size < n:
            self._population = Population(self.record.arm, n, self._threads, self.record.prescribed)
            self._torque, self._angle = np.empty((2, n, *self.record.command.shape))
        return self._population

    def __getstate__(self) -> dict[str, Any]:
        """Leave threads and buffers behind when a simulation is sent to another process."""
        return self.__dict__ | {"_population": None, "_torque": None, "_angle": None}
