"""Stage 2: the whole chain from command to torque on every active joint, stepped beside MuJoCo.

The actuators look ahead over each MuJoCo step and hand it a torque and an armature (`hydroid.hydraulics`).
Each candidate is rolled out by compiled code alone (`hydroid.simulation.rollout`), as many at a time as there
are threads; candidates are independent, and no thread count changes a bit.
"""

import logging
import os
from collections import deque
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from hydroid.hydraulics.actuator import Actuator
from hydroid.hydraulics.records import has_force_curve, linkages
from hydroid.settings.arm import Arm
from hydroid.settings.hydraulics import HydraulicSettings
from hydroid.settings.simulation import SimulationSettings
from hydroid.simulation.population import Array, Candidates, Population, Response, in_chunks, quiet_mujoco
from hydroid.simulation.record import Record
from hydroid.simulation.rollout import Machine, compile_rollout
from hydroid.simulation.run import HydraulicRun, Start

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Trace:
    """What one candidate's actuators did at the log's samples; J active joints.

    joints: 1-based numbers, (J,). pressure [Pa] and flow [m³/s]: chambers A, B, shape (T, J, 2).
    spool [m], force [N]: shape (T, J).
    """

    joints: NDArray[np.intp]
    pressure: Array
    flow: Array
    spool: Array
    force: Array


class HydraulicSimulation:
    """Simulates candidates on one record with their actuators.

    Args:
        record: the record; its active joints have hydraulics.
        arm: the arm's settings, for the cylinders' triangles.
        hydraulics: settings of the chain.
        settings: threads.
        pressures: active joints whose chamber pressures are wanted in the response, 0-based.

    Attributes:
        joints: those with actuators and those they couple with, 0-based among the arm's, shape (J,).
        command: held during each step [%], shape (steps, J).
    """

    def __init__(
        self,
        record: Record,
        arm: Arm,
        hydraulics: HydraulicSettings,
        settings: SimulationSettings,
        pressures: Sequence[int] = (),
    ) -> None:
        compile_rollout(lambda: _log.warning("compiling the actuator's kernels, once on this machine ..."))
        self.record, self._hydraulics = record, hydraulics
        self._threads = settings.threads or os.cpu_count() or 1
        self._steps = settings.steps_per_sample
        prescribed = np.array([], int) if record.prescribed is None else record.prescribed.columns
        # joints that follow the log keep their servo; all others couple through their inertia and belong in
        self._columns = np.setdiff1d(np.arange(len(record.joints)), prescribed)
        self.joints = record.joints[self._columns]
        self._pressures = np.searchsorted(self.joints, np.array(pressures, int))
        driven = [int(j) for j in self.joints if record.active[j]]
        self._linkages = linkages(arm, [int(j) for j in self.joints], driven)
        self._entries = mass_entries(record.arm.model)[np.ix_(self._columns, self._columns)]
        self.command = np.ascontiguousarray(record.command[:, self._columns])
        none = np.empty((len(self.command), 0))
        self._servo = none if record.prescribed is None else np.ascontiguousarray(record.prescribed.torque)

    def simulate(self, candidates: Candidates) -> Response:
        """Simulate n candidates, whatever n is.

        Returns:
            Angles of the outputs, and the pressures asked for, at the log's samples; the first is the start.
            A candidate without a force-stroke curve, or that diverged, is infeasible.
        """
        return in_chunks(self._simulate_chunk, candidates, self.record.chunk)

    def trace(self, candidates: Candidates) -> Trace:
        """Simulate one candidate and keep what its actuators did."""
        run = self.begin(candidates)
        with quiet_mujoco():
            _, seen = run.follow(self.command, self._steps, observe=True)
        assert seen is not None
        return Trace(self.joints + 1, seen.pressure, seen.flow, seen.spool, seen.force)

    def begin(self, candidates: Candidates) -> HydraulicRun:
        """Put one feasible candidate at the start of the record, to be stepped as one likes."""
        return HydraulicRun(self._start(candidates), 0, self._machine())

    def _simulate_chunk(self, candidates: Candidates) -> Response:
        assert candidates.actuators is not None
        n, samples = len(candidates), 1 + len(self.command) // self._steps
        angle = np.full((n, samples, len(self.record.outputs)), np.nan)
        pressure = np.full((n, samples, len(self._pressures), 2), np.nan) if self._pressures.size else None
        exists = np.flatnonzero(has_force_curve(candidates.actuators))
        if exists.size:
            start, threads = self._start(candidates[exists]), min(self._threads, exists.size)
            free = deque(self._machine() for _ in range(threads))

            def simulate(candidate: int) -> None:
                machine = free.pop()
                run = HydraulicRun(start, candidate, machine)
                followed, seen = run.follow(self.command, self._steps, observe=pressure is not None)
                if run.healthy:
                    angle[exists[candidate]] = followed[:, self.record.outputs]
                    if pressure is not None and seen is not None:
                        pressure[exists[candidate]] = seen.pressure[:, self._pressures]
                free.append(machine)

            with quiet_mujoco(), ThreadPoolExecutor(threads) as pool:
                deque(pool.map(simulate, range(exists.size)), maxlen=0)
        feasible: NDArray[np.bool_] = np.all(np.isfinite(angle), axis=(1, 2))
        return Response(angle, feasible, pressure)

    def _start(self, candidates: Candidates) -> Start:
        assert candidates.actuators is not None
        record = self.record
        population = Population(record.arm, len(candidates), self._threads, record.prescribed)
        balance = population.start(candidates.arm, record.joints, record.pose)[:, self._columns]
        actuator = Actuator(
            candidates.actuators[:, self.joints],  # pyright: ignore[reportArgumentType]  # still a recarray
            self._linkages,
            candidates.arm.damping[:, self.joints],
            record.arm.model.opt.timestep,
            self._hydraulics,
            self._entries,
        )
        state = actuator.start(population.position[:, self._columns], balance)
        return Start(population, actuator, state, self._servo)

    def _machine(self) -> Machine:
        return Machine(self.record.arm.model, self._columns, self.record.prescribed)


def mass_entries(model: mujoco.MjModel) -> NDArray[np.intp]:
    """Where M[i, j] stands in a row of MuJoCo's sparse mass matrix, shape (V, V)."""
    entries = np.zeros((model.nv, model.nv), np.intp)
    for i in range(model.nv):
        for place in range(model.M_rowadr[i], model.M_rowadr[i] + model.M_rownnz[i]):
            j = model.M_colind[place]
            entries[i, j] = entries[j, i] = place
    return entries
