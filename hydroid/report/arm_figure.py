"""A picture to check an arm by: two views with axes and pivots, and the lengths of its cylinders."""

from collections.abc import Iterator

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from hydroid.arm.model import load_model
from hydroid.cad.shapes import SHOWN, geom_mesh
from hydroid.parameters import Array
from hydroid.report import style
from hydroid.settings.arm import Arm, Joint
from hydroid.settings.linkage import LinearActuator

MOST_FACES = 3000
"""faces of a link; of one with more the hull is drawn"""
COLORS = (style.SEARCH, style.REFINED, *style.OTHERS)
ACROSS = 0.7
"""part of an axis's direction that points out of the picture, from which on it is drawn as a dot"""


def arm_figure(arm: Arm) -> Figure:
    """Draw an arm with all joints at 0, or at the ends of their ranges that are nearest to it.

    Raises:
        ModelError: its model cannot be read.
    """
    model = load_model(arm).compile()
    data = mujoco.MjData(model)
    low, high = np.where(np.isfinite(arm.lower), arm.lower, 0), np.where(np.isfinite(arm.upper), arm.upper, 0)
    data.qpos[:] = np.clip(0.0, low, high)
    mujoco.mj_forward(model, data)
    linear = [joint for joint in arm.joints if isinstance(joint.actuator, LinearActuator)]
    drawing = style.figure(4.2 + 2.6 * bool(linear), 11.0, left=0.8, top=0.75, bottom=0.6)
    style.headline(
        drawing,
        f"{arm.name}, each joint as near to 0 as its range allows: does it look and turn like your arm?",
    )
    grid = drawing.add_gridspec(2 if linear else 1, 2, hspace=0.4, height_ratios=[1.5, 1][: 1 + bool(linear)])
    links = list(_links(model, data))
    for place, (across, names) in enumerate(((1, "xz"), (2, "xy"))):
        axes = drawing.add_subplot(grid[0, place])
        _view(axes, arm, links, across)
        _skeleton(axes, arm, model, data, {name for name, *_ in links}, across)
        _pivots(axes, arm, model, data, across)
        _axes_of_joints(axes, arm, data, across)
        axes.set_xlabel(f"{names[0]} [m]")
        axes.set_ylabel(f"{names[1]} [m]")
        axes.set_title("from the right (-y)" if place == 0 else "from above")
        axes.set_aspect("equal", adjustable="datalim")
        axes.autoscale_view()
    if drawing.axes[0].get_legend_handles_labels()[0]:
        drawing.axes[0].legend(loc="best", fontsize=8)
    if linear:
        _lengths(drawing.add_subplot(grid[1, 0]), linear, arm, moment=False)
        _lengths(drawing.add_subplot(grid[1, 1]), linear, arm, moment=True)
    return drawing


def _links(model: mujoco.MjModel, data: mujoco.MjData) -> Iterator[tuple[str, str, Array]]:
    """Name, colour and triangles [m], shape (F, 3, 3), of every body shown; what is fixed is "base"."""
    for body in range(model.nbody):
        joint = int(model.body_jntadr[model.body_weldid[body]])
        name, color = ("base", style.GREY) if joint < 0 else (model.body(body).name, _color(joint))
        for geom in np.flatnonzero((model.geom_bodyid == body) & (model.geom_group <= SHOWN)):
            mesh = geom_mesh(model, int(geom))
            if mesh is None:
                continue
            mesh = mesh if len(mesh.faces) <= MOST_FACES else mesh.convex_hull
            turned = mesh.vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
            yield name, color, turned[mesh.faces]


def _view(axes: Axes, arm: Arm, links: list[tuple[str, str, Array]], across: int) -> None:
    """Draw the links as seen along y (across = 1) or z (2)."""
    shown = [0, 3 - across]
    labelled = set[str]()
    for name, color, triangles in links:
        label = None if name in labelled else name
        labelled.add(name)
        faces = list(triangles[:, :, shown])
        axes.add_collection(PolyCollection(faces, facecolor=color, edgecolor="none", alpha=0.45, label=label))


