"""What turns a joint: a cylinder that spans a triangle with it, or a rotary actuator. Units as on a drawing.

A cylinder's pivots lie at distances a and b from the joint's axis. The angle between them is θ = q + θ0, so
by the law of cosines the cylinder is c(q) long. By virtual work, τ dq = F dc, its force F makes the torque
τ = r F with the moment arm r = dc/dq. (The article leaves this geometry to its CAD model; the triangle and
its numbers are ours.)
"""

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator

from hydroid.settings.load import Positive, Settings

Vector = tuple[float, float, float]


def _direction(value: Vector) -> Vector:
    if not any(value):
        raise ValueError("a direction cannot be (0, 0, 0)")
    return value


Direction = Annotated[Vector, AfterValidator(_direction)]


def triangle(angle: Any, a: Any, b: Any, theta0: Any, shortest: Any = 0.0) -> Any:
    """Travel x [m], moment arm r = dx/dq [m/rad] and dr/dq of a cylinder, elementwise.

    The hydraulic kernel compiles this very function.

    The pivots lie at distances a, b [m] from the joint's axis, theta0 [rad] apart at joint angle 0. It is
    below 0 if the rod runs out towards negative angles.
    `shortest` is the cylinder's length with the rod fully in [m]: with 0 the travel is the length itself.
    """
    theta = angle + theta0
    cosine = a * b * np.cos(theta)
    length = np.sqrt(a * a + b * b - 2.0 * cosine)
    arm = a * b * np.sin(theta) / length
    return length - shortest, arm, (cosine - arm * arm) / length


def four_bar(angle: Any, bars: Any) -> Any:
    """Angle ψ [rad] of a rocker that turns a joint by a coupler, dψ/dq and d²ψ/dq², elementwise.

    The hydraulic kernel compiles this very function. In the parent's plane the joint's axis is the origin and
    the rocker's pivot lies at (ground, 0); ψ is the direction from there to the coupler's pin on the rocker.
    The coupler's other pin, on the child, lies at the angle q + phase. `bars` has ground, rocker, coupler,
    child [m], phase [rad] and `branch`, 1 or -1: the rocker's pin lies to the left or to the right of the
    line from its pivot to the child's pin. NaN where the coupler cannot reach.
    """
    along, across = bars.child * np.cos(angle + bars.phase), bars.child * np.sin(angle + bars.phase)
    square = (along - bars.ground) ** 2 + across**2
    reach = (bars.rocker**2 + square - bars.coupler**2) / (2.0 * bars.rocker * np.sqrt(square))
    psi = np.arctan2(across, along - bars.ground) + bars.branch * np.arccos(reach)
    # with the coupler (x, y), x² + y² = coupler²: its derivatives for q give those of ψ
    cosine, sine = bars.rocker * np.cos(psi), bars.rocker * np.sin(psi)
    x, y = bars.ground + cosine - along, sine - across
    lever = y * cosine - x * sine
    first = (y * along - x * across) / lever
    dx, dy = across - first * sine, first * cosine - along
    bent = dx * dx + dy * dy + x * (along - first * first * cosine) + y * (across - first * first * sine)
    return psi, first, -bent / lever


STROKE_TOLERANCE = 0.02
"""part of the travel that a stroke may lack, since catalogues round: the cylinder then stops first"""


class FourBar(Settings):
    """A rocker on the parent link, which a cylinder turns, and a coupler to the child link: a bucket's."""

    ground: Positive
    """distance of the rocker's pivot from the joint's axis [m]"""
    rocker: Positive
    """length of the rocker, from its pivot to the coupler's pin [m]"""
    coupler: Positive
    """length of the coupler [m]"""
    child: Positive
    """distance of the coupler's pin on the child link from the joint's axis [m]"""
    phase_deg: float
    """angle at the joint from the rocker's pivot to the pin on the child link, at joint angle 0 [deg]"""
    side: Literal["left", "right"]
    """side of the line from the rocker's pivot to the pin on the child link on which the rocker's pin lies"""

    @property
    def branch(self) -> float:
        """1 for left, -1 for right."""
        return 1.0 if self.side == "left" else -1.0

    @property
    def phase(self) -> float:
        """The same as `phase_deg` [rad]."""
        return math.radians(self.phase_deg)


class Pivots(Settings):
    """The two points where a cylinder is pinned, as CAD gives them."""

    parent: Vector
    """pivot on the parent link (the base for the first joint) [m]"""
    child: Vector
    """pivot on the link that the joint moves [m]"""
    frame: Literal["link", "arm"] = "link"
    """link: each point in the frame of its link; arm: both in the world, with all joints at angle 0"""


class LinearActuator(Settings):
    """A cylinder that spans a triangle with the joint."""

    kind: Literal["linear"]
    """linear: a cylinder"""
    pivots: Pivots | None = None
    """both pivots as points, in place of a, b, theta0, extends, a_on, towards and offset"""
    a: Positive
    """distance of one pivot from the joint's axis [m]"""
    b: Positive
    """distance of the other pivot from the joint's axis [m]"""
    theta0: float
    """angle between the two pivots at joint angle 0 [deg]"""
    extends: Literal["positive", "negative"] = "positive"
    """direction in which the joint turns when the rod runs out: with negative the angle between the pivots is
    theta0 - q, and a positive command turns the joint to negative angles"""
    stroke: Positive
    """stroke of the rod [mm]; with `pivots` it may be left out, and is what the joint's range takes"""
    four_bar: FourBar | None = None
    """linkage between cylinder and joint; a, b and theta0 are then those of the triangle at the rocker's
    pivot, with the rocker's angle for the joint's; null: the cylinder acts on the joint itself"""
    area_a: Positive
    """piston area that pushes the rod out [mm²]"""
    area_b: Positive
    """annulus area on the rod side [mm²]"""
    max_opening: Positive
    """largest valve opening [mm²]"""
    a_on: Literal["parent", "child"] = "parent"
    """link that carries the pivot at distance a; the other link carries the pivot at distance b"""
    towards: Direction
    """direction from the joint to the pivot on the parent link, in its frame; the part along the axis is
    ignored"""
    offset: float = 0.0
    """distance of both pivots from the joint's origin along its axis [m]"""

    @property
    def sense(self) -> float:
        """1 if the rod runs out towards positive angles, else -1."""
        return 1.0 if self.extends == "positive" else -1.0

    def length(self, angle: Any) -> Any:
        """Distance between the pivots [m] at joint angles [rad] of any shape."""
        return self._cylinder(angle)[0]

    def moment_arm(self, angle: Any) -> Any:
        """Torque per force, and rod speed per joint speed [m], at joint angles [rad] of any shape."""
        return self._cylinder(angle)[1]

    def _cylinder(self, angle: Any) -> tuple[Any, Any]:
        theta0 = self.sense * math.radians(self.theta0)
        if self.four_bar is None:
            return triangle(angle, self.a, self.b, theta0)[:2]
        psi, first, _ = four_bar(angle, self.four_bar)
        length, arm, _ = triangle(psi, self.a, self.b, theta0)
        return length, arm * first


class RotaryActuator(Settings):
    """A rotary vane or piston actuator on the joint's axis."""

    kind: Literal["rotary"]
    """rotary: a vane or piston actuator on the joint's axis"""
    displacement: Positive
    """oil per angle [cm³/rad]"""
    max_opening: Positive
    """largest valve opening [mm²]"""
