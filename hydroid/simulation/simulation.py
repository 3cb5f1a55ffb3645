"""One log simulated for populations of candidates.

Stage 1 takes the hydraulics for a gain, tau = K u + tau0 on every driven joint (article
section 3), stage 2 steps the whole chain from command to torque on every active joint
(`hydroid.simulation.scenario`). Every candidate starts in the log's first pose, at rest
or in motion, in static balance with gravity: its springs are slack there, and its oil,
or in stage 1 a constant torque tau0 = g(q0), holds it. Each is rolled out by compiled
code, as many at a time as there are threads; candidates are independent, and no number
of threads changes a bit.
"""

import math
import os
from collections import deque
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple

import mujoco
import numpy as np
from scipy.signal import lfilter

from hydroid.arm.locked import repeat
from hydroid.arm.model import add_payload
from hydroid.arrays import Array, Index, Structs, record
from hydroid.files import undisturbed
from hydroid.hydraulics.actuator import pressures
from hydroid.hydraulics.kernel import Plugin
from hydroid.hydraulics.records import JOINT_STATE, has_force_curve
from hydroid.log import Log
from hydroid.mjcf import quiet_mujoco
from hydroid.settings.fit import FitSettings
from hydroid.simulation.openings import HELD, Run, hold_valves, valve_openings
from hydroid.simulation.rollout import Course, SteppedArm, Trace, compile_rollout
from hydroid.simulation.scenario import Candidates, Chain, Response, Scenario, distinct


class Oil(NamedTuple):
    """What the oil of one candidate does at its samples.

    pressure: of chambers A and B [Pa], shape (1 + T, J, 2). flow: into them [m³/s], of
    the same shape. line: pressure of the pump's line [Pa], shape (1 + T,); NaN without
    a pump.
    """

    pressure: Array
    flow: Array
    line: Array


TOGETHER = 56
"""joints of all arms stepped at once: MuJoCo computes with sparse matrices from 60"""
OF_MOTION = ("dof_damping", "dof_frictionloss")
"""fields of mjModel that do nothing to an arm at rest"""


@record
class _Ready:
    """What the rollouts of n candidates need.

    Attributes:
        values: what they change in mjModel.
        balance: what holds them in the start pose [N·m], (n, V).
        gain: of the pushed joints [N·m/%], (n, P).
        sensors: of JOINT, of the outputs, (n, K).
        plugin: their actuators.
        states: of these at the start, (n, J) of JOINT_STATE.
        commands: those of a `Course`.
        others: what joints that follow the log do, as of a `Course`, (n, steps, 3).
        openings: of the valves, where they are known before, of each candidate.
    """

    values: dict[str, Array]
    balance: Array
    gain: Array
    sensors: Structs
    plugin: Plugin
    states: Structs
    commands: Array
    others: Array
    openings: list[Array]


