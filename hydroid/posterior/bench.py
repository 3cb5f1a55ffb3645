"""One joint on the test bench: weighed in a pose, moved steadily there, and driven from
it with a step.

All other joints are locked. Speeds are in the direction of the command. Events between
two samples are interpolated, so that everything is smooth in the parameters, and
differences give its derivatives.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hydroid.arm.model import load_model
from hydroid.arrays import Array, Limits, record
from hydroid.hydraulics.cylinder import rod_motion
from hydroid.hydraulics.records import Records, coefficients
from hydroid.log import Log, only_command
from hydroid.log.command_sizes import ONE_SIZE, largest_commands
from hydroid.mjcf import quiet_mujoco
from hydroid.settings.cylinder import LinearActuator
from hydroid.settings.fit import FitSettings
from hydroid.simulation import Candidates, Simulation, make_scenario
from hydroid.simulation.lone import steady_velocity
from hydroid.simulation.rollout import SteppedArm
from hydroid.simulation.scenario import Scenario
from hydroid.simulation.steady import NEAR

ONSET = 0.1
"""part of the steady speed that is reached after the dead time"""
RISEN = 1.0 - np.exp(-1.0)
"""part of it that is reached a time constant later"""


class Direction(NamedTuple):
    """A direction of commands: their sign, its `ending` in names of quantities, and its
    `word` in labels."""

    sign: float
    ending: str
    word: str

    @property
    def moves(self) -> str:
        """What a command in it does, as `CurveEstimate.moves` has it."""
        return "" if self.word == self.ending else self.word

    @property
    def when(self) -> str:
        """Says in a sentence when the joint moves in it."""
        if not self.moves:
            return f"with {self.word} commands"
        return f"when {self.word}"


@record
class Bench:
    """A joint, numbered from 1, whose quantities are wanted.

    `angle`: at which it is tested [rad]; `period` between samples [s]; `scenario`: the
    joint alone; `only`: size of the commands in positive and in negative direction [%],
    None where they have several; `reach`: size of the largest ones [%].
    """

    settings: FitSettings
    joint: int
    angle: float
    period: float
    scenario: Scenario
    only: tuple[float | None, float | None] = (None, None)
    reach: tuple[float, float] = (100.0, 100.0)

    def tells(self, command: float) -> bool:
        """Return whether the logs tell what a command [%] does: all but between on and
        off."""
        only = self.only[0 if command > 0 else 1]
        return only is None or abs(abs(command) - only) <= ONE_SIZE

    def beyond(self, command: float) -> float | None:
        """Return the size of the logs' largest command in the direction of one [%] that
        is clearly larger; None of one that the logs have."""
        reach = self.reach[0 if command > 0 else 1]
        return reach if abs(command) > reach + ONE_SIZE else None

    @property
    def unit(self) -> tuple[float, str]:
        """What 1 rad, or 1 m of a joint that slides, is in the unit of quantities."""
        shown = self.settings.arm.joint(self.joint).shown
        return shown.factor, shown.unit

    @property
    def slides(self) -> bool:
        """Whether the joint slides: its angle is then a way [m], its torque a force."""
        return self.settings.arm.joint(self.joint).slides

    @property
    def pose(self) -> str:
        """The angle at which the joint is tested, in words."""
        factor, unit = self.unit
        return f"{factor * self.angle:.0f} {unit}"

    @property
    def sense(self) -> float:
        """Direction in which a positive command turns the joint, 1 or -1."""
        actuator = self.settings.arm.joint(self.joint).actuator
        if not isinstance(actuator, LinearActuator):
            return 1.0
        return np.sign(actuator.moment_arm(self.angle))

    def weigh(self, candidates: Candidates) -> tuple[Array, Array]:
        """Return gravity's torque [N·m] and the joint's inertia [kg·m²] at its angle,
        shape (n,) each."""
        torque = np.empty(len(candidates))
        inertia = np.empty(len(candidates))
        arm = SteppedArm(self.scenario.arm.model)
        values = self.scenario.values(candidates)
        with quiet_mujoco():
            for row in range(len(candidates)):
                arm.start(values, [row], np.array([self.angle]))
                torque[row] = arm.data.qfrc_bias[0]
                inertia[row] = arm.data.M[0]
        return torque, inertia

    def loads(self, candidates: Candidates) -> Array:
        """Return what holds the joint at its angle and NEAR before and behind it [N·m],
        shape (n, 3).

        Springs are slack where the first log starts.
        """
        load = np.empty((len(candidates), 3))
        arm = SteppedArm(self.scenario.arm.model)
        values = self.scenario.values(candidates)
        angles = (self.angle - NEAR, self.angle, self.angle + NEAR)
        with quiet_mujoco():
            for row in range(len(candidates)):
                for column, angle in enumerate(angles):
                    held = arm.start(values, [row], np.array([angle]))
                    load[row, column] = held[0]
        return load

    def steady(self, candidates: Candidates, commands: Array, loads: Array) -> Array:
        """Return the joint's speeds at its angle under m commands [%] that are held,
        (n, m), unit per s.

        They are those of `hydroid.simulation.lone`, positive where its angle grows.
        `loads` are its.
        """
        joint: Records = candidates.joints[:, self.joint - 1]  # pyright: ignore[reportAssignmentType]
        rung = self.settings.rung
        return self.unit[0] * steady_velocity(joint, self.angle, loads, commands, rung)

    def movement(self, command: float, seconds: float = 1.2) -> "Movement":
        """Return the movement from the joint's angle under a command [%]."""
        return Movement(self, command, max(round(seconds / self.period), 2))


