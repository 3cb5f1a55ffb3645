"""The whole arm under its actuators, in its study pose, for tests and benchmarks."""

import numpy as np
from made_logs import at_rest
from observation import Observation, trace

from hydroid.arm.model import load_model
from hydroid.hydraulics.records import Records, nominal_joints
from hydroid.rungs import DYNAMIC
from hydroid.settings.arm import Arm
from hydroid.settings.hydraulics import HydraulicSettings
from hydroid.settings.problem import SimulationSettings
from hydroid.simulation import Candidates, Simulation
from hydroid.simulation.scenario import Scenario


def nominal(arm: Arm, settings: HydraulicSettings, n: int = 1) -> Records:
    joints = np.tile(nominal_joints(arm, settings), (n, 1)).view(np.recarray)
    joints["damping"], joints["stiffness"] = 231.8, 53.4
    return joints


class DrivenArm:
    """n candidates of the seven-joint arm under commands [%], (T, J), with hydraulics
    on every joint."""

    def __init__(
        self, arm: Arm, joints: Records, command: np.ndarray, settings, steps: int = 1
    ) -> None:
        pose = arm.pose("study")
        log = at_rest(pose, np.concatenate([command, np.zeros((1, command.shape[1]))]))
        chosen = SimulationSettings(steps_per_sample=steps)
        stepping = DYNAMIC.stepping(steps, settings.substeps)
        joints_of = list(range(len(pose)))
        self._scenario = Scenario(
            load_model(arm), arm, log, joints_of, chosen, stepping
        )
        self._candidates = Candidates(joints, np.tile(arm.masses, (len(joints), 1)))

    def run(self) -> np.ndarray:
        """Angles [rad], (n, T + 1, J); NaN of a candidate that diverged."""
        return Simulation(self._scenario).simulate(self._candidates).angle

    def trace(self) -> Observation:
        """What the actuators of the only candidate did, (T + 1, J)."""
        return trace(self._scenario, self._candidates)
