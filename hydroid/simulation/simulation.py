"""One log simulated for populations of candidates.

Stage 1 takes the hydraulics for a gain, tau = K u + tau0 on every driven joint (article
section 3), stage 2 steps the whole chain from command to torque on every active joint
(`hydroid.simulation.scenario`). Every candidate starts at rest in the log's first pose,
in static balance with gravity: its springs are slack there, and its oil, or in stage 1
a constant torque tau0 = g(q0), holds it. Each is rolled out by compiled code, as many
at a time as there are threads; candidates are independent, and no number of threads
changes a bit.
"""

import os
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from scipy.signal import lfilter

from hydroid.arm.locked import repeat
from hydroid.arrays import Array, Index, Structs
from hydroid.hydraulics.actuator import pressures
from hydroid.hydraulics.records import JOINT_STATE, has_force_curve
from hydroid.mjcf import quiet_mujoco
from hydroid.simulation.openings import valve_openings
from hydroid.simulation.quasi_static import roll_quasi_static
from hydroid.simulation.rollout import Course, Record, SteppedArm, compile_rollout, roll
from hydroid.simulation.scenario import Candidates, Chain, Response, Scenario, distinct

Follow = Callable[[SteppedArm, Index], tuple[Array, Array | None]]
"""simulates some of n candidates, one for each copy of an arm: angles of the moving
joints [rad], (1 + T, copies, V), and the chamber pressures of a single one [Pa], (1 +
T, J, 2), where they are wanted"""
TOGETHER = 56
"""joints of all arms stepped at once: MuJoCo computes with sparse matrices from 60"""


