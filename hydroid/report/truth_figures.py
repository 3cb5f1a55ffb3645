"""Figures of a study that need no run: the arm, the effect of parameters, the error over two of them."""

from typing import Any

import mujoco
import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from hydroid.arm.build import VISUAL_GROUP
from hydroid.arm.model import load_model
from hydroid.parameters import Array
from hydroid.posterior.sweep import SWEEP_POINTS
from hydroid.report import style
from hydroid.settings.study_shown import StudyFigure
from hydroid.study.findings import landscape
from hydroid.study.study import StudyRuns

COLORS = (style.SEARCH, style.REFINED, *style.OTHERS, style.GREY, "#000000")


def record(runs: StudyRuns) -> tuple[Array, Array]:
    """Return time [s] and angle [deg] of the first compared joint in the first log."""
    log = runs.problem.logs[0]
    return log.time, np.degrees(log.angle[:, runs.problem.outputs[0]])


def _truth(runs: StudyRuns) -> Array:
    return runs.problem.parameters.vector(runs.plan.study.data.truth, "data.truth")


def sensitivity(runs: StudyRuns, figure: StudyFigure) -> Figure:
    """The output for 20 values of each of some parameters over their bounds."""
    problem, theta, time = runs.problem, _truth(runs), runs.problem.logs[0].time
    low, high = figure.window_s or (0.0, float(time[-1]))
    if low >= time[-1]:  # the short form's record ends before
        low, high = 0.0, float(time[-1])
    part = slice(*np.searchsorted(time, (low, high)).tolist())
    names = figure.parameters or tuple(
        n for n, f in zip(problem.parameters.names, problem.parameters.free, strict=True) if f
    )
    drawing = style.figure(0.9 + 1.9 * -(-len(names) // 2), top=0.8)
    style.headline(drawing, figure.title)
    panels = drawing.subplots(
        -(-len(names) // 2), 2, sharex=True, squeeze=False, gridspec_kw={"hspace": 0.3, "wspace": 0.25}
    )
    colors = colormaps["viridis"](np.linspace(0.0, 0.95, SWEEP_POINTS))
    for axes, name in zip(panels.ravel(), names, strict=False):
        column = problem.parameters.names.index(name)
        candidates = np.tile(theta, (SWEEP_POINTS, 1))
        parameter = problem.parameters.parameters[column]
        candidates[:, column] = parameter.at(np.linspace(0, 1, SWEEP_POINTS))
        angles = np.degrees(problem.responses(candidates)[0].angle[:, :, 0])
        for color, curve in zip(colors, angles, strict=True):
            axes.plot(time[part], style.finite(curve)[part], color=color, lw=0.8)
        axes.plot(time[part], record(runs)[1][part], color=style.MEASURED, lw=1.2, linestyle="--")
        title = f"{name}: {parameter.lower:g} to {parameter.upper:g} {parameter.unit}"
        axes.set_title(title, fontsize=9, fontweight="normal")
        axes.margins(x=0)
    for axes in panels[-1]:
        axes.set_xlabel("time [s]")
    for axes in panels[:, 0]:
        axes.set_ylabel("angle [deg]")
    return drawing


def landscape_figure(runs: StudyRuns, figure: StudyFigure) -> Figure:
    """The error over two parameters as a surface in three dimensions."""
    surface = landscape(runs.problem, _truth(runs), figure.parameters, runs.plan.grid(figure))
    relative = runs.problem.settings.objective.relative
    error = style.finite(surface.error if relative else np.degrees(surface.error))
    drawing = style.figure(4.8, left=0.1, right=0.5, bottom=0.3)
    axes: Any = drawing.add_subplot(projection="3d")
    a, b = np.meshgrid(*surface.values, indexing="ij")
    axes.plot_surface(a, b, error, cmap="viridis_r", edgecolor="#FFFFFF", linewidth=0.2, rstride=1, cstride=1)
    labels = [f"{p.name} [{p.unit}]" if p.unit else p.name for p in surface.parameters]
    axes.set(xlabel=labels[0], ylabel=labels[1])
    axes.set_zlabel("error" if relative else "error [deg]")
    axes.set_title(figure.title)
    return drawing


def arm_in_space(runs: StudyRuns, figure: StudyFigure) -> Figure:
    """The arm's meshes in the pose that begins the data."""
    arm = runs.problem.settings.arm
    model = load_model(arm.model, arm).compile()
    data = mujoco.MjData(model)
    data.qpos[[model.joint(name).qposadr[0] for name in arm.joint_names]] = runs.problem.logs[0].start
    mujoco.mj_kinematics(model, data)
    drawing = style.figure(4.8, left=0.1, right=0.1, bottom=0.1)
    axes: Any = drawing.add_subplot(projection="3d")
    every: list[Array] = []
    for geom in range(model.ngeom):
        mesh = model.geom_dataid[geom]
        if mesh < 0 or model.geom_group[geom] != VISUAL_GROUP:
            continue
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        corners = (
            model.mesh_vert[first : first + count] @ data.geom_xmat[geom].reshape(3, 3).T
            + data.geom_xpos[geom]
        )
        start, number = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
        color = COLORS[int(model.geom_bodyid[geom]) % len(COLORS)]
        faces = corners[model.mesh_face[start : start + number]]
        axes.add_collection3d(Poly3DCollection(faces, facecolors=color, shade=True, linewidths=0))
        every.append(corners)
    points = np.concatenate(every) if every else np.zeros((1, 3))
    low, high = points.min(axis=0), points.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(np.maximum(high - low, 1e-3))
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    axes.locator_params(axis="y", nbins=3)
    axes.view_init(elev=20, azim=-60)
    axes.set_title(figure.title)
    return drawing
