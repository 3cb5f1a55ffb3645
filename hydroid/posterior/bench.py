"""One joint on the test bench: weighed and driven by itself, all other joints locked."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hydroid.arm.model import load_model
from hydroid.log import Log
from hydroid.mjcf import quiet_mujoco
from hydroid.parameters import Array
from hydroid.settings.fit import FitSettings
from hydroid.settings.linkage import LinearActuator
from hydroid.simulation import Candidates, Simulation
from hydroid.simulation.rollout import SteppedArm
from hydroid.simulation.scenario import Scenario

MARGIN = float(np.radians(1.0))
"""distance that test movements keep from the joint's stops [rad]"""
LEAST_TRAVEL = float(np.radians(5.0))
"""of a joint that its logs hardly move [rad]"""


@dataclass(frozen=True, eq=False)
class Bench:
    """A joint whose quantities are wanted.

    Attributes:
        settings: of the fit.
        joint: its number, from 1.
        angle: at which it is tested [rad].
        travel: smallest and largest angle of interest [rad].
        period: between samples [s].
        scenario: the joint alone.
    """

    settings: FitSettings
    joint: int
    angle: float
    travel: tuple[float, float]
    period: float
    scenario: Scenario

    @property
    def name(self) -> str:
        """Begins the names of its quantities."""
        return f"joint{self.joint}"

    @property
    def sense(self) -> float:
        """Direction in which a positive command turns the joint, 1 or -1."""
        actuator = self.settings.arm.joints[self.joint - 1].actuator
        return (
            float(np.sign(actuator.moment_arm(self.angle))) if isinstance(actuator, LinearActuator) else 1.0
        )

    def at(self, angle: float) -> "Bench":
        """Return the joint tested at another angle [rad]."""
        return replace(self, angle=angle)

    def weigh(self, candidates: Candidates, angles: Array) -> tuple[Array, Array]:
        """Return gravity's torque [N·m] and the joint's inertia [kg·m²] at angles, shape (n, A) each."""
        torque, inertia = np.empty((2, len(candidates), len(angles)))
        arm, values = SteppedArm(self.scenario.arm.model), self.scenario.values(candidates)
        with quiet_mujoco():
            for row, column in np.ndindex(torque.shape):
                arm.start(values, row, angles[[column]])
                torque[row, column] = arm.data.qfrc_bias[0]
                inertia[row, column] = arm.data.M[0]
        return torque, inertia

    def drive(self, candidates: Candidates, command: float, start: float, samples: int) -> Array:
        """Return the angles of n candidates from rest under a constant command [%], (n, 1 + samples) [rad].

        Springs are slack where the first log starts.
        """
        steps = samples * self.settings.simulation.steps_per_sample
        scenario = self.scenario.restarted(np.array([start]), np.full((steps, 1), command))
        simulation = Simulation(scenario, self.settings.arm, self.settings.hydraulics.substeps)
        return simulation.simulate(candidates).angle[:, :, 0]

    @property
    def reach(self) -> tuple[float, float]:
        """Smallest and largest angle from which a test movement may start [rad]."""
        arm, i = self.settings.arm, self.joint - 1
        low, high = float(arm.lower[i]) + MARGIN, float(arm.upper[i]) - MARGIN
        return min(low, self.angle), max(high, self.angle)


def make_bench(settings: FitSettings, logs: Sequence[Log], joint: int) -> Bench:
    """Return a joint at the middle of its logged travel; the other joints are as the first log starts."""
    arm, pose, period = settings.arm, logs[0].start, logs[0].period
    angles = np.concatenate([log.angle[:, joint - 1] for log in logs])
    middle = float(np.radians(round(np.degrees((angles.min() + angles.max()) / 2))))
    half = max(float(np.ptp(angles)) / 2, LEAST_TRAVEL)
    rest = Log(
        "a test movement", np.array([0.0, period]), np.zeros((2, len(pose))), np.tile(pose, (2, 1)), period
    )
    alone = settings.simulation.model_copy(update={"other_joints": "locked"})
    scenario = Scenario(load_model(arm), arm, rest, [joint - 1], alone)
    return Bench(settings, joint, middle, (middle - half, middle + half), period, scenario)
