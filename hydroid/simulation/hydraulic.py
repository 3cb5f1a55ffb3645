"""Stage 2: the whole chain from command to torque on every active joint, stepped beside MuJoCo.

The actuators look ahead over each MuJoCo step and hand it a torque and an armature (`hydroid.hydraulics`).
Each candidate is rolled out by compiled code alone (`hydroid.simulation.rollout`), as many at a time as there
are threads; candidates are independent, and no thread count changes a bit.
"""

import os
from collections import deque
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from hydroid.arm.locked import LockedArm
from hydroid.hydraulics.actuator import Actuator, ActuatorState, Observation, swallowed
from hydroid.hydraulics.records import JOINT_STATE, Records, coefficients, has_force_curve, linkages
from hydroid.mjcf import quiet_mujoco
from hydroid.settings.arm import Arm
from hydroid.settings.hydraulics import HydraulicSettings
from hydroid.simulation.rollout import HydraulicArm, compile_rollout
from hydroid.simulation.scenario import Array, Candidates, Response, Scenario
from hydroid.simulation.sensor import reading

STOP_REACH = np.radians(1.0)
"""how near an end of its range a joint must start to rest on its stop"""


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


@dataclass(frozen=True)
class _Start:
    """Candidates at the start of a log: what they change in the model, and their actuators.

    taken: flow from the pump into the joints that follow the log [m³/s], shape (n, steps); or (n, 0).
    """

    values: dict[str, Array]
    actuator: Actuator
    state: ActuatorState
    taken: Array


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
        self._range = np.array([arm.lower, arm.upper])[:, self.joints]
        self._moves = arm, everyone, [j for j in everyone if active[j]]
        self._entries = mass_entries(locked.model)[np.ix_(self.columns, self.columns)]
        self._period, self._settings = locked.model.opt.timestep, settings

    def start(
        self, candidates: Candidates, pose: Array, balance: Array, pressure: Array | None = None
    ) -> tuple[Actuator, ActuatorState]:
        """Return the actuators of n candidates, with a force-stroke curve each, and their state at rest.

        `pose` is the moving joints' [rad], shape (V,); `balance` holds them there [N·m], shape (n, V).
        Chamber pressures measured there [Pa], shape (V, 2), NaN where there are none, are taken by
        candidates that have no start pressure of their own.
        """
        assert candidates.actuators is not None
        chosen: Records = candidates.actuators[:, self.joints]  # pyright: ignore[reportAssignmentType]
        away = np.min(abs(self._range - pose[self.columns]), axis=0) > STOP_REACH
        chosen.trapped_pressure[:, away] = np.inf
        if pressure is not None:
            trapped, level = pressure[self.columns].T
            asked = np.isinf(chosen.start_pressure) & np.isfinite(pressure[self.columns]).all(axis=1)
            rests = asked & np.isfinite(chosen.trapped_pressure)
            chosen["trapped_pressure"] = np.where(rests, trapped, chosen.trapped_pressure)
            chosen["start_pressure"] = np.where(asked, level, chosen.start_pressure)
        damping = candidates.damping[:, self.joints]
        moved = linkages(*self._moves, chosen)
        actuator = Actuator(chosen, moved, damping, self._period, self._settings, self._entries)
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