class Simulation:
    """Simulates candidates on one log; in stage 2 the scenario's active joints have
    hydraulics.

    Args:
        substeps: of valves and oil in one MuJoCo step; None: stage 1, without
            hydraulics.
        pressures: active joints whose chamber pressures are wanted in the response,
            0-based.

    Attributes:
        joints: those with hydraulics, and those they couple with, among the arm's,
            0-based.
    """

    def __init__(
        self, scenario: Scenario, substeps: int | None, pressures: Sequence[int] = ()
    ) -> None:
        compile_rollout()
        self.scenario = scenario
        self._quasi_static = bool(substeps) and scenario.settings.model != "dynamic"
        pushed = (
            scenario.prescribed.columns
            if substeps
            else np.arange(len(scenario.arm.columns))
        )
        self._chain = Chain(
            scenario.machine, scenario.arm, scenario.active, substeps or 1, pushed
        )
        self.joints = self._chain.joints
        self._pressures = np.searchsorted(self.joints, np.array(pressures, int))

    def simulate(self, candidates: Candidates) -> Response:
        """Return what n candidates' sensors read, and the pressures asked for, at the
        log's samples.

        The first is the start. One without a force-stroke curve, or that diverged, has
        NaN throughout.
        """
        scenario, n, wanted = self.scenario, len(candidates), self._pressures
        samples = 1 + len(scenario.command) // scenario.settings.steps
        angle = np.full((n, samples, len(scenario.outputs)), np.nan)
        pressure = np.full((n, samples, len(wanted), 2), np.nan)
        # those that differ in effects of other groups of logs are simulated once
        first, place = distinct(candidates.joints, candidates.mass)
        exists = has_force_curve(candidates.joints[:, self.joints])
        rows = np.intersect1d(np.flatnonzero(exists), first)
        threads = min(scenario.settings.threads or os.cpu_count() or 1, rows.size)
        if not threads:
            return Response(angle, pressure)
        candidates = candidates[rows]
        sensors = candidates.joints[:, scenario.arm.columns[scenario.outputs]]

        def simulate(some: Index) -> None:
            arm = free.pop()
            followed, chambers = follow(arm, np.resize(some, arm.copies))
            if arm.healthy:
                for place, seen in zip(
                    some, followed[:, :, scenario.outputs].swapaxes(0, 1), strict=False
                ):
                    read = (
                        reading(seen, sensors[place], scenario.period)
                        if self.joints.size
                        else seen
                    )
                    angle[rows[place]] = read
                if chambers is not None:
                    pressure[rows[some[0]]] = chambers[:, wanted]
            free.append(arm)

        with quiet_mujoco(), ThreadPoolExecutor(threads) as pool:
            copies = self._copies(candidates, threads)
            free = deque(self._stepped(copies) for _ in range(threads))
            follow = self._follower(candidates, free[0], pool.map)
            deque(
                pool.map(
                    simulate, np.array_split(range(rows.size), -(-rows.size // copies))
                ),
                maxlen=0,
            )
            if copies > 1:  # one that diverges stops those beside it
                free = deque(self._stepped() for _ in range(threads))
                left = np.flatnonzero(np.isnan(angle[rows, -1]).any(axis=1))
                deque(pool.map(simulate, left[:, None]), maxlen=0)
        if len(first) < n:
            angle, pressure = angle[first[place]], pressure[first[place]]
        return Response(angle, pressure)

    def _copies(self, candidates: Candidates, threads: int) -> int:
        """How many arms can be stepped at once without changing a bit of any.

        Actuators need an arm of their own; MuJoCo integrates one without any damping
        otherwise.
        """
        damped = (
            (self.scenario.values(candidates)["dof_damping"] > 0.0).any(axis=1).all()
        )
        if self.joints.size or not damped:
            return 1
        most, n = TOGETHER // len(self.scenario.arm.columns), len(candidates)
        return -(-n // max(threads, -(-n // most)))

    def _stepped(self, copies: int = 1) -> SteppedArm:
        scenario, chain = self.scenario, self._chain
        steps, model = scenario.settings.steps, scenario.arm.model
        rollout = roll_quasi_static if self._quasi_static else roll
        model = repeat(model, copies) if copies > 1 else model
        return SteppedArm(model, chain.columns, steps, rollout, copies)

    def _follower(
        self,
        candidates: Candidates,
        arm: SteppedArm,
        run: Callable[..., Iterable[None]],
    ) -> Follow:
        """Return what simulates some of n candidates; all are balanced here, one by
        one, on one arm.

        `run` is that of a pool.
        """
        scenario, chain, n, observed = (
            self.scenario,
            self._chain,
            len(candidates),
            self._pressures.size,
        )
        values, pose, servo = (
            scenario.values(candidates),
            scenario.arm.pose,
            scenario.prescribed,
        )
        samples = len(scenario.command) // scenario.settings.steps
        starts = [
            np.resize(range(first, n), arm.copies) for first in range(0, n, arm.copies)
        ]
        balance = np.concatenate(
            [arm.start(values, some, np.tile(pose, arm.copies)) for some in starts]
        )
        balance = balance.reshape(-1, len(pose))[:n]
        plugin, states = chain.start(candidates, pose, balance, scenario.pressure)
        before = np.zeros((plugin.past, len(chain.columns)))
        commands = np.concatenate([before, scenario.command[:, chain.columns]])
        taken, openings = chain.taken(candidates, servo), [np.empty((0, 0))] * n
        # what the valves do is seen in their states alone
        if self._quasi_static and not observed:
            openings = valve_openings(plugin, states, commands, run)
        gain = candidates.joints.gain[:, scenario.arm.columns[chain.pushed]]
        served = np.searchsorted(chain.pushed, servo.columns)

        def follow(arm: SteppedArm, some: Index) -> tuple[Array, Array | None]:
            start, row = np.tile(pose, arm.copies), some[0]
            arm.start(values, some, start)
            torque = (
                gain[some] * scenario.command[:, None, chain.pushed]
                + balance[some][:, chain.pushed]
            )
            if served.size:
                torque[:, :, served] = (
                    servo.angle if self._quasi_static else servo.torque
                )[:, None]
            one, state = plugin.candidate(row), states[row]
            angle = np.full((1 + samples, start.size), np.nan)
            record = np.zeros((1 + samples if observed else 1, len(state)), JOINT_STATE)
            angle[0], record[0] = start, state
            course = Course(
                commands, torque.reshape(len(torque), -1), taken[row], openings[row]
            )
            arm.roll(one, state, course, Record(angle[1:], record[1:]))
            seen = (
                pressures(one.coefficients, record, angle[:, chain.columns])
                if observed
                else None
            )
            return angle.reshape(len(angle), arm.copies, -1), seen

        return follow


def reading(angle: Array, sensors: Structs, period: float) -> Array:
    """Return what the sensors of K joints read, shape (T, K) like their angles [rad],
    `period` [s] apart.

    That is the turn since the start times a scale, with a first-order lag (ours).
    Between samples an angle is taken for a straight line. A reading starts at the
    angle, at rest. With scale 1 and no lag it is the angle, to the bit.
    """
    scale, lag = sensors["sensor_scale"], sensors["sensor_lag"]
    if np.all(scale == 1.0) and np.all(lag == 0.0):
        return angle
    turned = scale * (angle - angle[0])
    for k in np.flatnonzero(lag):
        left = np.exp(-period / lag[k])
        mean = (1.0 - left) * lag[k] / period
        turned[:, k] = lfilter([1.0 - mean, mean - left], [1.0, -left], turned[:, k])
    return angle[0] + turned
