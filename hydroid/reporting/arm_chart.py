"""A picture to check an arm by: two views with axes and pivots, and the lengths of its cylinders."""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from hydroid.arm.model import load_model
from hydroid.parameters import Array
from hydroid.reporting.chart import SERIES, ZERO, Chart, Color, Mark, Panel, joined
from hydroid.reporting.outlines import Shape, body_poses, placed, shapes, sight
from hydroid.settings.arm import Arm
from hydroid.settings.linkage import LinearActuator

VIEWS = {"from the right (-y)": (0.0, "z [m]"), "from above": (-90.0, "y [m]")}
"""elevation of the sight [deg], and what points upwards; x points to the right"""
ACROSS = 0.7
"""part of an axis's direction that points out of the picture, from which on its sense of rotation is named"""


def arm_chart(arm: Arm) -> Chart:
    """Draw an arm with all joints at 0, or at the ends of their ranges that are nearest to it.

    Raises:
        ModelError: its model cannot be read.
    """
    model = load_model(arm).compile()
    data, angles = mujoco.MjData(model), np.clip(0.0, arm.lower, arm.upper)
    data.qpos[:] = angles
    mujoco.mj_forward(model, data)
    (poses,) = body_poses(model, angles[None])
    outlines = [Shape(shape.body, shape.placed(poses)) for shape in shapes(model)]
    panels = [_view(arm, data, outlines, poses, name) for name in VIEWS]
    lengths, moments = list[Mark](), [ZERO]
    for joint, color in zip(arm.joints, _colors(arm), strict=True):
        if isinstance(joint.actuator, LinearActuator):
            angle = np.linspace(*joint.range, 181)
            for marks, value in ((lengths, joint.actuator.length), (moments, joint.actuator.moment_arm)):
                marks.append(Mark("line", angle, value(np.radians(angle)), color=color, label=joint.name))
    if lengths:
        x = "joint angle [deg]"
        panels.append(Panel(x, "pivot to pivot [m]", tuple(lengths), "lengths of the cylinders"))
        panels.append(Panel(x, "moment arm [m]", tuple(moments), "moment arms, 0 at a dead centre"))
    return Chart(tuple(panels), columns=2)


def _view(arm: Arm, data: mujoco.MjData, outlines: Sequence[Shape], poses: Array, name: str) -> Panel:
    """Draw links, joints' axes and pivots in one of the VIEWS; the outlines' corners are in the world."""
    elevation, upwards = VIEWS[name]
    *across, ahead = sight(90.0, elevation)
    model, marks = data.model, list[Mark]()

    def draw(kind: Any, at: Array, color: Color = "ink", **look: Any) -> None:
        marks.append(Mark(kind, *(at @ np.transpose(across)).T, color=color, **look))

    moved_by = model.body_jntadr[model.body_weldid].tolist()
    looks = {-1: ("grey", "")} | dict(enumerate(zip(_colors(arm), arm.joint_names, strict=True)))
    for number, (color, label) in looks.items():
        seen = [s.corners @ np.transpose(across) for s in outlines if moved_by[s.body] == number]
        if seen:
            around = joined(map(_outline, seen))
            marks.append(Mark("area", *around, color=color, label=label, alpha=0.45))
            marks.append(Mark("line", *around, color=color, width=1))
    for child, joint in zip(model.jnt_bodyid.tolist(), arm.joints, strict=True):
        if isinstance(joint.actuator, LinearActuator) and joint.actuator.pivots is not None:
            bodies = [model.body_parentid[child], child]
            ends = placed(np.array(joint.actuator.pivots)[:, None], poses[bodies])[:, 0]
            draw("line", ends, width=3)
            draw("points", ends, width=4)
    size = 0.12 * float(np.ptp(data.xipos[1:], axis=0).max() + np.ptp(data.xanchor, axis=0).max() + 0.1)
    texts: list[str] = []
    for joint, at, axis in zip(arm.joints, data.xanchor, data.xaxis, strict=True):
        sense = "counter-clockwise" if axis @ ahead < 0 else "clockwise"
        texts.append(f"{joint.name}: + turns {sense}" if abs(axis @ ahead) > ACROSS else joint.name)
        draw("line", np.array([at - size * axis, at + size * axis]), width=1)
        draw("points", at[None] + size * axis, look="diamond", width=6)
    draw("text", data.xanchor, texts=tuple(texts))
    return Panel("x [m]", upwards, tuple(marks), name, 260, equal=True)


def _colors(arm: Arm) -> list[Color]:
    return [SERIES[i % len(SERIES)] for i in range(len(arm.joints))]


def _outline(points: Array) -> Array:
    """Return the convex outline of points, shape (n, 2)."""
    try:
        return points[ConvexHull(points).vertices]
    except QhullError:  # all on one line
        return points
