"""A cylinder with the triangle that it spans, from its settings and the pivots that the
arm's model shows."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from hydroid.arrays import record
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
        sides, bars = self.triangle, self.settings.four_bar
        psi, first, _ = (angle, 1.0, 0.0) if bars is None else four_bar(angle, bars)
        length, arm, _ = triangle(psi, sides.a, sides.b, math.radians(sides.theta0))
        return length, arm * first


def make_cylinder(
    settings: Cylinder,
    limits: tuple[float, float],
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
    sides, pivots = settings.triangle, None
    if slides:
        if settings.triangle or settings.four_bar:
            raise ValueError(
                "its joint slides, so it lies along it: give neither triangle nor four_bar"
            )
        # along the joint b is 0; by default the rod runs out forward
        given, way = settings.pivots, 1.0
        if given is not None:
            way = np.subtract(given.child, given.parent) @ data.joint(joint).xaxis
        sides = Triangle.model_construct(
            a=1.0, b=0.0, theta0=90.0 if way > 0 else -90.0
        )
    elif sides is None:
        sides, pivots = _pinned(settings.pivots, data, joint)
    sides = sides.changed({"a": max(sides.a, sides.b), "b": min(sides.a, sides.b)})
    cylinder = LinearActuator(settings, sides, 0.0, pivots)
    angles = np.linspace(*limits, 181)
    with np.errstate(all="ignore"):
        arm = cylinder.moment_arm(angles)
        bars = (
            four_bar(angles, settings.four_bar)[1] if settings.four_bar else np.ones(1)
        )
    # beyond a dead centre the moment arm has another sign
    if not ((bars * bars[0] > 0).all() and (arm * arm[0] > 0).all()):
        what = "does not reach all of its range, or has a dead centre in it"
        raise ValueError(
            f"its {'four-bar linkage' if settings.four_bar else 'cylinder'} {what}"
        )
    needed = 1e3 * float(np.ptp(cylinder.length(np.array(limits))))
    stroke = settings.stroke or round(needed, 3)
    if stroke < 0.98 * needed:  # catalogues round: the cylinder then stops first
        raise ValueError(
            f"a stroke of {stroke:g} mm is too short for the range, which needs {needed:.1f} mm"
        )
    return replace(cylinder, stroke=stroke)


def _pinned(
    given: Pivots | None, data: Any, joint: str
) -> tuple[Triangle, tuple[Vector, Vector]]:
    """The triangle of a cylinder's pivots, and these in the frames of parent and moved
    body [m]."""
    if given is not None:
        ends = np.array([given.parent, given.child])
    else:
        try:
            ends = np.array(
                [data.site(f"{joint}_pivot_{end}").xpos for end in ("parent", "child")]
            )
        except KeyError as error:
            name = str(error).split("'")[1]
            raise ValueError(
                f"the model has no site {name}; add it, or give pivots"
            ) from None
    at, child = data.joint(joint), data.model.joint(joint).bodyid[0]
    bodies = data.model.body_parentid[child], child
    local = [
        data.xmat[b].reshape(3, 3).T @ (e - data.xpos[b])
        for b, e in zip(bodies, ends, strict=True)
    ]
    parent, moved = (tuple(place.round(DIGITS).tolist()) for place in local)
    ends, axis = ends - at.xanchor, at.xaxis
    heights = ends @ axis
    near, far = flat = ends - np.outer(heights, axis)
    a, b = np.linalg.norm(flat, axis=1).tolist()
    if min(a, b) < 1e-6:
        which = "parent" if a < 1e-6 else "child"
        raise ValueError(
            f"the pivot on the {which} lies on the joint's axis, so it has no moment arm"
        )
    length, skew = np.linalg.norm(near - far), np.ptp(heights)
    # the triangle is flat, and errs by half the square of this part
    if skew > 0.1 * length:
        raise ValueError(
            f"its pivots lie {skew:.4g} m apart along the joint's axis and {length:.4g} m across it; "
            "a cylinder must lie across the axis"
        )
    turn = round(
        math.degrees(math.atan2(np.cross(near, far) @ axis, near @ far)), DIGITS
    )
    return Triangle(a=round(a, DIGITS), b=round(b, DIGITS), theta0=turn), (
        parent,
        moved,
    )