@record
class Movement:
    """A step of the command [%] from rest at the bench's angle, held for some samples.

    Speeds are in the direction of the command, in `Bench.unit` per second.
    """

    bench: Bench
    command: float
    samples: int

    @property
    def sign(self) -> float:
        """Direction in which the command turns the joint."""
        if self.command < 0:
            return -self.bench.sense
        return self.bench.sense

    def angles(self, candidates: Candidates) -> Array:
        """Return the angles of n candidates from rest, shape (n, 1 + samples) [rad].

        They are the joint's as its sensor reads them, late but to scale. Springs are
        slack where the first log starts.
        """
        settings = self.bench.settings
        # a speed is the joint's, and not what a sensor makes of it
        to_scale = candidates.joints.copy()
        to_scale["sensor_scale"] = 1.0
        steps = self.samples * settings.stepping.steps
        commands = np.full((steps, 1), self.command)
        scenario = self.bench.scenario.restarted(np.array([self.bench.angle]), commands)
        moved = Candidates(to_scale, candidates.mass)
        return Simulation(scenario).simulate(moved).angle[:, :, 0]

    def speeds(self, candidates: Candidates) -> Array:
        """Return speeds between samples, shape (n, samples)."""
        return self.speeds_of(self.angles(candidates))

    def speeds_of(self, angles: Array) -> Array:
        """Return the speeds between angles of this movement, (n, 1 + samples) [rad]."""
        factor = self.sign * self.bench.unit[0] / self.bench.period
        return factor * np.diff(angles, axis=1)

    def reaches(self, speeds: Array, level: Array) -> Array:
        """Return when speeds, shape (n, samples), first reach a level, shape (n,) [s];
        NaN where never."""
        over = speeds >= level[:, None]
        # of several the first: a joint that rings passes a level again
        first = over.argmax(axis=1)
        # the joint rests at the start; a speed is that between two samples
        from_rest = np.pad(speeds, ((0, 0), (1, 0)))
        times = np.append(0.0, np.arange(self.samples) + 0.5)
        row = np.arange(len(speeds))
        before = from_rest[row, first]
        after = from_rest[row, first + 1]
        between = times[first + 1] - times[first]
        with np.errstate(all="ignore"):
            time = times[first] + between * (level - before) / (after - before)
        reached = over.any(axis=1)
        return np.where(reached, self.bench.period * time, np.nan)


def make_bench(settings: FitSettings, logs: Sequence[Log], joint: int) -> Bench:
    """Return a joint at the middle of its logged travel; the other joints are as the
    first log starts."""
    arm = settings.arm
    pose = logs[0].start
    period = logs[0].period
    middle = sum(logged_travel(logs, joint)) / 2
    # in whole degrees or millimetres, as words say it
    middle = arm.joint(joint).shown.rounded(middle)
    command = np.zeros((2, len(pose)))
    still = np.tile(pose, (2, 1))
    rest = Log("a test movement", np.array([0.0, period]), command, still, period)
    # a quantity of a joint is to be its own, whatever the others do
    alone = settings.changed({"simulation.other_joints": "locked"})
    scenario = make_scenario(load_model(arm), rest, [joint - 1], alone)
    only = (only_command(logs, joint, 1.0), only_command(logs, joint, -1.0))
    negative, positive = largest_commands(logs, joint)
    reach = (positive, -negative)
    return Bench(settings, joint, middle, period, scenario, only, reach)


def logged_travel(logs: Sequence[Log], joint: int) -> Limits:
    """Return the ends of a joint's travel in all logs [rad]; of one that no log
    measures those of what the model has."""
    shown = [log for log in logs if log.measures(joint)] or logs
    angles = np.concatenate([log.posed[:, joint - 1] for log in shown])
    return float(angles.min()), float(angles.max())


def actuator(bench: Bench, candidates: Candidates) -> tuple[Records, Array, Array]:
    """Return n candidates' COEFFICIENTS of the joint, and travel and moment arm [m] at
    its angle, (n,) each.

    Of a rotary actuator, whose areas are displacements, the travel is the angle and the
    moment arm is 1.
    """
    j = bench.joint - 1
    joints: Records = candidates.joints[:, [j]]  # pyright: ignore[reportAssignmentType]
    c: Records = coefficients(joints)[:, 0]  # pyright: ignore[reportAssignmentType]
    travel, arm, _ = rod_motion(np.full(len(c), bench.angle), c)
    return c, travel, arm
