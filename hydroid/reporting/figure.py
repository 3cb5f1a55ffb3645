"""Pictures drawn with matplotlib, the same bytes every time: charts as files, and one
to check an arm by.
"""

import io
import warnings
from collections.abc import Generator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

import mujoco
import numpy as np
from matplotlib import style as styles
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull, QhullError

from hydroid.arm.model import load_model
from hydroid.arrays import Array
from hydroid.files import Plain
from hydroid.reporting.chart import SERIES, Chart, Mark, Panel
from hydroid.reporting.outlines import Shape, body_poses, placed, shapes, sight
from hydroid.settings.arm import Arm
from hydroid.settings.cylinder import LinearActuator

SHADES = {
    "ink": "#222222",
    "grey": "#8C8C8C",
    "pale": "#D9D9D9",
    "blue": "#0072B2",
    "orange": "#D55E00",
    "green": "#009E73",
    "pink": "#CC79A7",
    "yellow": "#E69F00",
    "sky": "#56B4E9",
}
_STYLE: Plain = {
    # comes with matplotlib: the same glyphs on every machine
    "font.family": ["DejaVu Sans"],
    "axes.titlesize": 10.0,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E8E8E8",
    "legend.frameon": False,
    "text.parse_math": False,  # a log may be called a$b$.csv
    "svg.hashsalt": "hydroid",
}


@contextmanager
def style() -> Generator[None]:
    """Draw in this style, whatever matplotlib's settings are; they come back
    afterwards."""
    with styles.context(_STYLE, after_reset=True), warnings.catch_warnings():
        # a log's name may hold letters that the font lacks: a box is drawn instead
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        yield


def saved(drawing: Figure, title: str = "") -> tuple[bytes, bytes]:
    """Return a figure as PNG of 150 dpi and as SVG that needs no font; within
    `style`."""
    drawing.suptitle(title, x=0.02, ha="left", fontsize=11, fontweight="bold")
    png, svg = io.BytesIO(), io.BytesIO()
    drawing.savefig(png, format="png", dpi=150, metadata={"Software": None})
    drawing.savefig(svg, format="svg", metadata={"Date": None, "Creator": None})
    return png.getvalue(), svg.getvalue()


def figure(chart: Chart) -> Figure:
    """Draw a chart without what is off; within `style`."""
    heights = [panel.height / 80 for panel in chart.panels]  # [in], of 80 px
    drawing = Figure(
        (6.4, sum(heights) + 0.6 * len(heights) + 0.5), layout="constrained"
    )
    axes = drawing.subplots(
        len(heights), squeeze=False, sharex=chart.linked, height_ratios=heights
    ).ravel()
    for one, panel in zip(axes, chart.thinned().panels, strict=True):
        for mark in panel.marks:
            if not mark.off:
                _draw(one, mark)
        _name_axes(one, panel)
    legend(drawing)
    return drawing


def _draw(axes: Axes, mark: Mark) -> None:
    """Draw a mark in a panel."""
    x, y, end = mark.x, mark.y, mark.end
    look: Plain = {
        "color": SHADES[mark.color],
        "alpha": mark.alpha,
        "label": mark.label or None,
    }
    match mark.kind:
        case "line":
            axes.plot(x, y, lw=mark.width, **look)
        case "step":
            axes.plot(x, y, lw=mark.width, drawstyle="steps-post", **look)
        case "points":
            axes.plot(x, y, "o", ms=mark.width, zorder=3, **look)
        case "band":
            axes.fill_between(x, y, end, lw=0, **look)
        case "spans":
            for low, high in zip(x, end, strict=True):
                axes.axvspan(low, high, lw=0, zorder=0, **look)
        case "rule":
            for value in y:
                axes.axhline(value, lw=mark.width, **look)
        case "bars":
            axes.barh(y, end - x, left=x, height=0.6, **look)
        case "cells":
            for sign, color in (1, "blue"), (-1, "orange"):
                chosen = sign * end > 0
                shade = [to_rgba(SHADES[color], alpha) for alpha in np.abs(end[chosen])]
                axes.bar(x[chosen], 1.0, 1.0, y[chosen] - 0.5, color=shade)


def _name_axes(axes: Axes, panel: Panel) -> None:
    """Name the axes of a panel, and set their limits and scales."""
    axes.set(title=panel.title, xlabel=panel.x, ylabel=panel.y, ylim=panel.y_limits)
    axes.set_yscale("log" if panel.log_y else "linear")
    axes.set_xscale("log" if panel.log_x else "linear")
    if panel.rows:
        # [pt], of 72 in an inch
        size = min(8.0, 50.0 * panel.height / 80 / len(panel.rows))
        axes.set_yticks(range(len(panel.rows)), panel.rows, fontsize=size)
        axes.set_ylim(len(panel.rows) - 0.5, -0.5)
        axes.grid(axis="y", visible=False)
    if panel.columns:
        axes.set_xticks(
            range(len(panel.columns)), panel.columns, fontsize=6, rotation=90
        )
        axes.set_xlim(-0.5, len(panel.columns) - 0.5)
        axes.grid(axis="x", visible=False)