class HydraulicSimulation:
    """Simulates candidates on one log with their actuators.

    Args:
        scenario: what is simulated; its active joints have hydraulics.
        arm: the arm's settings, for the cylinders' triangles.
        hydraulics: settings of the chain.
        pressures: active joints whose chamber pressures are wanted in the response, 0-based.
    """

    def __init__(
        self,
        scenario: Scenario,
        arm: Arm,
        hydraulics: HydraulicSettings,
        pressures: Sequence[int] = (),
    ) -> None:
        compile_rollout()
        self.scenario, self._steps = scenario, scenario.settings.steps_per_sample
        self._measured = scenario.arm.columns[scenario.outputs]
        self._period = self._steps * scenario.arm.model.opt.timestep
        self._threads = scenario.settings.threads or os.cpu_count() or 1
        prescribed = scenario.prescribed
        self._follows = np.array([], np.intp) if prescribed is None else prescribed.columns
        self._arm_settings = arm
        self._actuators = ArmActuators(arm, scenario.arm, scenario.active, hydraulics, self._follows)
        self._pressures = np.searchsorted(self._actuators.joints, np.array(pressures, int))
        self._command = np.ascontiguousarray(scenario.command[:, self._actuators.columns])
        none = np.empty((len(self._command), 0))
        self._servo = none if prescribed is None else np.ascontiguousarray(prescribed.torque)

    def simulate(self, candidates: Candidates) -> Response:
        """Simulate n candidates, whatever n is.

        Returns:
            What the outputs' sensors read, and the pressures asked for, at the log's samples; the first is
            the start. A candidate without a force-stroke curve, or that diverged, is infeasible.
        """
        return self.scenario.in_chunks(self._simulate_chunk, candidates)

    def trace(self, candidates: Candidates) -> Trace:
        """Simulate one candidate and keep what its actuators did."""
        arm = self._arm()
        with quiet_mujoco():
            _, seen = self._follow(arm, self._start(candidates, arm), 0, observe=True)
        assert seen is not None
        return Trace(self._actuators.joints + 1, seen.pressure, seen.flow, seen.spool, seen.force)

    def _simulate_chunk(self, candidates: Candidates) -> Response:
        assert candidates.actuators is not None
        actuators, n = candidates.actuators, len(candidates)
        samples = 1 + len(self._command) // self._steps
        angle = np.full((n, samples, len(self.scenario.outputs)), np.nan)
        pressure = np.full((n, samples, len(self._pressures), 2), np.nan) if self._pressures.size else None
        exists = np.flatnonzero(has_force_curve(candidates.actuators))
        if not exists.size:
            return Response(angle, np.zeros(n, dtype=bool), pressure)
        threads = min(self._threads, exists.size)
        free = deque(self._arm() for _ in range(threads))

        def simulate(row: int) -> None:
            arm = free.pop()
            followed, seen = self._follow(arm, start, row, observe=pressure is not None)
            if arm.healthy:
                sensors = actuators[exists[row], self._measured]
                angle[exists[row]] = reading(followed[:, self.scenario.outputs], sensors, self._period)
                if pressure is not None and seen is not None:
                    pressure[exists[row]] = seen.pressure[:, self._pressures]
            free.append(arm)

        with quiet_mujoco(), ThreadPoolExecutor(threads) as pool:
            start = self._start(candidates[exists], free[0])
            deque(pool.map(simulate, range(exists.size)), maxlen=0)
        feasible: NDArray[np.bool_] = np.all(np.isfinite(angle), axis=(1, 2))
        return Response(angle, feasible, pressure)

    def _arm(self) -> HydraulicArm:
        return HydraulicArm(self.scenario.arm.model, self._actuators.columns, self._follows, self._steps)

    def _start(self, candidates: Candidates, arm: HydraulicArm) -> _Start:
        """Balance all candidates, one after another, on one arm."""
        values, pose = self.scenario.values(candidates), self.scenario.arm.pose
        balance = np.array([arm.start(values, row, pose) for row in range(len(candidates))])
        started = self._actuators.start(candidates, pose, balance, self.scenario.pressure)
        return _Start(values, *started, self._taken(candidates))

    def _taken(self, candidates: Candidates) -> Array:
        """What the joints that follow the log take from the pump [m³/s], shape (n, steps)."""
        prescribed, actuators = self.scenario.prescribed, candidates.actuators
        assert actuators is not None
        if prescribed is None or np.isinf(actuators.pump_flow).all():
            return np.empty((len(candidates), 0))
        joints = [int(j) for j in self.scenario.arm.columns[prescribed.columns]]
        with_actuator = [j for j in joints if self._arm_settings.joints[j].actuator is not None]
        chosen: Records = actuators[:, joints]  # pyright: ignore[reportAssignmentType]
        c = coefficients(chosen, linkages(self._arm_settings, joints, with_actuator, chosen))
        return swallowed(c[:, None], prescribed.angle, prescribed.velocity).sum(axis=2)

    def _follow(
        self, arm: HydraulicArm, start: _Start, row: int, *, observe: bool
    ) -> tuple[Array, Observation | None]:
        """Simulate one candidate under the log's commands.

        Returns:
            Angles of the moving joints [rad], shape (1 + T, V), and what can be measured on the actuators,
            samples in the place of candidates: at the start and after each sample.
        """
        samples, pose = len(self._command) // self._steps, self.scenario.arm.pose
        arm.start(start.values, row, pose)
        angle = np.full((1 + samples, len(pose)), np.nan)
        state = start.state.joints[row]
        seen = np.zeros((1 + samples if observe else 1, len(state)), JOINT_STATE)
        angle[0], seen[0] = pose, state
        commands = np.concatenate([start.state.commands[1:], self._command])
        arm.attach(start.actuator, state, row)
        arm.roll(commands, angle[1:], seen[1:], self._servo, start.taken[row])
        if not observe:
            return angle, None
        states, one = ActuatorState(seen, commands), slice(row, row + 1)
        return angle, start.actuator.observe(states, angle[:, self._actuators.columns], one)
