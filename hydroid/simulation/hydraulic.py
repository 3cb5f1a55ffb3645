"""Stage 2: the whole chain from command to torque on every active joint, stepped beside MuJoCo.

The actuators look ahead over each MuJoCo step and hand it a torque and an armature (`hydroid.hydraulics`).
Members are shared out among threads, each with its own batch and actuators, so that no thread waits for
another within the record; members are independent, and no thread count changes a bit.
"""

import logging
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields

import mujoco
import numpy as np
from numpy.typing import NDArray

from hydroid.hydraulics.actuator import Actuator, Observation, compile_kernels
from hydroid.hydraulics.parameters import ActuatorParameters, Linkages
from hydroid.settings.arm import Arm
from hydroid.settings.hydraulics import HydraulicSettings
from hydroid.settings.simulation import SimulationSettings
from hydroid.simulation.population import Array, Members, Population, Response, in_chunks, quiet_mujoco
from hydroid.simulation.record import Record

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Trace:
    """What one member's actuators did at the log's samples; J active joints.

    joints: 1-based numbers, (J,). pressure [Pa] and flow [m³/s]: chambers A, B, shape (T, J, 2).
    spool [m], force [N]: shape (T, J).
    """

    joints: NDArray[np.intp]
    pressure: Array
    flow: Array
    spool: Array
    force: Array