def legend(drawing: Figure) -> None:
    """Explain every label of a figure once, below it."""
    labels = {
        h.get_label(): h
        for one in drawing.axes
        for h in one.get_legend_handles_labels()[0]
    }
    if len(labels) > 1:
        columns = int(
            15 * drawing.get_figwidth() / (8 + max(len(str(label)) for label in labels))
        )
        where: Any = "outside lower center"
        drawing.legend(
            handles=list(labels.values()), loc=where, ncols=max(1, min(3, columns))
        )


VIEWS = {"from the right (-y)": (0.0, "z [m]"), "from above": (-90.0, "y [m]")}
"""elevation of the sight [deg], and what points upwards; x points to the right"""
ACROSS = 0.7
"""part of an axis's direction that points out of the picture, from which on its sense
of rotation is named"""


def arm_picture(arm: Arm, title: str) -> tuple[bytes, bytes]:
    """Draw an arm with all joints at 0, or at the ends of their ranges that are
    nearest.

    PNG and SVG.
    """
    model = load_model(arm).compile()
    data, angles = mujoco.MjData(model), np.clip(0.0, arm.lower, arm.upper)
    data.qpos[:] = angles
    mujoco.mj_forward(model, data)
    (poses,) = body_poses(model, angles[None])
    outlines = [Shape(shape.body, shape.placed(poses)) for shape in shapes(model)]
    cylinders = [
        (number, joint, joint.actuator)
        for number, joint in enumerate(arm.joints)
        if isinstance(joint.actuator, LinearActuator) and not joint.slides
    ]
    with style():
        drawing = Figure((7.2, 7.5 if cylinders else 4.4), layout="constrained")
        axes: Any = drawing.subplots(2 if cylinders else 1, 2, squeeze=False)
        for one, name in zip(axes[0], VIEWS, strict=True):
            _view(one, arm, data, outlines, poses, name)
        for number, joint, linkage in cylinders:
            angle, look = (
                np.linspace(*joint.range, 181),
                {"color": _color(number), "label": joint.name},
            )
            axes[1, 0].plot(angle, linkage.length(np.radians(angle)), **look)
            axes[1, 1].plot(angle, linkage.moment_arm(np.radians(angle)), **look)
        if cylinders:
            x = "joint angle [deg]"
            axes[1, 0].set(
                xlabel=x, ylabel="pivot to pivot [m]", title="lengths of the cylinders"
            )
            axes[1, 1].set(
                xlabel=x,
                ylabel="moment arm [m]",
                title="moment arms, 0 at a dead centre",
            )
            axes[1, 1].axhline(0.0, color="grey", lw=1)
        legend(drawing)
        return saved(drawing, title)


def _view(
    axes: Axes, arm: Arm, data: Any, outlines: Sequence[Shape], poses: Array, name: str
) -> None:
    """Draw links, joints' axes and pivots in one of the VIEWS.

    The outlines' corners are in the world.
    """
    elevation, upwards = VIEWS[name]
    *across, ahead = sight(90.0, elevation)
    model, onto = data.model, np.transpose(across)
    moved_by = model.body_jntadr[model.body_weldid].tolist()
    for shape in outlines:
        joint = moved_by[shape.body]
        color, label = (
            ("grey", None) if joint < 0 else (_color(joint), arm.joint_names[joint])
        )
        outline = shape.corners @ onto
        with suppress(QhullError):  # all on one line
            outline = outline[ConvexHull(outline).vertices]
        axes.fill(*outline.T, fc=color, ec=color, alpha=0.45, label=label)
    for child, joint in zip(model.jnt_bodyid.tolist(), arm.joints, strict=True):
        if (
            isinstance(joint.actuator, LinearActuator)
            and joint.actuator.pivots is not None
        ):
            bodies = [model.body_parentid[child], child]
            ends = placed(np.array(joint.actuator.pivots)[:, None], poses[bodies])[:, 0]
            axes.plot(*(ends @ onto).T, "o-", color="black", lw=3, ms=4)
    size = 0.12 * (
        np.ptp(data.xipos[1:], axis=0).max() + np.ptp(data.xanchor, axis=0).max() + 0.1
    )
    said = 0
    for number, (joint, at, axis) in enumerate(
        zip(arm.joints, data.xanchor, data.xaxis, strict=True)
    ):
        axes.plot(
            *(np.array([at - size * axis, at + size * axis]) @ onto).T,
            "D-",
            color="black",
            lw=1,
            ms=4,
        )
        if joint.slides == (abs(axis @ ahead) > ACROSS):
            continue  # the other view tells
        sense = "turns counter-clockwise" if axis @ ahead < 0 else "turns clockwise"
        text = f"{joint.name}: + {'slides along the line' if joint.slides else sense}"
        corner: Plain = {
            "transform": axes.transAxes,
            "va": "top",
            "fontsize": 7,
            "color": _color(number),
        }
        axes.text(0.03, 0.98 - 0.055 * said, text, **corner).set_in_layout(False)
        said += 1
    axes.set(title=name, xlabel="x [m]", ylabel=upwards)
    axes.set_aspect("equal", adjustable="datalim")


def _color(joint: int) -> str:
    return SHADES[SERIES[joint % len(SERIES)]]
