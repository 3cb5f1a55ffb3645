"""One joint on the test bench: weighed, and driven by itself with its command stepped and held.

All other joints are locked. Speeds are in the direction of the command. Events between two samples are
interpolated, so that everything is smooth in the parameters, and differences give its derivatives.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hydroid.arm.model import load_model
from hydroid.arrays import Array, record
from hydroid.log import Log
from hydroid.mjcf import quiet_mujoco
from hydroid.settings.cylinder import LinearActuator
from hydroid.settings.fit import FitSettings
from hydroid.simulation import Candidates, Simulation
from hydroid.simulation.rollout import SteppedArm
from hydroid.simulation.scenario import Scenario


@record
class Bench:
    """A joint, numbered from 1, whose quantities are wanted.

    `angle`: at which it is tested [rad]; `period` between samples [s]; `scenario`: the joint alone.
    """

    settings: FitSettings
    joint: int
    angle: float
    period: float
    scenario: Scenario

    @property
    def unit(self) -> tuple[float, str]:
        """What 1 rad, or 1 m of a joint that slides, is in the unit of quantities."""
        return (1e3, "mm") if self.settings.arm.joints[self.joint - 1].slides else (np.degrees(1.0), "deg")

    @property
    def sense(self) -> float:
        """Direction in which a positive command turns the joint, 1 or -1."""
        actuator = self.settings.arm.joints[self.joint - 1].actuator
        return np.sign(actuator.moment_arm(self.angle)) if isinstance(actuator, LinearActuator) else 1.0

    def weigh(self, candidates: Candidates) -> tuple[Array, Array]:
        """Return gravity's torque [N·m] and the joint's inertia [kg·m²] at its angle, shape (n,) each."""
        torque, inertia = np.empty((2, len(candidates)))
        arm, values = SteppedArm(self.scenario.arm.model), self.scenario.values(candidates)
        with quiet_mujoco():
            for row in range(len(candidates)):
                arm.start(values, [row], np.array([self.angle]))
                torque[row], inertia[row] = arm.data.qfrc_bias[0], arm.data.M[0]
        return torque, inertia

    def movement(self, command: float) -> "Movement":
        """Return the movement of 1.2 s from the joint's angle."""
        return Movement(self, command, self.angle, max(round(1.2 / self.period), 2))


@record
class Movement:
    """A step of the command [%] from an angle [rad], held for some samples.

    Speeds are in the direction of the command, in `Bench.unit` per second; the one at the end is the mean
    over a tenth of a second.
    """

    bench: Bench
    command: float
    start: float
    samples: int

    @property
    def window(self) -> int:
        """Samples in the last tenth of a second."""
        return max(round(0.1 / self.bench.period), 1)

    @property
    def sign(self) -> float:
        """Direction in which the command turns the joint."""
        return -self.bench.sense if self.command < 0 else self.bench.sense

    def angles(self, candidates: Candidates) -> Array:
        """Return the angles of n candidates from rest, shape (n, 1 + samples) [rad].

        Springs are slack where the first log starts.
        """
        settings = self.bench.settings
        commands = np.full((self.samples * settings.simulation.steps, 1), self.command)
        scenario = self.bench.scenario.restarted(np.array([self.start]), commands)
        return Simulation(scenario, settings.substeps).simulate(candidates).angle[:, :, 0]

    def speeds(self, candidates: Candidates) -> Array:
        """Return speeds between samples, shape (n, samples)."""
        factor = self.sign * self.bench.unit[0] / self.bench.period
        return factor * np.diff(self.angles(candidates), axis=1)

    def end(self, speeds: Array) -> Array:
        """Return the speed at the end of speeds, shape (n, samples): shape (n,)."""
        return speeds[:, -self.window :].mean(axis=1)

    def speed(self, candidates: Candidates) -> Array:
        """Return the speed at the end, shape (n,)."""
        return self.end(self.speeds(candidates))

    def reaches(self, speeds: Array, level: Array) -> Array:
        """Return when speeds, shape (n, samples), first reach a level, shape (n,) [s]; NaN where never."""
        over, row = speeds >= level[:, None], np.arange(len(speeds))
        k, from_rest = over.argmax(axis=1), np.pad(speeds, ((0, 0), (1, 0)))
        times = np.append(0.0, np.arange(self.samples) + 0.5)  # a speed is that between two samples
        before, after = from_rest[row, k], from_rest[row, k + 1]
        with np.errstate(all="ignore"):
            time = times[k] + (times[k + 1] - times[k]) * (level - before) / (after - before)
        return np.where(over.any(axis=1), self.bench.period * time, np.nan)

    def through_pose(self, estimate: Candidates) -> "Movement":
        """Return the movement in which one candidate passes the joint's angle in the middle of the window.

        It starts as long before as this one lasts, or at the joint's stop and is shorter.
        """
        half, angle, i, move = self.window // 2, self.bench.angle, self.bench.joint - 1, self
        arm, margin = self.bench.settings.arm, np.radians(1.0)
        low, high = min(arm.lower[i] + margin, angle), max(arm.upper[i] - margin, angle)
        turned = self.angles(estimate)[0]
        for _ in range(3):  # each correction leaves a tenth of the error or less
            if not np.isfinite(turned).all():
                return self
            start = move.start + angle - turned[self.samples - half]
            move = replace(move, start=min(max(start, low), high))
            turned = move.angles(estimate)[0]
        passed = self.sign * (turned - angle) >= 0
        last = passed.argmax() + half if passed.any() else self.samples
        return replace(move, samples=min(max(last, self.window + 1), self.samples))


def make_bench(settings: FitSettings, logs: Sequence[Log], joint: int) -> Bench:
    """Return a joint at the middle of its logged travel; the other joints are as the first log starts."""
    arm, pose, period = settings.arm, logs[0].start, logs[0].period
    shown = [log for log in logs if log.measured[joint - 1]] or logs
    angles = np.concatenate([log.posed[:, joint - 1] for log in shown])
    middle = np.radians(np.round(np.degrees((angles.min() + angles.max()) / 2)))
    command, still = np.zeros((2, len(pose))), np.tile(pose, (2, 1))
    rest = Log("a test movement", np.array([0.0, period]), command, still, period)
    alone = settings.simulation.changed({"other_joints": "locked"})
    scenario = Scenario(load_model(arm), arm, rest, [joint - 1], alone)
    return Bench(settings, joint, middle, period, scenario)
