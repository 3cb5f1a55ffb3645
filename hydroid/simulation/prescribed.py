"""Joints that follow their logged motion, whatever the arm does to them.

A prescribed joint gets an armature so large that nothing on the arm can move it, and the torque that
gives that armature the logged acceleration; a critically damped servo of the same scale takes up
what integration leaves over. The arm feels the joint's true motion, inertia coupling included.
"""

import mujoco
import numpy as np
from scipy.signal import butter, sosfiltfilt

from hydroid.arrays import Array, Index
from hydroid.log import Log
from hydroid.settings.problem import SimulationSettings

ARMATURE = 1e6
"""[kg·m²], against about 10 for the whole arm: the arm's torques move it by less than 1e-6 of a radian"""
HEAVIEST = 1e4  # times the largest inertia of the arm: the armature of a machine that is heavier
SERVO = 10.0  # natural frequency of the servo [rad/s], slow against a step and fast against drift


class Prescribed:
    """The torque that makes some joints follow a log.

    Args:
        model: the stepped model; gets the armature, and springs that pull towards angle 0.
        log: the record whose angles are followed.
        joints: prescribed joints among the arm's, 0-based.
        columns: their positions among the moving joints.
        settings: low-pass of the motion, steps per sample.

    Attributes:
        columns: as given.
        angle: at the start of each step [rad], shape (steps, P).
        velocity: during it [rad/s], shape (steps, P).
        torque: [N·m], shape (steps, P).
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        log: Log,
        joints: Index,
        columns: Index,
        settings: SimulationSettings,
    ) -> None:
        armature = max(ARMATURE, HEAVIEST * model.dof_M0.max())
        model.dof_armature[columns] = armature
        model.qpos_spring[columns] = 0.0
        model.jnt_limited[columns] = False  # the machine's own stops are in the log
        self.columns = columns
        self.damping, self.stiffness = 2 * SERVO * armature, SERVO**2 * armature
        step = log.period / settings.steps
        motion = smooth(log.angle[:, joints], settings.measured_cutoff_hz * log.period)
        samples = np.arange((len(motion) - 1) * settings.steps + 1) * step
        fine = np.empty((len(samples), len(joints)))
        for k, angle in enumerate(motion.T):
            fine[:, k] = np.interp(samples, log.time, angle)
        velocity = np.diff(fine, axis=0, prepend=fine[:1]) / step
        acceleration = np.diff(velocity, axis=0) / step
        self.angle: Array = fine[:-1]
        self.velocity: Array = velocity[1:]
        # semi-implicit Euler: the step from k to k+1 has the new velocity and the old angle
        self.torque: Array = (
            armature * acceleration + self.damping * self.velocity + self.stiffness * self.angle
        )


def smooth(angle: Array, cutoff: float) -> Array:
    """Low-pass angles, shape (T, K), without phase shift; `cutoff` is in cycles per sample."""
    if cutoff >= 0.5 or len(angle) < 16 or not angle.size:
        return angle
    sections = butter(2, 2 * cutoff, output="sos")
    return np.asarray(sosfiltfilt(sections, angle, axis=0, padlen=min(len(angle) - 1, 100)))
