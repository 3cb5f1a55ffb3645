"""One log simulated for populations of candidates.

Stage 1 takes the hydraulics for a gain, tau = K u + tau0 on every driven joint (article section 3), stage 2
steps the whole chain from command to torque on every active joint (`hydroid.simulation.chain`). Every
candidate starts at rest in the log's first pose, in static balance with gravity: its springs are slack there,
and its oil, or in stage 1 a constant torque tau0 = g(q0), holds it. Each is rolled out by compiled code, as
many at a time as there are threads; candidates are independent, and no number of threads changes a bit.
"""

import os
from collections import deque
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydroid.hydraulics.actuator import Observation, observe
from hydroid.hydraulics.kernel import Plugin
from hydroid.hydraulics.records import JOINT_STATE, Array, has_force_curve
from hydroid.mjcf import quiet_mujoco
from hydroid.settings.arm import Arm
from hydroid.simulation.chain import Chain
from hydroid.simulation.rollout import NO_ACTUATORS, NO_JOINTS, Course, Record, SteppedArm, compile_rollout
from hydroid.simulation.scenario import Candidates, Response, Scenario
from hydroid.simulation.sensor import reading


@dataclass(frozen=True)
class _Start:
    """Candidates at the start of a log: what they change in the model, and their actuators, if any."""

    candidates: Candidates
    values: dict[str, Array]
    plugin: Plugin
    state: NDArray[np.void]
    taken: Array


class Simulation:
    """Simulates candidates on one log.

    Args:
        scenario: what is simulated; in stage 2 its active joints have hydraulics.
        arm: the arm's settings, for its linkages.
        substeps: of valves and oil in one MuJoCo step; None: stage 1, without hydraulics.
        pressures: active joints whose chamber pressures are wanted in the response, 0-based.

    Attributes:
        joints: those that a trace describes, among the arm's, 0-based.
    """

    def __init__(
        self, scenario: Scenario, arm: Arm, substeps: int | None, pressures: Sequence[int] = ()
    ) -> None:
        compile_rollout()
        self.scenario, self._steps = scenario, scenario.settings.steps_per_sample
        self._threads = scenario.settings.threads or os.cpu_count() or 1
        moving, prescribed = np.arange(len(scenario.arm.columns)), scenario.prescribed
        follows = NO_JOINTS if prescribed is None else prescribed.columns
        self._chain = (
            None if substeps is None else Chain(arm, scenario.arm, scenario.active, substeps, follows)
        )
        self._pushed = moving if self._chain is None else follows
        self._columns = np.setdiff1d(moving, self._pushed)
        self.joints = scenario.arm.columns[self._columns]
        self._pressures = np.searchsorted(self.joints, np.array(pressures, int))
        self._command = np.ascontiguousarray(scenario.command[:, self._columns])
        self._servo = np.empty((len(self._command), 0))
        if prescribed is not None:
            self._servo = np.ascontiguousarray(prescribed.torque)

    def simulate(self, candidates: Candidates) -> Response:
        """Simulate n candidates, whatever n is.

        Returns:
            What the outputs' sensors read, and the pressures asked for, at the log's samples; the first is
            the start. A candidate without a force-stroke curve, or that diverged, is infeasible.
        """
        scenario, n = self.scenario, len(candidates)
        samples = 1 + len(scenario.command) // self._steps
        angle = np.full((n, samples, len(scenario.outputs)), np.nan)
        pressure = np.full((n, samples, len(self._pressures), 2), np.nan) if self._pressures.size else None
        exists = np.ones(n, bool) if self._chain is None else has_force_curve(candidates.joints)
        rows = np.flatnonzero(exists)
        threads = min(self._threads, rows.size)
        if not threads:
            return Response(angle, exists, pressure)
        sensors = candidates.joints[:, scenario.arm.columns[scenario.outputs]]
        period = self._steps * scenario.arm.model.opt.timestep

        def simulate(place: int) -> None:
            arm, row = free.pop(), rows[place]
            followed, states = self._follow(arm, start, place, observed=pressure is not None)
            if arm.healthy:
                seen = followed[:, scenario.outputs]
                angle[row] = seen if self._chain is None else reading(seen, sensors[row], period)
                if pressure is not None:
                    pressure[row] = self._observe(start, place, followed, states).pressure[:, self._pressures]
            free.append(arm)

        with quiet_mujoco(), ThreadPoolExecutor(threads) as pool:
            free = deque(self._stepped() for _ in range(threads))
            start = self._start(candidates[rows], free[0])
            deque(pool.map(simulate, range(rows.size)), maxlen=0)
        feasible: NDArray[np.bool_] = np.all(np.isfinite(angle), axis=(1, 2))
        return Response(angle, feasible, pressure)

    def trace(self, candidates: Candidates) -> Observation:
        """Simulate one candidate; return what its actuators did, at T samples, shape (T, J) or (T, J, 2)."""
        arm = self._stepped()
        with quiet_mujoco():
            start = self._start(candidates, arm)
            followed, states = self._follow(arm, start, 0, observed=True)
        return self._observe(start, 0, followed, states)

    def _stepped(self) -> SteppedArm:
        return SteppedArm(self.scenario.arm.model, self._columns, self._pushed, self._steps)

    def _start(self, candidates: Candidates, arm: SteppedArm) -> _Start:
        """Balance all candidates, one after another, on one arm."""
        scenario, n = self.scenario, len(candidates)
        values, pose, prescribed = scenario.values(candidates), scenario.arm.pose, scenario.prescribed
        if self._chain is None:
            return _Start(candidates, values, NO_ACTUATORS, np.empty((n, 0), JOINT_STATE), np.empty((n, 0)))
        balance = np.array([arm.start(values, row, pose) for row in range(n)]).reshape(n, len(pose))
        plugin, state = self._chain.start(candidates, pose, balance, scenario.pressure)
        taken = np.empty((n, 0))
        if prescribed is not None:
            taken = self._chain.taken(candidates, prescribed.angle, prescribed.velocity)
        return _Start(candidates, values, plugin, state, taken)

    def _follow(
        self, arm: SteppedArm, start: _Start, row: int, *, observed: bool
    ) -> tuple[Array, NDArray[np.void]]:
        """Simulate one candidate under the log's commands.

        Returns:
            At the start and after each sample: angles of the moving joints [rad], shape (1 + T, V), and where
            they are `observed` states of the actuators, shape (1 + T, J).
        """
        scenario, state = self.scenario, start.state[row]
        pose, samples = scenario.arm.pose, len(scenario.command) // self._steps
        balance = arm.start(start.values, row, pose)
        if self._chain is None:
            torque = start.candidates.joints.gain[row, scenario.arm.columns] * scenario.command + balance
            if scenario.prescribed is not None:
                torque[:, scenario.prescribed.columns] = self._servo
            plugin, commands = NO_ACTUATORS, self._command
        else:
            plugin, torque = start.plugin.of(row), self._servo
            commands = np.concatenate([np.zeros((plugin.past, len(state))), self._command])
        angle = np.full((1 + samples, len(pose)), np.nan)
        states = np.zeros((1 + samples if observed else 1, len(state)), JOINT_STATE)
        angle[0], states[0] = pose, state
        course = Course(commands, torque, start.taken[row])
        arm.roll(plugin, state, course, Record(angle[1:], states[1:]))
        return angle, states

    def _observe(self, start: _Start, row: int, angle: Array, states: NDArray[np.void]) -> Observation:
        return observe(start.plugin.coefficients[row], states, angle[:, self._columns])
