"""Where a cylinder's two pivots lie on the arm; the triangle itself is `hydroid.settings.linkage`'s."""

import math

import numpy as np
from numpy.typing import NDArray

from hydroid.settings.arm import Joint
from hydroid.settings.linkage import LinearActuator

Array = NDArray[np.float64]


def pivots(joint: Joint, actuator: LinearActuator) -> tuple[Array, Array]:
    """Place a cylinder's pivots so that the angle from the parent's to the child's is q + θ0 about the axis.

    Returns:
        The pivot on the parent link in its frame, and the one on the child in the child's [m], (3,) each.
    """
    axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
    towards = np.array(actuator.towards) - axis * (axis @ np.array(actuator.towards))
    towards /= np.linalg.norm(towards)
    theta0 = math.radians(actuator.theta0)
    turned = math.cos(theta0) * towards + math.sin(theta0) * np.cross(axis, towards)
    on_parent, on_child = (actuator.a, actuator.b) if actuator.a_on == "parent" else (actuator.b, actuator.a)
    shift = actuator.offset * axis
    return np.array(joint.at) + shift + on_parent * towards, shift + on_child * turned