class Simulation:
    """Simulates candidates on one log; but for stage 1 the scenario's active joints
    have hydraulics.

    Args:
        pressures: active joints whose pressures and flows are wanted in the response,
            0-based.

    Attributes:
        joints: those with hydraulics, and those they couple with, among the arm's,
            0-based.
    """

    def __init__(self, scenario: Scenario, pressures: Sequence[int] = ()) -> None:
        compile_rollout()
        self.scenario = scenario
        self._at_once = scenario.stepping.rung.at_once
        self._chain = Chain(
            scenario.machine, scenario.arm, scenario.roles, scenario.stepping
        )
        self.joints = self._chain.joints
        # single arms that former candidates left
        self._free = deque[SteppedArm]()
        # in the last balance: of what values, and the torques [N·m]
        self._held = (b"", np.empty((0, 0)))
        self._pressures = np.searchsorted(self.joints, np.array(pressures, int))

    def simulate(self, candidates: Candidates) -> Response:
        """Return what n candidates' sensors read, and the pressures and flows asked
        for, at the log's samples.

        The first is the start. One without a force-stroke curve, or that diverged, has
        NaN throughout.
        """
        # those that differ only in effects of other groups of logs are simulated once
        differing, alike = candidates.each_once
        if len(differing) < len(candidates):
            return self.simulate(differing)[alike]
        scenario = self.scenario
        n = len(candidates)
        samples = 1 + len(scenario.command) // scenario.stepping.steps
        wanted = len(self._pressures)
        response = Response(
            angle=np.full((n, samples, len(scenario.outputs)), np.nan),
            pressure=np.full((n, samples, wanted, 2), np.nan),
            flow=np.full((n, samples, wanted, 2), np.nan),
            line=np.full((n, samples if wanted else 0), np.nan),
        )
        # a coil that no numbers give a force is infeasible, and costs no simulation
        exists = has_force_curve(candidates.joints[:, self.joints])
        rows = np.flatnonzero(exists)
        threads = min(scenario.settings.threads or os.cpu_count() or 1, rows.size)
        if not threads:
            return response
        able = candidates if rows.size == n else candidates[rows]
        self._fill(response, rows, able, threads)
        return response

    def _fill(
        self, response: Response, rows: Index, candidates: Candidates, threads: int
    ) -> None:
        """Write what candidates do to their rows of a response."""
        # a stop is raised once the threads have ended; they begin nothing more meanwhile
        with undisturbed() as stops, quiet_mujoco(), _mapping(threads) as run:
            copies = self._copies(candidates, threads)
            free = self._arms(copies, threads)
            ready = self._ready(candidates, free[0], run)

            def simulate(some: Index) -> None:
                if stops:
                    return
                arm = free.pop()
                self._write(response, rows, some, ready, arm)
                free.append(arm)

            groups = math.ceil(rows.size / copies)
            shares = np.array_split(range(rows.size), groups)
            # a deque takes what is returned, so that errors are raised here
            deque(run(simulate, shares), maxlen=0)
            # one that diverges stops those beside it, which go again, each alone
            if copies > 1:
                free = self._arms(1, threads)
                last = response.angle[rows, -1]
                left = np.flatnonzero(np.isnan(last).any(axis=1))
                deque(run(simulate, left[:, None]), maxlen=0)
            self._free.extend(free)
        # whoever took the signal goes on
        if stops:
            self._fill(response, rows, candidates, threads)

    def _write(
        self,
        response: Response,
        rows: Index,
        some: Index,
        ready: "_Ready",
        arm: SteppedArm,
    ) -> None:
        """Simulate some of the candidates that are ready, on an arm that is free, and
        write what their sensors read."""
        scenario = self.scenario
        followed, oil = self._follow(ready, arm, np.resize(some, arm.copies))
        if not arm.healthy:
            return
        outputs = followed[:, :, scenario.outputs].swapaxes(0, 1)
        # copies beyond `some` only fill the arm
        for candidate, turned in zip(some, outputs, strict=False):
            if self.joints.size:
                speed = scenario.speed[scenario.outputs]
                sensors = ready.sensors[candidate]
                turned = reading(turned, sensors, scenario.period, speed)
            response.angle[rows[candidate]] = turned
        if oil is not None:
            row = rows[some[0]]
            response.pressure[row] = oil.pressure[:, self._pressures]
            response.flow[row] = oil.flow[:, self._pressures]
            response.line[row] = oil.line

    def _copies(self, candidates: Candidates, threads: int) -> int:
        """How many arms can be stepped at once without changing a bit of any.

        Actuators need an arm of their own; MuJoCo integrates one without any damping
        otherwise.
        """
        if self.joints.size:
            return 1
        damping = self.scenario.values(candidates)["dof_damping"]
        if not (damping > 0.0).any(axis=1).all():
            return 1
        n = len(candidates)
        most = TOGETHER // len(self.scenario.arm.columns)
        # groups of equal size, so that all threads have something to do to the end
        needed = math.ceil(n / most)
        # fewer groups than threads would leave some without any
        groups = max(threads, needed)
        return math.ceil(n / groups)

    def _arms(self, copies: int, count: int) -> deque[SteppedArm]:
        """Return so many arms, each with copies of it in one model, that nobody else
        steps."""
        arms = deque[SteppedArm]()
        # other threads may simulate as well: who asks first how many there are may find
        # none
        with suppress(IndexError):
            while copies == 1 and len(arms) < count:
                arms.append(self._free.pop())
        model = self.scenario.arm.model
        if copies > 1:
            model = repeat(model, copies)
        steps = self.scenario.stepping.steps
        while len(arms) < count:
            arms.append(self._chain.stepped(model, steps, copies))
        return arms

    def _ready(
        self,
        candidates: Candidates,
        arm: SteppedArm,
        run: Run,
    ) -> "_Ready":
        """Make n candidates ready: all are balanced here, one by one, on one arm.

        `run` is that of a pool.
        """
        scenario = self.scenario
        chain = self._chain
        n = len(candidates)
        values = scenario.values(candidates)
        pose = scenario.arm.pose
        balance = self._balance(arm, values, pose)
        plugin, states = chain.start(candidates, pose, balance, scenario.pressure)
        before = scenario.before[chain.columns]
        hold_valves(plugin, states, before)
        for field in ("velocity", "turning"):
            states[field] = scenario.speed[chain.columns]
        if before.any():
            # the pump has come up
            states["share"] = 1.0
            states["demand"] = HELD
        past = np.tile(before, (plugin.past, 1))
        commands = np.concatenate([past, scenario.command[:, chain.columns]])
        openings = [np.empty((0, 0))] * n
        # what the valves do is seen in their states alone
        if self._at_once and not self._pressures.size:
            openings = valve_openings(plugin, states, commands, run)
        return _Ready(
            values=values,
            balance=balance,
            gain=candidates.joints.gain[:, scenario.arm.columns[chain.pushed]],
            sensors=candidates.joints[:, scenario.arm.columns[scenario.outputs]],
            plugin=plugin,
            states=states,
            commands=commands,
            others=chain.others(candidates, scenario.prescribed, scenario.beside, run),
            openings=openings,
        )

    def _balance(self, arm: SteppedArm, values: dict[str, Array], pose: Array) -> Array:
        """Return what holds n candidates, of `values`, in a pose, (V,) [N·m], shape (n,
        V).

        As a rule they are alike, and as they were the last time: valves weigh nothing.
        """
        # at rest neither dampers nor friction act
        at_rest = [value for name, value in values.items() if name not in OF_MOTION]
        first, alike = distinct(*at_rest)
        key = b"".join(value[first].tobytes() for value in at_rest)
        held = self._held
        if held[0] != key:
            torques = list[Array]()
            for begin in range(0, len(first), arm.copies):
                # the last group is filled with candidates that are there twice
                some = np.resize(first[begin:], arm.copies)
                start = np.tile(pose, arm.copies)
                torques.append(arm.start(values, some, start))
            held = (key, np.concatenate(torques).reshape(-1, len(pose)))
            self._held = held
        return held[1][alike]

    def _follow(
        self, ready: "_Ready", arm: SteppedArm, some: Index
    ) -> tuple[Array, Oil | None]:
        """Roll some candidates out, one for each copy of an arm.

        Returns:
            Angles of the moving joints [rad], (1 + T, copies, V), and the oil of a
            single candidate, where it is wanted.
        """
        scenario = self.scenario
        row = some[0]
        start = np.tile(scenario.arm.pose, arm.copies)
        arm.start(ready.values, some, start)
        arm.data.qvel[:] = np.tile(scenario.speed, arm.copies)
        torque = self._pushing(ready.gain[some], ready.balance[some])
        actuators = ready.plugin.candidate(row)
        state = ready.states[row]
        samples = len(scenario.command) // scenario.stepping.steps
        observed = bool(self._pressures.size)
        kept = 1
        if observed:
            kept = 1 + samples
        angle = np.full((1 + samples, start.size), np.nan)
        history = np.zeros((kept, len(state)), JOINT_STATE)
        angle[0] = start
        history[0] = state
        others = ready.others[row]
        openings = ready.openings[row]
        course = Course(ready.commands, torque, others, openings, scenario.conditions)
        # the start is known: what is rolled out comes after it
        trace = Trace(angle[1:], history[1:])
        arm.roll(actuators, state, course, trace)
        oil = None
        if observed:
            oil = _oil(actuators, history, angle[:, self._chain.columns])
        return angle.reshape(len(angle), arm.copies, -1), oil

    def _pushing(self, gain: Array, balance: Array) -> Array:
        """Return what drives the pushed joints of some candidates in each step, shape
        (steps, copies P): torques [N·m] of their gains, (copies, P), and balance,
        (copies, V); of those that follow the log, its motion."""
        scenario = self.scenario
        pushed = self._chain.pushed
        servo = scenario.prescribed
        # equation (1): what holds the start pose acts throughout
        by_gain = gain * scenario.command[:, None, pushed]
        torque = by_gain + balance[:, pushed]
        served = np.searchsorted(pushed, servo.columns)
        if served.size:
            # without inertia a joint is put where the log has it
            motion = servo.angle if self._at_once else servo.torque
            torque[:, :, served] = motion[:, None]
        # of one layout, for which the rollout is compiled once
        return np.ascontiguousarray(torque.reshape(len(torque), -1))


