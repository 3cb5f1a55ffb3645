"""Plausible sizes of what moves a joint, from the weight of the arm and the speeds in its log.

They are starts and centres of wide priors, not estimates: a joint is taken to lift the arm LIFT times, to
turn at the speed that the log shows, and to lose what is left over in its valve.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from hydroid.arm.model import load_model
from hydroid.hydraulics.valve import DENSITY
from hydroid.settings.arm import Arm
from hydroid.settings.hydraulics import HydraulicSettings

LIFT = 2.5
"""torque of a joint at the pump's pressure, over the largest that gravity asks of it"""
SPEED = 0.5
"""of a joint that no log shows moving [rad/s]"""
SLOWEST = 0.01
"""of a joint that a log shows standing [rad/s]"""
ACCELERATION = 1.0
"""that a joint without weight must give at least [rad/s²]"""
POSES = 300
"""number of poses in which the arm is weighed"""
BAR, OIL = 1e5, HydraulicSettings()


@dataclass(frozen=True)
class JointSize:
    """The torque that a joint can give [N·m], and its speed at full command [rad/s]."""

    torque: float
    speed: float

    @property
    def damping(self) -> float:
        """What holds the speed at full command [N·m·s/rad]."""
        return self.torque / self.speed

    @property
    def displacement(self) -> float:
        """Oil per angle that gives the torque at the pump's pressure [cm³/rad]."""
        return 1e6 * self.torque / (BAR * OIL.supply_pressure)

    @property
    def opening(self) -> float:
        """Valve opening that gives the speed while the arm is lifted [mm²]; both edges lose the same."""
        left = BAR * OIL.supply_pressure * (1 - 1 / LIFT) / 2
        flow = 1e-6 * self.displacement * self.speed
        return 1e6 * flow / (OIL.flow_coefficient * math.sqrt(2 * left / DENSITY))


def joint_sizes(arm: Arm, speeds: Mapping[int, float]) -> tuple[JointSize, ...]:
    """Return the size of every joint, (J,).

    Args:
        arm: with its model in place.
        speeds: that a log shows, by number of the joint [rad/s].

    Raises:
        ModelError: the arm's model cannot be read.
    """
    model = load_model(arm).compile()
    data = mujoco.MjData(model)
    low, high = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    torque = np.zeros(len(arm.joints))
    for pose in np.random.default_rng(0).uniform(low, high, (POSES, len(low))):
        data.qpos[:] = pose
        mujoco.mj_forward(model, data)
        inertia = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, inertia)
        asked = np.maximum(LIFT * abs(data.qfrc_bias), ACCELERATION * np.diag(inertia))
        torque = np.maximum(torque, asked)
    slow = {joint: max(speed, SLOWEST) for joint, speed in speeds.items()}
    return tuple(JointSize(float(t), slow.get(j, SPEED)) for j, t in enumerate(torque, 1))
