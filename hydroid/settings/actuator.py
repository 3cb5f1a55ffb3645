"""What turns a joint: a cylinder on a triangle, or a rotary actuator; units as on a drawing."""

import math
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from hydroid.settings.load import Settings

Positive = Annotated[float, Field(gt=0)]
Vector = tuple[float, float, float]


def _direction(value: Vector) -> Vector:
    if not any(value):
        raise ValueError("a direction cannot be (0, 0, 0)")
    return value


Direction = Annotated[Vector, AfterValidator(_direction)]

# catalogue strokes are round numbers: one a little short of the joint's range is an end stop, not a slip
STROKE_TOLERANCE = 0.02


class LinearActuator(Settings):
    """A cylinder that spans a triangle with the joint; `a`, `b` are the pivots' distances from its axis."""

    kind: Literal["linear"]
    a: Positive
    """[m]"""
    b: Positive
    """[m]"""
    theta0: float
    """angle between the two pivots at joint angle 0 [deg]"""
    stroke: Positive
    """[mm]"""
    area_a: Positive
    """piston area that pushes the joint to positive angles [mm²]"""
    area_b: Positive
    """annulus area on the rod side [mm²]"""
    max_opening: Positive
    """largest valve opening [mm²]"""
    a_on: Literal["parent", "child"] = "parent"
    """the link that carries the pivot at distance a; the other carries b"""
    towards: Direction
    """from the joint to the pivot on the parent link, in its frame; the part along the axis is dropped"""
    offset: float = 0.0
    """of both pivots along the joint's axis [m]"""

    def length(self, theta: float) -> float:
        """Distance between the pivots [m] at the angle `theta` [rad] between them."""
        return math.sqrt(self.a**2 + self.b**2 - 2 * self.a * self.b * math.cos(theta))


class RotaryActuator(Settings):
    """A rotary vane or piston actuator on the joint's axis."""

    kind: Literal["rotary"]
    displacement: Positive
    """[cm³/rad]"""
    max_opening: Positive
    """largest valve opening [mm²]"""
