"""A cylinder's two pivots, as CAD gives them -> the triangle that it spans with its joint."""

import math
from typing import Any

import numpy as np

from hydroid.settings.linkage import triangle

PIVOT_SKEW = 0.1
"""part of a cylinder's length by which its pivots may lie apart along the joint's axis: the triangle is flat,
and errs by half the square of it"""


def place_pivots(arm: dict[str, Any]) -> dict[str, Any]:
    """Return an arm's settings, as YAML gives them, with a triangle for every cylinder given by its pivots.

    What is not as it should be is left alone, for the settings' own checks to refuse.

    Raises:
        ValueError: pivots that no triangle has, or beside settings that they replace.
    """
    joints = arm.get("joints")
    if not isinstance(joints, list | tuple):
        return arm
    base = arm.get("base")
    origin = _point(base.get("at", (0, 0, 0)) if isinstance(base, dict) else (0, 0, 0))
    placed: list[Any] = []
    for joint in joints:
        at = _point(joint.get("at")) if isinstance(joint, dict) else None
        placed.append(_with_triangle(joint, origin, at) if at is not None and origin is not None else joint)
        origin = None if origin is None or at is None else origin + at
    return {**arm, "joints": tuple(placed)}


def _with_triangle(joint: dict[str, Any], origin: Any, at: Any) -> dict[str, Any]:
    """One joint; its parent lies at `origin` in the world, and it lies at `at` in its parent [m]."""
    actuator, axis = joint.get("actuator"), _point(joint.get("axis"))
    given = actuator.get("pivots") if isinstance(actuator, dict) else None
    if not isinstance(given, dict) or not isinstance(actuator, dict) or axis is None or not axis.any():
        return joint
    ends = [_point(given.get(end)) for end in ("parent", "child")]
    if ends[0] is None or ends[1] is None or given.get("frame", "link") not in ("link", "arm"):
        return joint
    name = f"joint {joint.get('name')}"
    both = [key for key in _OF_THE_TRIANGLE if key in actuator]
    if both:
        raise ValueError(f"{name}: pivots take the place of {', '.join(both)}; leave one or the other out")
    if given.get("frame") == "arm":
        ends = [ends[0] - origin, ends[1] - origin - at]
    geometry = _triangle_of(name, ends[0] - at, ends[1], axis / np.linalg.norm(axis))
    completed = {**actuator, **geometry, "pivots": None}
    limits = _numbers(joint.get("range"), 2)
    if completed.get("stroke") is None and limits is not None:
        sense = 1.0 if geometry["extends"] == "positive" else -1.0
        turned = np.radians(limits + sense * geometry["theta0"])
        lengths = triangle(turned, geometry["a"], geometry["b"], 0.0)[0]
        completed["stroke"] = max(round(1e3 * float(np.ptp(lengths)), 3), 1e-3)  # 0: a range across 180
    return {**joint, "actuator": completed}


_OF_THE_TRIANGLE = ("a", "b", "theta0", "extends", "a_on", "towards", "offset")


def _triangle_of(name: str, parent: Any, child: Any, axis: Any) -> dict[str, Any]:
    """The triangle's settings, from both pivots seen from the joint, in parallel frames."""
    heights = float(parent @ axis), float(child @ axis)
    near, far = parent - heights[0] * axis, child - heights[1] * axis
    a, b = float(np.linalg.norm(near)), float(np.linalg.norm(far))
    if min(a, b) < 1e-6:
        which = "parent" if a < 1e-6 else "child"
        raise ValueError(
            f"{name}: the pivot on the {which} lies on the joint's axis, so it has no moment arm"
        )
    length = float(np.linalg.norm(near - far))
    skew = abs(heights[0] - heights[1])
    if skew > PIVOT_SKEW * length:
        raise ValueError(
            f"{name}: its pivots lie {skew:.4g} m apart along the joint's axis and {length:.4g} m across it; "
            "a cylinder must lie across the axis"
        )
    turn = math.degrees(math.atan2(float(np.cross(near, far) @ axis), float(near @ far)))
    return {
        "a": a,
        "b": b,
        "theta0": abs(turn),
        "extends": "positive" if turn > 0 else "negative",
        "a_on": "parent",
        "towards": tuple((near / a).tolist()),
        "offset": 0.5 * sum(heights),
    }


def _point(value: Any) -> Any:
    return _numbers(value, 3)


def _numbers(value: Any, count: int) -> Any:
    """That many finite numbers as an array, shape (count,); None for anything else."""
    fits = isinstance(value, list | tuple) and len(value) == count
    plain = fits and all(isinstance(x, int | float) and not isinstance(x, bool) for x in value)
    return np.array(value, float) if plain and np.isfinite(np.array(value, float)).all() else None
