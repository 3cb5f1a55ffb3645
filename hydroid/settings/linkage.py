"""What turns a joint: a cylinder that spans a triangle with it, or a rotary actuator.
Units as on a drawing.

A cylinder's pivots lie at distances a and b from the joint's axis. The angle between
them is θ = q + θ0, so by the law of cosines the cylinder is c(q) long. By virtual work,
τ dq = F dc, its force F makes the torque τ = r F with the moment arm r = dc/dq. (The
article leaves this geometry to its CAD model; the triangle and its numbers are ours.)
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

import math
from typing import Any, Literal

import numpy as np
from pydantic import model_validator

from hydroid.settings.load import Positive, Settings

Vector = tuple[float, float, float]

# of lengths in m and angles in deg that are read off a model: what is finer is its
# rounding
DIGITS = 9


def triangle(angle, a, b, theta0, shortest=0.0) -> Any:
    """Travel x [m], moment arm r = dx/dq [m/rad] and dr/dq of a cylinder, elementwise.

    The hydraulic kernel compiles this very function.

    The pivots lie at distances a, b [m] from the joint's axis, theta0 [rad] apart at
    joint angle 0. It is below 0 if the rod runs out towards negative angles. `shortest`
    is the cylinder's length with the rod fully in [m]: with 0 the travel is the length
    itself. With b = 0 the cylinder lies along a joint that slides, by `angle` [m], and
    its moment arm is 1 or -1.
    """
    slides = (b == 0.0) * np.sign(theta0)
    theta = angle + theta0
    cosine = a * b * np.cos(theta)
    length = np.sqrt(a * a + b * b - 2.0 * cosine)
    arm = a * b * np.sin(theta) / length
    return (
        length - shortest + slides * angle,
        arm + slides,
        (cosine - arm * arm) / length,
    )


def four_bar(angle, bars) -> Any:
    """Angle ψ [rad] of a rocker that turns a joint by a coupler, dψ/dq and d²ψ/dq²,
    elementwise.

    The hydraulic kernel compiles this very function. In the parent's plane the joint's
    axis is the origin and the rocker's pivot lies at (ground, 0); ψ is the direction
    from there to the coupler's pin on the rocker. The coupler's other pin, on the
    child, lies at the angle q + phase. `bars` has ground, rocker, coupler, child [m],
    phase [rad] and `branch`, 1 or -1: the rocker's pin lies to the left or to the right
    of the line from its pivot to the child's pin. NaN where the coupler cannot reach.
    """
    along, across = (
        bars.child * np.cos(angle + bars.phase),
        bars.child * np.sin(angle + bars.phase),
    )
    square = (along - bars.ground) ** 2 + across**2
    reach = (bars.rocker**2 + square - bars.coupler**2) / (
        2.0 * bars.rocker * np.sqrt(square)
    )
    psi = np.arctan2(across, along - bars.ground) + bars.branch * np.arccos(reach)
    # with the coupler (x, y), x² + y² = coupler²: its derivatives for q give those of ψ
    cosine, sine = bars.rocker * np.cos(psi), bars.rocker * np.sin(psi)
    x, y = bars.ground + cosine - along, sine - across
    lever = y * cosine - x * sine
    first = (y * along - x * across) / lever
    dx, dy = across - first * sine, first * cosine - along
    bent = (
        dx * dx
        + dy * dy
        + x * (along - first * first * cosine)
        + y * (across - first * first * sine)
    )
    return psi, first, -bent / lever


class FourBar(Settings):
    """A rocker on the parent link, which a cylinder turns, and a coupler to the child
    link: a bucket's."""

    ground: Positive
    """distance of the rocker's pivot from the joint's axis [m]"""
    rocker: Positive
    """length of the rocker, from its pivot to the coupler's pin [m]"""
    coupler: Positive
    """length of the coupler [m]"""
    child: Positive
    """distance of the coupler's pin on the child link from the joint's axis [m]"""
    phase_deg: float
    """angle at the joint from the rocker's pivot to the pin on the child link, at joint
    angle 0 [deg]"""
    side: Literal["left", "right"]
    """side of the line from the rocker's pivot to the pin on the child link on which
    the rocker's pin lies"""

    @property
    def branch(self) -> float:
        """1 for left, -1 for right."""
        if self.side == "left":
            return 1.0
        return -1.0

    @property
    def phase(self) -> float:
        """The same as `phase_deg` [rad]."""
        return math.radians(self.phase_deg)


class Pivots(Settings):
    """The points where a cylinder is pinned in the assembled arm: in the world, with
    all joints at 0."""

    parent: Vector
    """pivot on the parent link (the base for the first joint) [m]"""
    child: Vector
    """pivot on the link that the joint moves [m]"""


class Triangle(Settings):
    """The triangle of a cylinder's two pivots and the axis that it turns about."""

    a: Positive
    """distance of one pivot from the axis [m]"""
    b: Positive
    """distance of the other pivot from the axis [m]"""
    theta0: float
    """angle between the two pivots at angle 0 [deg]; below 0 if the rod runs out
    towards negative angles, to which a positive command then turns the joint"""


class Cylinder(Settings):
    """A cylinder."""

    kind: Literal["linear"]
    """linear: a cylinder"""
    pivots: Pivots | None = None
    """both pivots; null: the sites JOINT_pivot_parent and JOINT_pivot_child of the
    model, or `triangle`"""
    triangle: Triangle | None = None
    """in place of pivots; with `four_bar` that at the rocker's pivot, with the rocker's
    angle"""
    four_bar: FourBar | None = None
    """linkage between cylinder and joint, with its `triangle`; null: the cylinder acts
    on the joint itself"""
    stroke: Positive | None = None
    """stroke of the rod [mm]; null: what the joint's range takes"""
    area_a: Positive
    """piston area that pushes the rod out [mm²]"""
    area_b: Positive
    """annulus area on the rod side [mm²]"""
    max_opening: Positive
    """largest valve opening [mm²]"""

    @model_validator(mode="after")
    def _one_geometry(self) -> "Cylinder":
        if self.pivots is not None and self.triangle is not None:
            raise ValueError("pivots take the place of triangle: give one")
        if self.four_bar is not None and self.triangle is None:
            raise ValueError("four_bar needs a triangle")
        return self


class RotaryActuator(Settings):
    """A rotary vane or piston actuator on the joint's axis; of a joint that slides one
    of equal areas."""

    kind: Literal["rotary"]
    """rotary: a vane or piston actuator on the joint's axis"""
    displacement: Positive
    """oil per angle [cm³/rad], or area of a joint that slides [mm²]"""
    max_opening: Positive
    """largest valve opening [mm²]"""
