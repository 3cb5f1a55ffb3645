"""Pictures drawn with matplotlib, the same bytes every time: charts as files, and one
to check an arm by.
"""

import io
import warnings
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any

import mujoco
import numpy as np
from matplotlib import style as styles
from matplotlib.artist import Artist
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
    png = _png(drawing, title)
    svg = io.BytesIO()
    drawing.savefig(svg, format="svg", metadata={"Date": None, "Creator": None})
    return png, svg.getvalue()


def _png(drawing: Figure, title: str) -> bytes:
    """Return a figure as PNG of 150 dpi; within `style`."""
    drawing.suptitle(title, x=0.02, ha="left", fontsize=11, fontweight="bold")
    png = io.BytesIO()
    drawing.savefig(png, format="png", dpi=150, metadata={"Software": None})
    return png.getvalue()


def figure(chart: Chart) -> Figure:
    """Draw a chart without what is off; within `style`."""
    heights = [panel.height / 80 for panel in chart.panels]  # [in], of 80 px
    # titles and ticks take 0.6 in of each panel, the legend below all of them 0.5 in
    height = sum(heights) + 0.6 * len(heights) + 0.5
    drawing = Figure((6.4, height), layout="constrained")
    every_axes = drawing.subplots(
        len(heights), squeeze=False, sharex=chart.linked, height_ratios=heights
    ).ravel()
    for axes, panel in zip(every_axes, chart.thinned().panels, strict=True):
        for mark in panel.marks:
            if not mark.off:
                _draw(axes, mark)
        _name_axes(axes, panel)
    legend(drawing)
    return drawing


def _draw(axes: Axes, mark: Mark) -> None:
    """Draw a mark in a panel."""
    x = mark.x
    y = mark.y
    end = mark.end
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
            above = end > 0
            _draw_cells(axes, x[above], y[above], end[above], "blue")
            below = end < 0
            _draw_cells(axes, x[below], y[below], -end[below], "orange")


def _draw_cells(axes: Axes, x: Array, y: Array, strength: Array, color: str) -> None:
    """Draw unit squares at points, the stronger the less transparent."""
    shades = [to_rgba(SHADES[color], alpha) for alpha in strength]
    axes.bar(x, 1.0, 1.0, y - 0.5, color=shades)


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
    by_label = dict[str, Artist]()
    for axes in drawing.axes:
        handles, labels = axes.get_legend_handles_labels()
        by_label |= dict(zip(labels, handles, strict=True))
    if len(by_label) <= 1:
        return
    # a letter is about 1/15 in wide, and a label's line and blanks are 8 letters
    longest = max(map(len, by_label))
    columns = int(15 * drawing.get_figwidth() / (8 + longest))
    where: Any = "outside lower center"
    drawing.legend(
        handles=[*by_label.values()], loc=where, ncols=max(1, min(3, columns))
    )


VIEWS = {"from the right (-y)": (0.0, "z [m]"), "from above": (-90.0, "y [m]")}
"""elevation of the sight [deg], and what points upwards; x points to the right"""
ACROSS = 0.7
"""part of an axis's direction that points out of the picture, from which on its sense
of rotation is named"""


def arm_picture(arm: Arm, title: str) -> bytes:
    """Draw an arm with all joints at 0, or at the ends of their ranges that are
    nearest, as PNG."""
    model = load_model(arm).compile()
    data = mujoco.MjData(model)
    angles = np.clip(0.0, arm.lower, arm.upper)
    data.qpos[:] = angles
    mujoco.mj_forward(model, data)
    (poses,) = body_poses(model, angles[None])
    outlines = [Shape(shape.body, shape.placed(poses)) for shape in shapes(model)]
    cylinders = dict[int, LinearActuator]()
    for number, joint in enumerate(arm.joints):
        if isinstance(joint.actuator, LinearActuator) and not joint.slides:
            cylinders[number] = joint.actuator
    rows = 2 if cylinders else 1
    with style():
        drawing = Figure((7.2, 7.5 if cylinders else 4.4), layout="constrained")
        every_axes: Any = drawing.subplots(rows, 2, squeeze=False)
        for axes, name in zip(every_axes[0], VIEWS, strict=True):
            view = _View(axes, arm, data, *VIEWS[name])
            view.show(outlines, poses)
            axes.set(title=name)
        if cylinders:
            _draw_cylinders(every_axes[1, 0], every_axes[1, 1], arm, cylinders)
        legend(drawing)
        return _png(drawing, title)


