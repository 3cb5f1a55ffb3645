"""A picture to check an arm by: two views with axes and pivots, and the lengths of its cylinders."""

from collections.abc import Sequence

import mujoco
import numpy as np

from hydroid.arm.model import load_model
from hydroid.parameters import Array
from hydroid.reporting.chart import SERIES, Chart, Color, Mark, Panel, joined
from hydroid.reporting.outlines import Shape, outline, poses, shapes
from hydroid.settings.arm import Arm
from hydroid.settings.linkage import LinearActuator

VIEWS = {"from the right (-y)": np.array([0, 2, 1]), "from above": np.array([0, 1, 2])}
"""coordinates of the world to the right, upwards, and along the sight"""
ACROSS = 0.7
"""part of an axis's direction that points out of the picture, from which on it is drawn as a dot"""


def arm_chart(arm: Arm) -> Chart:
    """Draw an arm with all joints at 0, or at the ends of their ranges that are nearest to it.

    Raises:
        ModelError: its model cannot be read.
    """
    model = load_model(arm).compile()
    data, angles = mujoco.MjData(model), np.clip(0.0, arm.lower, arm.upper)
    data.qpos[:] = angles
    mujoco.mj_forward(model, data)
    (pose,) = poses(model, arm.joint_names, angles[None])
    outlines = [
        Shape(shape.body, shape.corners @ pose[shape.body, :, :3].T + pose[shape.body, :, 3])
        for shape in shapes(model)
    ]
    panels = [_view(arm, model, data, outlines, name) for name in VIEWS]
    linear = {i: joint for i, joint in enumerate(arm.joints) if isinstance(joint.actuator, LinearActuator)}
    lengths, moments = list[Mark](), [Mark("rule", y=np.zeros(1), color="grey", width=1)]
    for i, joint in linear.items():
        assert isinstance(joint.actuator, LinearActuator)
        angle = np.linspace(*joint.range, 181)
        for marks, value in ((lengths, joint.actuator.length), (moments, joint.actuator.moment_arm)):
            marks.append(Mark("line", angle, value(np.radians(angle)), color=_color(i), label=joint.name))
    if linear:
        x = "joint angle [deg]"
        panels.append(Panel(x, "pivot to pivot [m]", tuple(lengths), "lengths of the cylinders"))
        panels.append(Panel(x, "moment arm [m]", tuple(moments), "moment arms, 0 at a dead centre"))
    return Chart(tuple(panels), columns=2)


def _view(
    arm: Arm, model: mujoco.MjModel, data: mujoco.MjData, outlines: Sequence[Shape], name: str
) -> Panel:
    """Draw links, joints' axes and pivots in one of the VIEWS; the outlines' corners are in the world."""
    right, up, along = VIEWS[name]
    across, marks = [right, up], list[Mark]()
    moved_by = model.body_jntadr[model.body_weldid[[shape.body for shape in outlines]]]
    for joint in sorted(set(moved_by.tolist())):
        parts = [
            outline(s.corners[:, across]) for s, by in zip(outlines, moved_by, strict=True) if by == joint
        ]
        color, label = ("grey", "") if joint < 0 else (_color(joint), model.joint(joint).name)
        marks.append(Mark("area", *joined(parts), color=color, label=label, alpha=0.45))
        marks.append(Mark("line", *joined(parts), color=color, width=1))
    for place, joint in enumerate(arm.joints):
        if isinstance(joint.actuator, LinearActuator) and joint.actuator.pivots is not None:
            child = int(model.jnt_bodyid[place])
            bodies = int(model.body_parentid[child]), child
            at = [
                data.xpos[body] + data.xmat[body].reshape(3, 3) @ pivot
                for body, pivot in zip(bodies, joint.actuator.pivots, strict=True)
            ]
            ends = np.array(at)[:, across].T
            marks += [Mark("line", *ends, color="ink", width=3), Mark("points", *ends, color="ink", width=4)]
    size = 0.12 * float(np.ptp(data.xipos[1:], axis=0).max() + np.ptp(data.xanchor, axis=0).max() + 0.1)
    texts: list[str] = []
    for joint, at, axis in zip(arm.joints, data.xanchor, data.xaxis, strict=True):
        towards = -axis[along] if along == 1 else axis[along]
        if abs(towards) > ACROSS:
            texts.append(f"{joint.name}: + turns {'counter-clockwise' if towards > 0 else 'clockwise'}")
            marks.append(_points(at[None, across], "circle"))
        else:
            texts.append(joint.name)
            ends = np.array([at - size * axis, at + size * axis])[:, across]
            marks += [Mark("line", *ends.T, color="ink", width=1), _points(ends[1:], "diamond")]
    marks.append(Mark("text", *data.xanchor[:, across].T, color="ink", texts=tuple(texts)))
    return Panel(f"{'xyz'[right]} [m]", f"{'xyz'[up]} [m]", tuple(marks), name, 260, equal=True)


def _points(at: Array, look: str) -> Mark:
    return Mark("points", *at.T, color="ink", look=look, width=6)


def _color(place: int) -> Color:
    return SERIES[place % len(SERIES)]
