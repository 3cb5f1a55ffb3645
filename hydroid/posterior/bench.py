"""One joint on the test bench: weighed, and driven by itself with its command stepped and held.

All other joints are locked. Speeds are in the direction of the command. Events between two samples are
interpolated, so that everything is smooth in the parameters, and differences give its derivatives.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hydroid.arm.model import load_model
from hydroid.log import Log
from hydroid.mjcf import quiet_mujoco
from hydroid.parameters import Array
from hydroid.settings.cylinder import LinearActuator
from hydroid.settings.fit import FitSettings
from hydroid.simulation import Candidates, Simulation
from hydroid.simulation.rollout import SteppedArm
from hydroid.simulation.scenario import Scenario


@dataclass(frozen=True, eq=False)
class Bench:
    """A joint whose quantities are wanted.

    Attributes:
        settings: of the fit.
        joint: its number, from 1.
        angle: at which it is tested [rad].
        period: between samples [s].
        scenario: the joint alone.
    """

    settings: FitSettings
    joint: int
    angle: float
    period: float
    scenario: Scenario

    @property
    def slides(self) -> bool:
        """Whether the joint slides."""
        return self.settings.arm.joints[self.joint - 1].slides

    @property
    def sense(self) -> float:
        """Direction in which a positive command turns the joint, 1 or -1."""
        actuator = self.settings.arm.joints[self.joint - 1].actuator
        return (
            float(np.sign(actuator.moment_arm(self.angle))) if isinstance(actuator, LinearActuator) else 1.0
        )

    def weigh(self, candidates: Candidates) -> tuple[Array, Array]:
        """Return gravity's torque [N·m] and the joint's inertia [kg·m²] at its angle, shape (n,) each."""
        torque, inertia = np.empty((2, len(candidates)))
        arm, values = SteppedArm(self.scenario.arm.model), self.scenario.values(candidates)
        with quiet_mujoco():
            for row in range(len(candidates)):
                arm.start(values, row, np.array([self.angle]))
                torque[row], inertia[row] = arm.data.qfrc_bias[0], arm.data.M[0]
        return torque, inertia

    def drive(self, candidates: Candidates, command: float, start: float, samples: int) -> Array:
        """Return the angles of n candidates from rest under a constant command [%], (n, 1 + samples) [rad].

        Springs are slack where the first log starts.
        """
        steps = samples * self.settings.simulation.steps
        scenario = self.scenario.restarted(np.array([start]), np.full((steps, 1), command))
        simulation = Simulation(scenario, self.settings.arm, self.settings.hydraulics.substeps)
        return simulation.simulate(candidates).angle[:, :, 0]


@dataclass(frozen=True, eq=False)
class Movement:
    """A step of the command [%] from an angle [rad], held for some samples.

    Speeds are in the direction of the command; the one at the end is the mean over a tenth of a second.
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

    def speeds(self, candidates: Candidates) -> Array:
        """Return speeds [deg/s], or [mm/s] of a joint that slides, between samples, shape (n, samples)."""
        steps = np.diff(self.bench.drive(candidates, self.command, self.start, self.samples), axis=1)
        return self.sign * (1e3 * steps if self.bench.slides else np.degrees(steps)) / self.bench.period

    def end(self, speeds: Array) -> Array:
        """Return the speed at the end of speeds, shape (n, samples): shape (n,)."""
        return speeds[:, -self.window :].mean(axis=1)

    def speed(self, candidates: Candidates) -> Array:
        """Return the speed at the end [deg/s], shape (n,)."""
        return self.end(self.speeds(candidates))

    def reaches(self, speeds: Array, level: Array) -> Array:
        """Return when speeds, shape (n, samples), first reach a level, shape (n,) [s]; NaN where never."""
        over = speeds >= level[:, None]
        k, row = np.argmax(over, axis=1), np.arange(len(speeds))
        before = np.where(k > 0, speeds[row, k - 1], 0.0)  # the joint starts at rest
        width = np.where(k > 0, 1.0, 0.5)  # and the first speed is that of half a sample
        with np.errstate(divide="ignore", invalid="ignore"):
            part = (level - before) / (speeds[row, k] - before)
        return np.where(over.any(axis=1), (k + 0.5 - width * (1.0 - part)) * self.bench.period, np.nan)

    def through_pose(self, estimate: Candidates) -> "Movement":
        """Return the movement in which one candidate passes the joint's angle in the middle of the window.

        It starts as long before as this one lasts, or at the joint's stop and is shorter.
        """
        half, angle, move = self.window // 2, self.bench.angle, self
        arm, i, margin = self.bench.settings.arm, self.bench.joint - 1, float(np.radians(1.0))
        low, high = min(float(arm.lower[i]) + margin, angle), max(float(arm.upper[i]) - margin, angle)
        turned = self.bench.drive(estimate, self.command, move.start, self.samples)[0]
        for _ in range(3):  # each correction leaves a tenth of the error or less
            if not np.isfinite(turned).all():
                return self
            start = move.start + angle - float(turned[self.samples - half])
            move = replace(move, start=min(max(start, low), high))
            turned = self.bench.drive(estimate, self.command, move.start, self.samples)[0]
        passed = self.sign * (turned - angle) >= 0
        last = int(np.argmax(passed)) + half if passed.any() else self.samples
        return replace(move, samples=min(max(last, self.window + 1), self.samples))


def movement(bench: Bench, command: float) -> Movement:
    """Return the movement of 1.2 s from the joint's angle."""
    return Movement(bench, command, bench.angle, max(round(1.2 / bench.period), 2))


def make_bench(settings: FitSettings, logs: Sequence[Log], joint: int) -> Bench:
    """Return a joint at the middle of its logged travel; the other joints are as the first log starts."""
    arm, pose, period = settings.arm, logs[0].start, logs[0].period
    angles = np.concatenate([log.angle[:, joint - 1] for log in logs])
    middle = float(np.radians(round(np.degrees((angles.min() + angles.max()) / 2))))
    rest = Log(
        "a test movement", np.array([0.0, period]), np.zeros((2, len(pose))), np.tile(pose, (2, 1)), period
    )
    alone = settings.simulation.changed({"other_joints": "locked"})
    scenario = Scenario(load_model(arm), arm, rest, [joint - 1], alone)
    return Bench(settings, joint, middle, period, scenario)