def _draw_cylinders(
    lengths: Axes, moment_arms: Axes, arm: Arm, cylinders: Mapping[int, LinearActuator]
) -> None:
    """Draw the cylinders of joints (by number, from 0) over the joints' ranges."""
    for number, cylinder in cylinders.items():
        joint = arm.joints[number]
        degrees = np.linspace(*joint.range, 181)
        radians = np.radians(degrees)
        look: Plain = {"color": _color(number), "label": joint.name}
        lengths.plot(degrees, cylinder.length(radians), **look)
        moment_arms.plot(degrees, cylinder.moment_arm(radians), **look)
    lengths.set(title="lengths of the cylinders", ylabel="pivot to pivot [m]")
    moment_arms.set(title="moment arms, 0 at a dead centre", ylabel="moment arm [m]")
    moment_arms.axhline(0.0, color="grey", lw=1)
    for axes in (lengths, moment_arms):
        axes.set(xlabel="joint angle [deg]")


class _View:
    """An arm that is seen along one of the VIEWS.

    Args:
        axes: in which it is drawn.
        arm: that is drawn.
        data: of its model, in the pose that is drawn.
        elevation: of the sight [deg].
        upwards: name of the axis that points upwards.
    """

    def __init__(
        self, axes: Axes, arm: Arm, data: Any, elevation: float, upwards: str
    ) -> None:
        self._axes = axes
        self._arm = arm
        self._data = data
        *across, self._ahead = sight(90.0, elevation)
        self._onto = np.transpose(across)
        axes.set(xlabel="x [m]", ylabel=upwards)
        axes.set_aspect("equal", adjustable="datalim")

    def show(self, outlines: Sequence[Shape], poses: Array) -> None:
        """Show outlines, whose corners are in the world [m], pivots in bodies' poses,
        and the joints' axes."""
        for shape in outlines:
            self._draw_outline(shape)
        self._draw_pivots(poses)
        self._draw_joints()

    def _draw_outline(self, shape: Shape) -> None:
        model = self._data.model
        joint = int(model.body_jntadr[model.body_weldid[shape.body]])
        color = "grey"
        label = None
        if joint >= 0:
            color = _color(joint)
            label = self._arm.joint_names[joint]
        outline = shape.corners @ self._onto
        with suppress(QhullError):  # all on one line
            outline = outline[ConvexHull(outline).vertices]
        self._axes.fill(*outline.T, fc=color, ec=color, alpha=0.45, label=label)

    def _draw_pivots(self, poses: Array) -> None:
        """Draw a line between the pivots of each cylinder."""
        model = self._data.model
        for child, joint in zip(
            model.jnt_bodyid.tolist(), self._arm.joints, strict=True
        ):
            cylinder = joint.actuator
            if not isinstance(cylinder, LinearActuator) or cylinder.pivots is None:
                continue
            bodies = [model.body_parentid[child], child]
            ends = placed(np.array(cylinder.pivots)[:, None], poses[bodies])[:, 0]
            self._axes.plot(*(ends @ self._onto).T, "o-", color="black", lw=3, ms=4)

    def _draw_joints(self) -> None:
        """Draw the joints' axes, and name the sense of those that this view shows."""
        data = self._data
        bodies = np.ptp(data.xipos[1:], axis=0).max()
        anchors = np.ptp(data.xanchor, axis=0).max()
        half = 0.12 * (bodies + anchors + 0.1)
        named = 0
        for number, joint in enumerate(self._arm.joints):
            anchor = data.xanchor[number]
            axis = data.xaxis[number]
            ends = np.array([anchor - half * axis, anchor + half * axis])
            self._axes.plot(*(ends @ self._onto).T, "D-", color="black", lw=1, ms=4)
            across = axis @ self._ahead
            if joint.slides == (abs(across) > ACROSS):
                continue  # the other view tells
            sense = "turns counter-clockwise" if across < 0 else "turns clockwise"
            if joint.slides:
                sense = "slides along the line"
            self._write(f"{joint.name}: + {sense}", named, _color(number))
            named += 1

    def _write(self, text: str, line: int, color: str) -> None:
        """Write a line of text into the view's corner."""
        where: Plain = {"transform": self._axes.transAxes, "va": "top"}
        height = 0.98 - 0.055 * line
        written = self._axes.text(0.03, height, text, fontsize=7, color=color, **where)
        # or the text would shrink the view
        written.set_in_layout(False)


def _color(joint: int) -> str:
    return SHADES[SERIES[joint % len(SERIES)]]