def _skeleton(
    axes: Axes, arm: Arm, model: mujoco.MjModel, data: mujoco.MjData, drawn: set[str], across: int
) -> None:
    """Draw each link without a shape as a line from its joint to the next, the last to its centre of mass."""
    names = ("base", *arm.link_names[: len(arm.joints)])
    if set(names[1:]) <= drawn:
        return
    base, last = int(model.body_parentid[model.jnt_bodyid[0]]), data.xipos[model.jnt_bodyid[-1]]
    places = np.vstack([data.xpos[base], data.xanchor, last])[:, [0, 3 - across]]
    for place, name in enumerate(names):
        if name not in drawn:
            color = style.GREY if name == "base" else _color(place - 1)
            axes.plot(*places[place : place + 2].T, "-", color=color, linewidth=3, label=name)


def _axes_of_joints(axes: Axes, arm: Arm, data: mujoco.MjData, across: int) -> None:
    """Mark each joint: a dot where its axis points to or from the reader, or else a line along it."""
    shown = [0, 3 - across]
    size = 0.12 * float(np.ptp(data.xipos[1:], axis=0).max() + np.ptp(data.xanchor, axis=0).max() + 0.1)
    for place, joint in enumerate(arm.joints):
        at, along = data.xanchor[place], data.xaxis[place]
        towards = -along[1] if across == 1 else along[2]
        if abs(towards) > ACROSS:
            axes.plot(*at[shown], "o", color=style.MEASURED, markersize=7, markerfacecolor="white")
            turn = "counter-clockwise" if towards > 0 else "clockwise"
            text = f" {joint.name}: + turns {turn}"
        else:
            axes.annotate(
                "",
                (at + size * along)[shown],
                (at - size * along)[shown],
                arrowprops={"arrowstyle": "->", "color": style.MEASURED},
            )
            text = f" {joint.name}"
        axes.annotate(text, at[shown], (4, 6 + 9 * (place % 2)), textcoords="offset points", fontsize=7.5)


def _pivots(axes: Axes, arm: Arm, model: mujoco.MjModel, data: mujoco.MjData, across: int) -> None:
    """Draw each cylinder as a line between its pivots."""
    shown = [0, 3 - across]
    for place, joint in enumerate(arm.joints):
        if isinstance(joint.actuator, LinearActuator) and joint.actuator.pivots is not None:
            child = int(model.jnt_bodyid[place])
            bodies = int(model.body_parentid[child]), child
            ends = [
                data.xpos[body] + data.xmat[body].reshape(3, 3) @ pivot
                for body, pivot in zip(bodies, joint.actuator.pivots, strict=True)
            ]
            line = np.array(ends)[:, shown].T
            axes.plot(*line, "-o", color="#000000", linewidth=3, markersize=4, solid_capstyle="round")


def _lengths(axes: Axes, joints: list[Joint], arm: Arm, *, moment: bool) -> None:
    """Draw each cylinder's length, or its moment arm, over its joint's range."""
    for joint in joints:
        assert isinstance(joint.actuator, LinearActuator)
        angle = np.linspace(*joint.range, 181)
        value = (joint.actuator.moment_arm if moment else joint.actuator.length)(np.radians(angle))
        axes.plot(angle, value, color=_color(arm.joints.index(joint)), label=joint.name)
    axes.set_xlabel("joint angle [deg]")
    axes.set_ylabel("moment arm [m]" if moment else "pivot to pivot [m]")
    axes.set_title("moment arms, 0 at a dead centre" if moment else "lengths of the cylinders")
    if moment:
        axes.axhline(0, color=style.GREY, linewidth=0.8)
    else:
        axes.legend(loc="best", fontsize=8)


def _color(place: int) -> str:
    return COLORS[place % len(COLORS)]