class HydraulicSimulation:
    """Simulates members on one record with their actuators.

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
        compile_kernels(lambda: _log.warning("compiling the actuator's kernels, once on this machine ..."))
        self.record, self._hydraulics = record, hydraulics
        self._threads = settings.threads or os.cpu_count() or 1
        self._steps = settings.steps_per_sample
        prescribed = np.array([], int) if record.prescribed is None else record.prescribed.columns
        # joints that follow the log keep their servo; all others couple through their inertia and belong in
        self._columns = np.setdiff1d(np.arange(len(record.joints)), prescribed)
        self.joints = record.joints[self._columns]
        self._pressures = np.searchsorted(self.joints, np.array(pressures, int))
        driven = [int(j) for j in self.joints if record.active[j]]
        self._linkages = Linkages.of(arm, [int(j) for j in self.joints], driven)
        self._entries = _entries(record.arm.model)[np.ix_(self._columns, self._columns)]
        self.command = np.ascontiguousarray(record.command[:, self._columns])

    def simulate(self, members: Members) -> Response:
        """Simulate n members, whatever n is.

        Returns:
            Angles of the outputs, and the pressures asked for, at the log's samples; the first is the start.
            A member without a force-stroke curve, or that diverged, is infeasible.
        """
        return in_chunks(self._simulate_chunk, members, self.record.chunk)

    def trace(self, members: Members) -> Trace:
        """Simulate one member and keep what its actuators did."""
        trace: list[tuple[Array, ...]] = []
        with quiet_mujoco():
            self._run(members, trace)
        pressure, flow, spool, force = (np.array(x)[:: self._steps] for x in zip(*trace, strict=True))
        return Trace(self.joints + 1, pressure, flow, spool, force)

    def _simulate_chunk(self, members: Members) -> Response:
        assert members.actuators is not None
        exists = members.actuators.feasible
        n, samples = len(members), 1 + len(self.command) // self._steps
        out = np.full((n, samples, len(self.record.outputs)), np.nan)
        pressure = np.full((n, samples, len(self._pressures), 2), np.nan) if self._pressures.size else None
        share = np.array_split(np.flatnonzero(exists), min(self._threads, max(int(exists.sum()), 1)))
        with quiet_mujoco(), ThreadPoolExecutor(len(share)) as pool:
            for rows, (angle, oil) in zip(
                share, pool.map(self._run, [members[rows] for rows in share]), strict=True
            ):
                out[rows] = angle
                if pressure is not None:
                    pressure[rows] = oil
        feasible: NDArray[np.bool_] = np.all(np.isfinite(out), axis=(1, 2))
        return Response(out, feasible, pressure)

    def begin(self, members: Members) -> "HydraulicRun":
        """Put n feasible members at the start of the record, to be stepped one by one."""
        population = Population(self.record.arm, len(members), 1, self.record.prescribed)
        balance = population.start(members.arm, self.record.joints, self.record.pose)[:, self._columns]
        assert members.actuators is not None
        actuator = Actuator(
            ActuatorParameters(
                **{
                    f.name: getattr(members.actuators, f.name)[:, self.joints]
                    for f in fields(ActuatorParameters)
                }
            ),
            self._linkages,
            members.arm.damping[:, self.joints],
            self.record.arm.model.opt.timestep,
            self._hydraulics,
            self._entries,
        )
        return HydraulicRun(self.record, self._columns, population, actuator, balance)

    def _run(self, members: Members, trace: list[tuple[Array, ...]] | None = None) -> tuple[Array, Array]:
        """Step n members over the record; outputs and pressures at its samples, NaN where one diverged."""
        outputs, steps = self.record.outputs, len(self.command)
        samples = 1 + steps // self._steps
        pressure = np.empty((len(members), samples, len(self._pressures), 2))
        if len(members) == 0:
            return np.empty((0, samples, len(outputs))), pressure
        run = self.begin(members)
        angle = np.empty((len(members), steps, len(outputs)))
        for k, command in enumerate(self.command):
            if trace is not None:
                trace.append(_first(run.observe()))
            if self._pressures.size and k % self._steps == 0:
                pressure[:, k // self._steps] = run.observe().pressure[:, self._pressures]
            run.step(command)
            angle[:, k] = run.position[:, outputs]
        if trace is not None:
            trace.append(_first(run.observe()))
        if self._pressures.size:
            pressure[:, -1] = run.observe().pressure[:, self._pressures]
        angle[~run.healthy], pressure[~run.healthy] = np.nan, np.nan
        return self.record.sampled(angle), pressure


class HydraulicRun:
    """Members on their way through a record: what one step is, wherever the commands come from.

    Args:
        record: the record.
        columns: joints with actuators among the moving ones, shape (J,).
        population: the n members, at the start.
        actuator: theirs.
        balance: what the actuators hold at the start [N·m], shape (n, J).

    Attributes:
        position: angles of the record's moving joints [rad], live, shape (n, V).
    """

    def __init__(
        self,
        record: Record,
        columns: NDArray[np.intp],
        population: Population,
        actuator: Actuator,
        balance: Array,
    ) -> None:
        self.position = population.position
        self._columns, self._population, self._actuator = columns, population, actuator
        self._own = record.arm.model.dof_armature[columns]
        self._prescribed, self._taken = record.prescribed, 0
        population.damping[:, columns] = 0.0  # the actuators integrate it, and look ahead with an armature
        self._state = actuator.start(self.position[:, columns], balance)

    def step(self, command: Array) -> None:
        """Step every member once under a command [%], shape (J,); call it within `quiet_mujoco`."""
        population, columns = self._population, self._columns
        torque, armature = self._actuator.advance(
            self._state,
            command,
            self.position[:, columns],
            population.velocity[:, columns],
            population.mass_matrix,
        )
        population.applied[:, columns], population.armature[:, columns] = torque, self._own + armature
        if self._prescribed is not None:
            population.applied[:, self._prescribed.columns] = self._prescribed.torque[self._taken]
        population.step()
        self.position[:, columns] = self._actuator.close(
            self._state, population.velocity[:, columns], population.mass_matrix
        )
        self._taken += 1

    def observe(self) -> Observation:
        """Return pressures, flows, spool and force now; joints in the order of the columns."""
        return self._actuator.observe(self._state, self.position[:, self._columns])

    @property
    def healthy(self) -> NDArray[np.bool_]:
        """Members that have not diverged, shape (n,)."""
        return self._population.healthy


def _first(seen: Observation) -> tuple[Array, ...]:
    return seen.pressure[0], seen.flow[0], seen.spool[0], seen.force[0]


def _entries(model: mujoco.MjModel) -> NDArray[np.intp]:
    """Where M[i, j] stands in a row of MuJoCo's sparse mass matrix, shape (V, V)."""
    entries = np.zeros((model.nv, model.nv), np.intp)
    for i in range(model.nv):
        for place in range(model.M_rowadr[i], model.M_rowadr[i] + model.M_rownnz[i]):
            j = model.M_colind[place]
            entries[i, j] = entries[j, i] = place
    return entries
