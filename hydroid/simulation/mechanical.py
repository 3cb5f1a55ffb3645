"""Stage 1: the hydraulics as a gain, tau = K u + tau0 on every driven joint (article section 3).

The whole population is stepped by `mujoco.batch`. Every candidate starts at rest in the log's first pose, in
static balance with gravity: its springs are slack there, and a constant torque tau0 = g(q0), computed for
each candidate, holds it.
"""

from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError
from numpy.typing import NDArray

from hydroid.mjcf import quiet_mujoco
from hydroid.simulation.scenario import Array, Candidates, Response, Scenario


class MechanicalSimulation:
    """Simulates candidates on one log by `Batch.rollout`."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self._batch: ArmBatch | None = None

    def simulate(self, candidates: Candidates) -> Response:
        """Simulate n candidates, whatever n is.

        Returns:
            Angles of the outputs at the log's samples, shape (n, T, K); the first sample is the start pose.
        """
        return self.scenario.in_chunks(self._simulate_chunk, candidates)

    def _simulate_chunk(self, candidates: Candidates) -> Response:
        scenario, n = self.scenario, len(candidates)
        if self._batch is None or self._batch.size < n:  # made once, and again only for more candidates
            self._batch = ArmBatch(scenario.arm.model, n, scenario.settings.threads)
            self._torque, self._angle = np.empty((2, n, *scenario.command.shape))
        balance = self._batch.start(scenario.values(candidates), scenario.arm.pose)
        torque, angle = self._torque[:n], self._angle[:n]
        np.multiply(candidates.gain[:, None, scenario.arm.columns], scenario.command, out=torque)
        torque += balance[:, None]
        if scenario.prescribed is not None:
            torque[:, :, scenario.prescribed.columns] = scenario.prescribed.torque
        feasible = self._batch.roll(torque, angle)
        steps, outputs = scenario.settings.steps_per_sample, scenario.outputs
        out = np.empty((n, 1 + len(scenario.command) // steps, len(outputs)))
        out[:, 0] = scenario.arm.pose[outputs]
        out[:, 1:] = angle[:, steps - 1 :: steps, outputs]
        out[~feasible] = np.nan
        return Response(out, feasible)

    def __getstate__(self) -> dict[str, Any]:
        """Leave threads and buffers behind when a simulation is sent to another process."""
        return self.__dict__ | {"_batch": None, "_torque": None, "_angle": None}


class ArmBatch:
    """Up to `size` candidates of one arm, stepped together on some threads, 0: one per core."""

    def __init__(self, model: mujoco.MjModel, size: int, threads: int) -> None:
        self.size = size
        self._batch = Batch(model, nsim=size, nthread=threads)
        self._failed = np.zeros(size, dtype=bool)
        # before the first call: a derived field bound between calls reads zero
        self._bias = self._batch.bind("qfrc_bias")
        self._position, self._velocity = self._batch.bind("qpos"), self._batch.bind("qvel")
        self._applied = self._batch.bind("qfrc_applied")
        self._expanded: dict[str, Array] = {}

    def start(self, values: dict[str, Array], pose: Array) -> Array:
        """Put n <= size candidates into `pose` [rad], shape (V,), at rest.

        `values` is what they change in the model, as `Scenario.values` returns it.

        Returns:
            What holds them there, tau0 = g(q0) of equation (1) [N·m], shape (n, V).
        """
        n = len(values["body_mass"])
        ids = np.arange(n)
        for name, value in values.items():
            if name not in self._expanded:
                self._expanded[name] = self._batch.expand(name)
            self._expanded[name][:n] = value
        with quiet_mujoco():
            self._batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE.value)
            self._batch.set_const(ids)
            self._position[:n] = pose
            self._applied[:n] = 0.0
            self._batch.forward(ids, stage=mujoco.mjtStage.mjSTAGE_VEL.value)
        self._batch.warning[:n], self._failed[:n] = 0, False
        return self._bias[:n].copy()

    def roll(self, torque: Array, out: Array) -> NDArray[np.bool_]:
        """Step candidates from their start under the given joint torques.

        Args:
            torque: applied at each step [N·m], shape (n, steps, V), C-contiguous.
            out: receives the angles after each step [rad], shape (n, steps, V).

        Returns:
            Which candidates stayed finite and drew no warning of MuJoCo's, shape (n,).
        """
        n, steps, _ = torque.shape
        spec = mujoco.mjtState.mjSTATE_QFRC_APPLIED.value
        with quiet_mujoco():
            try:
                self._batch.rollout(steps, torque, spec, ("qpos",), np.arange(n), {"qpos": out})
            except SimulationError as error:
                self._failed[error.ids] = True
        # a candidate whose warnings rose stopped there; what it recorded after that is no simulation
        finite = np.isfinite([self._position, self._velocity]).all(axis=(0, 2)) & ~self._failed
        healthy = finite & ~self._batch.warning[:, :, 1].any(axis=1)
        return healthy[:n] & np.isfinite(out[:, -1]).all(axis=-1)