@contextmanager
def _mapping(threads: int) -> Generator[Callable[..., Iterable[Any]]]:
    """Yield what maps a function over arguments in some threads; one is this one."""
    if threads == 1:
        yield map
        return
    with ThreadPoolExecutor(threads) as pool:
        yield pool.map


def make_scenario(
    spec: mujoco.MjSpec, log: Log, outputs: list[int], settings: FitSettings
) -> Scenario:
    """Return a log made ready for the model of some settings, which says what moves,
    from where and how; `outputs` are the joints whose angles are wanted, 0-based."""
    payload = settings.payload_of(log.source)
    if payload:
        spec = add_payload(spec, settings.arm, payload)
    return Scenario(
        spec, settings.arm, log, outputs, settings.simulation, settings.stepping
    )


def make_simulation(
    spec: mujoco.MjSpec,
    log: Log,
    outputs: list[int],
    settings: FitSettings,
    pressures: Sequence[int] = (),
) -> Simulation:
    """Return the simulation of one log by the model of some settings.

    Its response has the angles of the joints `outputs` and the chamber pressures of
    `pressures`, 0-based.
    """
    return Simulation(make_scenario(spec, log, outputs, settings), pressures)


def _oil(actuators: Plugin, history: Structs, angle: Array) -> Oil:
    """Return what the oil of a candidate does in its states, (1 + T, J) of JOINT_STATE,
    at angles [rad], (1 + T, J)."""
    coefficients = actuators.coefficients
    flow_a = history["a"]["flow"]
    flow_b = history["b"]["flow"]
    flow = np.stack([flow_a, flow_b], axis=-1)
    # the last in order is driven, and has the pump of all
    last = actuators.order[-1]
    line = history["line"][:, last].copy()
    if np.isinf(coefficients["pump_flow"][last]):
        line[:] = np.nan
    return Oil(pressures(coefficients, history, angle), flow, line)


def reading(angle: Array, sensors: Structs, period: float, speed: Array) -> Array:
    """Return what the sensors of K joints read, shape (T, K) like their angles [rad],
    `period` [s] apart.

    That is the turn since the start times a scale, with a first-order lag (ours).
    Between samples an angle is taken for a straight line. A reading starts at the
    angle, which has had a speed before [rad/s], (K,). With scale 1 and no lag it is the
    angle, to the bit.
    """
    scale = sensors["sensor_scale"]
    lag = sensors["sensor_lag"]
    if np.all(scale == 1.0) and np.all(lag == 0.0):
        return angle
    turned = scale * (angle - angle[0])
    for k in np.flatnonzero(lag):
        left = np.exp(-period / lag[k])
        mean = (1.0 - left) * lag[k] / period
        # exact for an input on straight lines: of this sample, and of the one before
        inputs = [1.0 - mean, mean - left]
        # while it turned steadily, the sensor read what it had been a lag earlier
        ahead = scale[k] * speed[k] * lag[k]
        step = scale[k] * speed[k] * period
        before = inputs[1] * (ahead - step) - left * step
        turned[:, k], _ = lfilter(
            inputs, [1.0, -left], turned[:, k] + ahead, zi=[before]
        )
    return angle[0] + turned
