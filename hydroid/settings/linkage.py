"""What turns a joint: a cylinder that spans a triangle with it, or a rotary actuator. Units as on a drawing.

A cylinder's pivots lie at distances a and b from the joint's axis. The angle between them is θ = q + θ0, so
by the law of cosines the cylinder is c(q) long. By virtual work, τ dq = F dc, its force F makes the torque
τ = r F with the moment arm r = dc/dq. (The article leaves this geometry to its CAD model; the triangle and
its numbers are ours.)
"""

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from hydroid.settings.load import Positive, Settings

if TYPE_CHECKING:
    import mujoco

Vector = tuple[float, float, float]
Array = NDArray[np.float64]

DIGITS = 9
"""of lengths in m and angles in deg that are read off a model: what is finer is its rounding"""


def triangle(angle: Any, a: Any, b: Any, theta0: Any, shortest: Any = 0.0) -> Any:
    """Travel x [m], moment arm r = dx/dq [m/rad] and dr/dq of a cylinder, elementwise.

    The hydraulic kernel compiles this very function.

    The pivots lie at distances a, b [m] from the joint's axis, theta0 [rad] apart at joint angle 0. It is
    below 0 if the rod runs out towards negative angles.
    `shortest` is the cylinder's length with the rod fully in [m]: with 0 the travel is the length itself.
    With b = 0 the cylinder lies along a joint that slides, by `angle` [m], and its moment arm is 1 or -1.
    """
    slides = (b == 0.0) * np.sign(theta0)
    theta = angle + theta0
    cosine = a * b * np.cos(theta)
    length = np.sqrt(a * a + b * b - 2.0 * cosine)
    arm = a * b * np.sin(theta) / length
    return length - shortest + slides * angle, arm + slides, (cosine - arm * arm) / length


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
    """The points where a cylinder is pinned in the assembled arm: in the world, with all joints at 0."""

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
    """angle between the two pivots at angle 0 [deg]; below 0 if the rod runs out towards negative angles, to
    which a positive command then turns the joint"""


class Cylinder(Settings):
    """A cylinder."""

    kind: Literal["linear"]
    """linear: a cylinder"""
    pivots: Pivots | None = None
    """both pivots; null: the sites JOINT_pivot_parent and JOINT_pivot_child of the model, or `triangle`"""
    triangle: Triangle | None = None
    """in place of pivots; with `four_bar` that at the rocker's pivot, with the rocker's angle"""
    four_bar: FourBar | None = None
    """linkage between cylinder and joint, with its `triangle`; null: the cylinder acts on the joint itself"""
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
    """A rotary vane or piston actuator on the joint's axis; of a joint that slides one of equal areas."""

    kind: Literal["rotary"]
    """rotary: a vane or piston actuator on the joint's axis"""
    displacement: Positive
    """oil per angle [cm³/rad], or area of a joint that slides [mm²]"""
    max_opening: Positive
    """largest valve opening [mm²]"""


@dataclass(frozen=True)
class LinearActuator:
    """A cylinder and the triangle that it spans with its joint, or with the rocker of a four-bar linkage.

    Attributes:
        settings: areas, valve opening and linkage.
        triangle: of its pivots, `a` at least `b`.
        stroke: of the rod [mm].
        pivots: on the parent and on the moved link, in their frames [m]; None where only distances are given.
    """

    kind: ClassVar[str] = "linear"
    settings: Cylinder
    triangle: Triangle
    stroke: float
    pivots: tuple[Vector, Vector] | None = None

    @property
    def sense(self) -> float:
        """1 if the rod runs out towards positive angles, else -1."""
        return math.copysign(1.0, self.triangle.theta0)

    def length(self, angle: Any) -> Any:
        """Distance between the pivots [m] at joint angles [rad] of any shape."""
        return self._cylinder(angle)[0]

    def moment_arm(self, angle: Any) -> Any:
        """Torque per force, and rod speed per joint speed [m], at joint angles [rad] of any shape."""
        return self._cylinder(angle)[1]

    def _cylinder(self, angle: Any) -> tuple[Any, Any]:
        sides, bars = self.triangle, self.settings.four_bar
        psi, first, _ = (angle, 1.0, 0.0) if bars is None else four_bar(angle, bars)
        length, arm, _ = triangle(psi, sides.a, sides.b, math.radians(sides.theta0))
        return length, arm * first


