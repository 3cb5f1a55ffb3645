"""A cylinder with the triangle that it spans, from its settings and the pivots that the
arm's model shows."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from hydroid.arrays import Array, Limits, record
from hydroid.settings.linkage import (
    DIGITS,
    Cylinder,
    Pivots,
    Triangle,
    Vector,
    four_bar,
    triangle,
)


@record
class LinearActuator:
    """A cylinder and the triangle that it spans with its joint, or with the rocker of a
    four-bar linkage.

    Of the triangle `a` is at least `b`; the stroke is the rod's [mm]; the pivots are on
    the parent and on the moved link, in their frames [m], None where only distances are
    given.
    """

    settings: Cylinder
    triangle: Triangle
    stroke: float
    pivots: tuple[Vector, Vector] | None = None

    @property
    def sense(self) -> float:
        """1 if the rod runs out towards positive angles at angle 0, else -1."""
        return math.copysign(1.0, self.triangle.theta0)

    def length(self, angle: Any) -> Any:
        """Distance between the pivots [m] at joint angles [rad] of any shape."""
        return self._cylinder(angle)[0]

    def moment_arm(self, angle: Any) -> Any:
        """Torque per force, and rod speed per joint speed [m], at joint angles [rad] of
        any shape."""
        return self._cylinder(angle)[1]

    def _cylinder(self, angle: Any) -> tuple[Any, Any]:
        sides = self.triangle
        crank = angle
        slope = 1.0
        if self.settings.four_bar is not None:
            crank, slope, _ = four_bar(angle, self.settings.four_bar)
        length, arm, _ = triangle(crank, sides.a, sides.b, math.radians(sides.theta0))
        return length, arm * slope


def make_cylinder(
    settings: Cylinder,
    limits: Limits,
    data: Any = None,
    joint: str = "",
    *,
    slides: bool = False,
) -> LinearActuator:
    """Return a cylinder that moves its joint through a range [rad], or along it [m]
    where the joint `slides`.

    MuJoCo's `data` has all joints of the arm at 0; a cylinder whose triangle is given
    needs none, nor one that lies along its joint and has no pivots.
    """
    sides = settings.triangle
    pivots = None
    if slides:
        sides = _along_joint(settings, data, joint)
    elif sides is None:
        sides, pivots = _pinned(settings.pivots, data, joint)
    # the law is the same for both orders; b = 0 marks a joint that slides
    longer = max(sides.a, sides.b)
    shorter = min(sides.a, sides.b)
    sides = sides.changed({"a": longer, "b": shorter})
    cylinder = LinearActuator(settings, sides, 0.0, pivots)
    _refuse_dead_centre(cylinder, limits)
    lengths = cylinder.length(np.array(limits))
    needed = 1e3 * float(np.ptp(lengths))
    stroke = settings.stroke or round(needed, 3)
    # catalogues round: the cylinder then stops first
    if stroke < 0.98 * needed:
        raise ValueError(
            f"a stroke of {stroke:g} mm is too short for the range, which needs {needed:.1f} mm"
        )
    return replace(cylinder, stroke=stroke)


def _along_joint(settings: Cylinder, data: Any, joint: str) -> Triangle:
    """Return the triangle of a cylinder that lies along its sliding joint."""
    if settings.triangle or settings.four_bar:
        raise ValueError(
            "its joint slides, so it lies along it: give neither triangle nor four_bar"
        )
    pivots = settings.pivots
    is_forward = True
    if pivots is not None:
        rod = np.subtract(pivots.child, pivots.parent)
        is_forward = rod @ data.joint(joint).xaxis > 0
    # with b = 0 and a = 1 the length is the sine of theta0 times the way
    theta0 = 90.0 if is_forward else -90.0
    return Triangle.model_construct(a=1.0, b=0.0, theta0=theta0)


def _refuse_dead_centre(cylinder: LinearActuator, limits: Limits) -> None:
    """Raise ValueError where a cylinder or its linkage does not reach all of a range,
    or has a dead centre in it."""
    bars = cylinder.settings.four_bar
    angles = np.linspace(*limits, 181)
    with np.errstate(all="ignore"):
        arms = cylinder.moment_arm(angles)
        slopes = four_bar(angles, bars)[1] if bars else np.ones(1)
    # beyond a dead centre the moment arm has another sign
    if _keeps_sign(arms) and _keeps_sign(slopes):
        return
    which = "four-bar linkage" if bars else "cylinder"
    what = "does not reach all of its range, or has a dead centre in it"
    raise ValueError(f"its {which} {what}")


def _keeps_sign(values: Array) -> bool:
    """Return whether all values have the sign of the first; false of one that is
    NaN."""
    return bool((values * values[0] > 0).all())


def _pinned(
    given: Pivots | None, data: Any, joint: str
) -> tuple[Triangle, tuple[Vector, Vector]]:
    """Return the triangle of a cylinder's pivots, and these in the frames of parent and
    moved body [m]."""
    ends = _pivot_ends(given, data, joint)
    child = data.model.joint(joint).bodyid[0]
    parent = data.model.body_parentid[child]
    in_parent = _in_body(data, parent, ends[0])
    in_child = _in_body(data, child, ends[1])
    axis = data.joint(joint).xaxis
    ends = ends - data.joint(joint).xanchor
    heights = ends @ axis
    near, far = flat = ends - np.outer(heights, axis)
    a, b = np.linalg.norm(flat, axis=1).tolist()
    if min(a, b) < 1e-6:
        which = "parent" if a < 1e-6 else "child"
        raise ValueError(
            f"the pivot on the {which} lies on the joint's axis, so it has no moment arm"
        )
    length = np.linalg.norm(near - far)
    skew = np.ptp(heights)
    # the triangle is flat, and errs by half the square of this part
    if skew > 0.1 * length:
        raise ValueError(
            f"its pivots lie {skew:.4g} m apart along the joint's axis and {length:.4g} m across it; "
            "a cylinder must lie across the axis"
        )
    sine = np.cross(near, far) @ axis
    angle = math.degrees(math.atan2(sine, near @ far))
    theta0 = round(angle, DIGITS)
    sides = Triangle(a=round(a, DIGITS), b=round(b, DIGITS), theta0=theta0)
    return sides, (in_parent, in_child)


def _pivot_ends(given: Pivots | None, data: Any, joint: str) -> Array:
    """Return where a joint's pivots are [m], shape (2, 3): as given, or at the model's
    sites."""
    if given is not None:
        return np.array([given.parent, given.child])
    names = [f"{joint}_pivot_{end}" for end in ("parent", "child")]
    try:
        return np.array([data.site(name).xpos for name in names])
    except KeyError as error:
        name = str(error).split("'")[1]
        what = f"the model has no site {name}; add it, or give pivots"
        raise ValueError(what) from None


def _in_body(data: Any, body: int, point: Array) -> Vector:
    """Return a point of the world [m], (3,), in the frame of a body, rounded as files
    state it."""
    frame = data.xmat[body].reshape(3, 3)
    turned = frame.T @ (point - data.xpos[body])
    return tuple(turned.round(DIGITS).tolist())
