"""From joint angle to cylinder: the triangle of a linear actuator, the constant of a rotary one.

The pivots lie at distances a and b from the joint's axis and the angle between them is θ = q + θ0, so that by
the law of cosines the cylinder is c(q) long, and by virtual work τ dq = F dc its force F makes the torque
τ = r F with the moment arm r = dc/dq. (The article leaves this geometry to its CAD model; the triangle and
its numbers are ours.)
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydroid.settings.arm import Joint, LinearActuator

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Cylinder:
    """A linear actuator's triangle; angles q [rad] of any shape, results of the same shape."""

    a: float
    """[m]"""
    b: float
    """[m]"""
    theta0: float
    """angle between the pivots at q = 0 [rad]"""
    start: float
    """joint angle at which the rod is fully in [rad]"""

    def length(self, q: Array) -> Array:
        """Distance between the pivots c = √(a² + b² − 2ab cos θ) [m]."""
        return np.sqrt(self.a**2 + self.b**2 - 2 * self.a * self.b * np.cos(q + self.theta0))

    def moment_arm(self, q: Array) -> Array:
        """Moment arm r = dc/dq = ab sin θ / c [m]: torque per force, and rod speed per joint speed."""
        return self.a * self.b * np.sin(q + self.theta0) / self.length(q)

    def travel(self, q: Array) -> Array:
        """How far the rod is out, x = c − c_min [m]."""
        return self.length(q) - self.length(np.asarray(self.start))


@dataclass(frozen=True)
class Rotary:
    """A rotary actuator: torque per pressure and flow per speed are one constant."""

    displacement: float
    """D_m [m³/rad]"""

    def moment_arm(self, q: Array) -> Array:
        """D_m at every angle [m³/rad]: torque per pressure difference, and flow per joint speed."""
        return np.full_like(q, self.displacement)


def linkage(joint: Joint) -> Cylinder | Rotary:
    """Return a joint's linkage in SI."""
    actuator = joint.actuator
    if isinstance(actuator, LinearActuator):
        return Cylinder(actuator.a, actuator.b, math.radians(actuator.theta0), math.radians(joint.range[0]))
    return Rotary(1e-6 * actuator.displacement)


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
