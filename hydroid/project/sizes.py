"""Plausible sizes of what moves a joint, from the weight of the arm and the speeds in its log.

They are starts and centres of wide priors, not estimates: a joint is taken to lift the arm LIFT times, to
turn at the speed that the log shows, and to lose what is left over in its valve.
"""

from collections.abc import Mapping
from typing import NamedTuple

import mujoco
import numpy as np

from hydroid.arm.model import load_model
from hydroid.hydraulics.valve import DENSITY
from hydroid.settings.arm import Arm
from hydroid.settings.hydraulics import HydraulicSettings

LIFT = 2.0
"""torque of a joint at the pump's pressure, over the largest that gravity asks of it"""


class JointSize(NamedTuple):
    """What a joint needs: oil [cm³/rad], valve opening [mm²] and damping [N·m·s/rad] at a speed [rad/s]."""

    displacement: float
    opening: float
    damping: float
    speed: float


def joint_sizes(arm: Arm, speeds: Mapping[int, float]) -> tuple[JointSize, ...]:
    """Return the size of every joint, (J,).

    The displacement gives the torque at the pump's pressure; the opening gives the speed while the arm is
    lifted, and both edges lose the same; the damping holds the speed at full command.

    Args:
        arm: with its model in place.
        speeds: that a log shows, by number of the joint [rad/s]; 0.5 for the others.

    Raises:
        ModelError: the arm's model cannot be read.
    """
    model = load_model(arm).compile()
    data = mujoco.MjData(model)
    low, high = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    torque, oil = np.zeros(len(arm.joints)), HydraulicSettings()
    for pose in np.random.default_rng(0).uniform(low, high, (300, len(low))):
        data.qpos[:] = pose
        mujoco.mj_forward(model, data)
        inertia = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, inertia)
        # a joint without weight must give 1 rad/s² at least
        torque = np.maximum(torque, np.maximum(LIFT * abs(data.qfrc_bias), np.diag(inertia)))
    pressure, sizes = 1e5 * oil.supply_pressure, list[JointSize]()
    through = oil.flow_coefficient * np.sqrt((1 - 1 / LIFT) * pressure / DENSITY)  # [m/s]
    for joint, most in enumerate(torque.tolist(), 1):
        speed = max(speeds.get(joint, 0.5), 0.01)
        volume = most / pressure
        sizes.append(JointSize(1e6 * volume, 1e6 * volume * speed / through, most / speed, speed))
    return tuple(sizes)
