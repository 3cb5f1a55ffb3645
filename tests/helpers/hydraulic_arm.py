"""The whole arm under its actuators, in its study pose, for tests and benchmarks."""

import numpy as np

from hydroid.arm.model import load_model
from hydroid.hydraulics.actuator import Observation
from hydroid.hydraulics.records import Records, nominal_joints
from hydroid.hydraulics.solenoid import curve_exists
from hydroid.log import Log
from hydroid.settings.arm import Arm
from hydroid.settings.hydraulics import HydraulicSettings
from hydroid.settings.problem import SimulationSettings
from hydroid.simulation import Candidates, Simulation
from hydroid.simulation.scenario import Scenario

DAMPING, STIFFNESS, PERIOD = 231.8, 53.4, 0.01
TEN = (
    "area_a", "area_b", "current_max", "current_min", "onset_a", "onset_b",
    "force_1", "force_2", "stroke_1", "stroke_2",
)  # fmt: skip


def nominal(arm: Arm, settings: HydraulicSettings, n: int = 1) -> Records:
    """All joints of the arm with dampers and springs, once a candidate."""
    joints = np.tile(nominal_joints(arm, settings), (n, 1)).view(np.recarray)
    joints["damping"], joints["stiffness"] = DAMPING, STIFFNESS
    return joints


def scatter(joints: Records, rng: np.random.Generator) -> Records:
    """Give every actuator its own feasible set from the whole search space, 0.25 to 2.5 times nominal."""
    scattered = joints.copy()
    for at in np.ndindex(joints.shape):
        while True:
            factors = rng.uniform(0.25, 2.5, len(TEN))
            if curve_exists(8 * factors[6], 0.7 * factors[7], 0.8 * factors[8], 12 * factors[9]):
                break
        for name, factor in zip(TEN, factors, strict=True):
            scattered[name][at] *= factor
    return scattered


class DrivenArm:
    """n candidates of the seven-joint arm under commands [%], (T, J), with hydraulics on every joint."""

    def __init__(
        self,
        arm: Arm,
        joints: Records,
        command: np.ndarray,
        settings: HydraulicSettings,
        steps: int = 1,
        threads: int = 1,
    ) -> None:
        pose, samples = arm.pose("study"), len(command) + 1
        held = np.concatenate([command, np.zeros((1, command.shape[1]))])
        log = Log("commands", np.arange(samples) * PERIOD, held, np.tile(pose, (samples, 1)), PERIOD)
        chosen = SimulationSettings(steps_per_sample=steps, threads=threads)
        scenario = Scenario(load_model(arm), arm, log, list(range(len(pose))), chosen)
        self._simulation = Simulation(scenario, arm, settings.substeps)
        self._candidates = Candidates(joints, np.tile(arm.masses, (len(joints), 1)))

    def run(self) -> np.ndarray:
        """Angles [rad], (n, T + 1, J); NaN of a candidate that diverged."""
        return self._simulation.simulate(self._candidates).angle

    def trace(self) -> Observation:
        """What the actuators of the only candidate did, (T + 1, J)."""
        return self._simulation.trace(self._candidates)
