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
from hydroid.settings.cylinder import LinearActuator
from hydroid.settings.hydraulics import HydraulicSettings

LIFT = 2.0
"""torque of a joint at the pump's pressure, over the largest that gravity asks of it"""


class JointSize(NamedTuple):
    """What a joint needs: oil [cm³/rad], valve opening [mm²] and damping [N·m·s/rad] at a speed [rad/s].

    Of a joint that slides [mm², mm², N·s/m, m/s]. `area` is the one that pushes its cylinder's rod out [mm²];
    0: it has none.
    """

    displacement: float
    opening: float
    damping: float
    speed: float
    area: float = 0.0


def joint_sizes(arm: Arm, speeds: Mapping[int, float]) -> tuple[JointSize, ...]:
    """Return the size of every joint, (J,).

    The displacement gives the torque at the pump's pressure; the opening gives the speed while the arm is
    lifted, and both edges lose the same; the damping holds the speed at full command.

    Args:
        arm: with its model in place.
        speeds: that a log shows, by number of the joint [rad/s, m/s]; 0.5 for the others.

    Raises:
        ModelError: the arm's model cannot be read.
    """
    model = load_model(arm).compile()
    data = mujoco.MjData(model)
    low, high = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    torque, settings = np.zeros(len(arm.joints)), HydraulicSettings()
    for pose in np.random.default_rng(0).uniform(low, high, (300, len(low))):
        data.qpos[:] = pose
        mujoco.mj_forward(model, data)
        inertia = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, inertia)
        # a joint without weight must give 1 rad/s² at least
        torque = np.maximum(torque, np.maximum(LIFT * abs(data.qfrc_bias), np.diag(inertia)))
    pressure, sizes = 1e5 * settings.supply_pressure, list[JointSize]()
    through = settings.flow_coefficient * np.sqrt((1 - 1 / LIFT) * pressure / DENSITY)  # [m/s]
    for joint, most in enumerate(torque.tolist(), 1):
        speed = max(speeds.get(joint, 0.5), 0.01)
        oil, own, lever = 1e6 * most / pressure, arm.joints[joint - 1], 0.0
        if isinstance(own.actuator, LinearActuator):
            lever = np.abs(own.actuator.moment_arm(np.linspace(*own.limits, 50))).mean()
        sizes.append(
            JointSize(oil, oil * speed / through, most / speed, speed, oil / lever if lever else 0.0)
        )
    return tuple(sizes)