def make_cylinder(
    settings: Cylinder,
    limits: tuple[float, float],
    data: "mujoco.MjData | None" = None,
    joint: str = "",
    *,
    slides: bool = False,
) -> LinearActuator:
    """Return a cylinder that moves its joint through a range [rad], or along it [m] where the joint `slides`.

    `data` has all joints of the arm at 0; a cylinder whose triangle is given, or along its joint, needs none.

    Raises:
        ValueError: pivots that are not stated or make no triangle, a dead centre in the range, a linkage that
            does not reach, or a stroke that is too short.
    """
    sides, pivots = settings.triangle, None
    if slides:
        if settings.triangle or settings.four_bar:
            raise ValueError("its joint slides, so it lies along it: give neither triangle nor four_bar")
        sides = _along(settings.pivots, data, joint)
    elif sides is None:
        sides, pivots = _pinned(settings.pivots, data, joint)
    sides = sides.model_copy(update={"a": max(sides.a, sides.b), "b": min(sides.a, sides.b)})
    cylinder = LinearActuator(settings, sides, 0.0, pivots)
    angles = np.linspace(*limits, 181)
    with np.errstate(all="ignore"):
        arm = np.asarray(cylinder.moment_arm(angles))
        bars = np.asarray(four_bar(angles, settings.four_bar)[1]) if settings.four_bar else np.ones(1)
    # beyond a dead centre the moment arm has another sign
    if not ((bars * bars[0] > 0).all() and (arm * arm[0] > 0).all()):
        what = "does not reach all of its range, or has a dead centre in it"
        raise ValueError(f"its {'four-bar linkage' if settings.four_bar else 'cylinder'} {what}")
    needed = 1e3 * float(np.ptp(cylinder.length(np.array(limits))))
    stroke = settings.stroke or round(needed, 3)
    if stroke < 0.98 * needed:  # catalogues round: the cylinder then stops first
        raise ValueError(f"a stroke of {stroke:g} mm is too short for the range, which needs {needed:.1f} mm")
    return replace(cylinder, stroke=stroke)


def _along(given: Pivots | None, data: Any, joint: str) -> Triangle:
    """Return what stands for the triangle of a cylinder along its joint: b is 0.

    The rod runs out forward unless pivots say otherwise.
    """
    way = 1.0 if given is None else float(np.subtract(given.child, given.parent) @ data.joint(joint).xaxis)
    return Triangle.model_construct(a=1.0, b=0.0, theta0=90.0 if way > 0 else -90.0)


def _pinned(given: Pivots | None, data: Any, joint: str) -> tuple[Triangle, tuple[Vector, Vector]]:
    """The triangle of a cylinder's pivots, and these in the frames of parent and moved body [m]."""
    if given is not None:
        ends = np.array([given.parent, given.child])
    else:
        try:
            ends = np.array([data.site(f"{joint}_pivot_{end}").xpos for end in ("parent", "child")])
        except KeyError as error:
            name = str(error).split("'")[1]
            raise ValueError(f"the model has no site {name}; add it, or give pivots") from None
    at, child = data.joint(joint), int(data.model.joint(joint).bodyid[0])
    bodies = int(data.model.body_parentid[child]), child
    local = [data.xmat[b].reshape(3, 3).T @ (e - data.xpos[b]) for b, e in zip(bodies, ends, strict=True)]
    parent, moved = (tuple(place.round(DIGITS).tolist()) for place in local)
    return _triangle(ends - at.xanchor, at.xaxis), (parent, moved)


def _triangle(ends: Array, axis: Array) -> Triangle:
    """The triangle of two pivots, (2, 3), seen from the joint at angle 0 [m], and the joint's axis, (3,)."""
    heights = ends @ axis
    near, far = flat = ends - np.outer(heights, axis)
    a, b = np.linalg.norm(flat, axis=1).tolist()
    if min(a, b) < 1e-6:
        which = "parent" if a < 1e-6 else "child"
        raise ValueError(f"the pivot on the {which} lies on the joint's axis, so it has no moment arm")
    length, skew = float(np.linalg.norm(near - far)), float(np.ptp(heights))
    if skew > 0.1 * length:  # the triangle is flat, and errs by half the square of this part
        raise ValueError(
            f"its pivots lie {skew:.4g} m apart along the joint's axis and {length:.4g} m across it; "
            "a cylinder must lie across the axis"
        )
    turn = round(math.degrees(math.atan2(float(np.cross(near, far) @ axis), float(near @ far))), DIGITS)
    return Triangle(a=round(a, DIGITS), b=round(b, DIGITS), theta0=turn)
