"""The whole arm under the actuator plugin, for tests and benchmarks: some joints driven."""

import mujoco
import numpy as np
from mujoco.batch import Batch

from hydroid.hydraulics.actuator import Actuator
from hydroid.hydraulics.records import Records, linkages
from hydroid.hydraulics.solenoid import curve_exists
from hydroid.mjcf import quiet_mujoco
from hydroid.settings.arm import Arm
from hydroid.settings.hydraulics import HydraulicSettings

DAMPING, STIFFNESS, PERIOD = 231.8, 53.4, 0.01
TEN = (
    "area_a", "area_b", "current_max", "current_min", "onset_a", "onset_b",
    "force_1", "force_2", "stroke_1", "stroke_2",
)  # fmt: skip


def scatter(nominal: Records, rng: np.random.Generator) -> Records:
    """Give every actuator its own feasible set from the whole search space, 0.25 to 2.5 times nominal."""
    scattered = nominal.copy()
    for at in np.ndindex(nominal.shape):
        while True:
            factors = rng.uniform(0.25, 2.5, len(TEN))
            if curve_exists(8 * factors[6], 0.7 * factors[7], 0.8 * factors[8], 12 * factors[9]):
                break
        for name, factor in zip(TEN, factors, strict=True):
            scattered[name][at] *= factor
    return scattered


class DrivenArm:
    """n candidates of the seven-joint arm in its study pose, with the actuators' plugin on some joints."""

    def __init__(
        self,
        arm: Arm,
        parameters: Records,
        driven: list[int],
        settings: HydraulicSettings,
        steps: int = 1,
        threads: int = 1,
    ) -> None:
        model = mujoco.MjModel.from_xml_path(str(arm.model))
        pose = arm.pose("study")
        model.opt.timestep = PERIOD / steps
        model.dof_damping[:], model.jnt_stiffness[:] = 0.0, STIFFNESS
        model.qpos_spring[:] = pose
        n, joints = parameters.shape
        self.batch = Batch(model, n, threads)
        self.angle, self.velocity = self.batch.bind("qpos"), self.batch.bind("qvel")
        self.mass, self.bias = self.batch.bind("M"), self.batch.bind("qfrc_bias")
        self.applied, self.armature = self.batch.bind("qfrc_applied"), self.batch.expand("dof_armature")
        entries = np.zeros((joints, joints), dtype=np.intp)
        for i in range(joints):
            for k in range(model.M_rowadr[i], model.M_rowadr[i] + model.M_rownnz[i]):
                entries[i, model.M_colind[k]] = entries[model.M_colind[k], i] = k
        moved = linkages(arm, range(joints), driven)
        self.actuator = Actuator(parameters, moved, DAMPING, model.opt.timestep, settings, entries)
        self.model, self.pose, self.steps = model, pose, steps

    def run(self, command: np.ndarray) -> np.ndarray:
        """Angles [rad], (n, T + 1, J), under commands [%], (T, J)."""
        with quiet_mujoco():
            self.batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE.value)
            self.angle[:] = self.pose
            self.armature[:] = 0.0
            self.batch.forward()
            self.batch.warning[:] = 0
            state = self.actuator.start(self.angle, self.bias)
            out = np.empty((len(self.angle), len(command) + 1, self.angle.shape[1]))
            out[:, 0] = self.angle
            for t, u in enumerate(command):
                for _ in range(self.steps):
                    torque, armature = self.actuator.advance(state, u, self.angle, self.velocity, self.mass)
                    self.applied[:], self.armature[:] = torque, armature
                    self.batch.step()
                    self.angle[:] = self.actuator.close(state, self.velocity, self.mass)
                out[:, t + 1] = self.angle
        self.state = state
        return out

    @property
    def failed(self) -> np.ndarray:
        """Candidates for which MuJoCo warned, (n,)."""
        return self.batch.warning[:, :, 1].any(axis=1)


def lone_wheel(actuator: Actuator, command: np.ndarray, inertia: float, start: float = 0.0) -> np.ndarray:
    """Angles [rad], (T,), of an inertia [kg·m²] that nothing but one joint's actuator moves, from rest."""
    angle, velocity = np.full((1, 1), start), np.zeros((1, 1))
    state, mass = actuator.start(angle, np.zeros((1, 1))), np.full((1, 1), inertia)
    out = []
    for u in command:
        torque, armature = actuator.advance(state, [u], angle, velocity, mass)
        mass = inertia + armature
        velocity = velocity + 0.01 * torque / mass
        angle = actuator.close(state, velocity, mass)
        out.append(angle[0, 0])
    return np.array(out)
