"""A picture to check an arm by: two views with axes and pivots, and the lengths of its cylinders."""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull, QhullError

from hydroid.arm.model import load_model
from hydroid.arrays import Array
from hydroid.reporting.chart import SERIES
from hydroid.reporting.figure import SHADES, legend, saved, style
from hydroid.reporting.outlines import Shape, body_poses, placed, shapes, sight
from hydroid.settings.arm import Arm
from hydroid.settings.cylinder import LinearActuator

VIEWS = {"from the right (-y)": (0.0, "z [m]"), "from above": (-90.0, "y [m]")}
"""elevation of the sight [deg], and what points upwards; x points to the right"""
ACROSS = 0.7
"""part of an axis's direction that points out of the picture, from which on its sense of rotation is named"""


def arm_picture(arm: Arm, title: str) -> tuple[bytes, bytes]:
    """Draw an arm with all joints at 0, or at the ends of their ranges that are nearest to it; PNG and SVG.
    Raises ModelError: its model cannot be read.
    """
    model = load_model(arm).compile()
    data, angles = mujoco.MjData(model), np.clip(0.0, arm.lower, arm.upper)
    data.qpos[:] = angles
    mujoco.mj_forward(model, data)
    (poses,) = body_poses(model, angles[None])
    outlines = [Shape(shape.body, shape.placed(poses)) for shape in shapes(model)]
    linear = [
        one.actuator if isinstance(one.actuator, LinearActuator) and not one.slides else None
        for one in arm.joints
    ]
    cylinders = any(linear)
    with style():
        drawing = Figure((7.2, 7.5 if cylinders else 4.4), layout="constrained")
        axes: Any = drawing.subplots(2 if cylinders else 1, 2, squeeze=False)
        for one, name in zip(axes[0], VIEWS, strict=True):
            _view(one, arm, data, outlines, poses, name)
        for number, (joint, linkage) in enumerate(zip(arm.joints, linear, strict=True)):
            if linkage is not None:
                angle, look = np.linspace(*joint.range, 181), {"color": _color(number), "label": joint.name}
                axes[1, 0].plot(angle, linkage.length(np.radians(angle)), **look)
                axes[1, 1].plot(angle, linkage.moment_arm(np.radians(angle)), **look)
        if cylinders:
            x = "joint angle [deg]"
            axes[1, 0].set(xlabel=x, ylabel="pivot to pivot [m]", title="lengths of the cylinders")
            axes[1, 1].set(xlabel=x, ylabel="moment arm [m]", title="moment arms, 0 at a dead centre")
            axes[1, 1].axhline(0.0, color="grey", lw=1)
        legend(drawing)
        return saved(drawing, title)


def _view(axes: Axes, arm: Arm, data: Any, outlines: Sequence[Shape], poses: Array, name: str) -> None:
    """Draw links, joints' axes and pivots in one of the VIEWS; the outlines' corners are in the world."""
    elevation, upwards = VIEWS[name]
    *across, ahead = sight(90.0, elevation)
    model, onto = data.model, np.transpose(across)
    moved_by = model.body_jntadr[model.body_weldid].tolist()
    for shape in outlines:
        joint = moved_by[shape.body]
        color, label = ("grey", None) if joint < 0 else (_color(joint), arm.joint_names[joint])
        axes.fill(*_outline(shape.corners @ onto).T, fc=color, ec=color, alpha=0.45, label=label)
    for child, joint in zip(model.jnt_bodyid.tolist(), arm.joints, strict=True):
        if isinstance(joint.actuator, LinearActuator) and joint.actuator.pivots is not None:
            bodies = [model.body_parentid[child], child]
            ends = placed(np.array(joint.actuator.pivots)[:, None], poses[bodies])[:, 0]
            axes.plot(*(ends @ onto).T, "o-", color="black", lw=3, ms=4)
    size = 0.12 * (np.ptp(data.xipos[1:], axis=0).max() + np.ptp(data.xanchor, axis=0).max() + 0.1)
    for number, (joint, at, axis) in enumerate(zip(arm.joints, data.xanchor, data.xaxis, strict=True)):
        sense = "turns counter-clockwise" if axis @ ahead < 0 else "turns clockwise"
        sense = "slides along the line" if joint.slides else sense
        text = f"{joint.name}: + {sense}" if joint.slides != (abs(axis @ ahead) > ACROSS) else joint.name
        axes.plot(*(np.array([at - size * axis, at + size * axis]) @ onto).T, "D-", color="black", lw=1, ms=4)
        # a step up from joint to joint: names of neighbours do not meet
        place = (4, 4 + 11 * number)
        label = axes.annotate(text, at @ onto, place, fontsize=7, textcoords="offset points")
        label.set_in_layout(False)
    axes.set(title=name, xlabel="x [m]", ylabel=upwards)
    axes.set_aspect("equal", adjustable="datalim")


def _color(joint: int) -> str:
    return SHADES[SERIES[joint % len(SERIES)]]


def _outline(points: Array) -> Array:
    """Return the convex outline of points, shape (n, 2)."""
    try:
        return points[ConvexHull(points).vertices]
    except QhullError:  # all on one line
        return points
