"""The figures of a study, in the article's arrangement, as vectors."""

from collections.abc import Callable, Mapping
from typing import Any

import matplotlib as mpl
import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from studies import Figure, Runs

from hydroid.arm.model import load_model
from hydroid.parameters import Array
from hydroid.posterior.sweep import surface
from hydroid.problem.problem import Problem
from hydroid.studies.runs import Result

COLORS = [f"C{i}" for i in range(10)]
DATA: dict[str, Any] = {"color": "black", "linestyle": "--", "lw": 1.8, "label": "data"}
POINTS = 1200
"""samples of a record that are drawn"""
CURVES = 20
"""values of a parameter within its bounds, as in the article's figure 10"""


def draw(runs: Runs, figure: Figure) -> Drawing:
    """Draw one figure of a study."""
    with mpl.rc_context({"font.size": 9, "svg.hashsalt": "hydroid", "axes.spines.top": False}):
        drawing = Drawing((7.0, 3.6), layout="constrained")
        KINDS[figure.kind](drawing, runs, figure)
        drawing.suptitle(figure.title, fontsize=10)
        return drawing


def _axes(drawing: Drawing, xlabel: str, ylabel: str) -> Axes:
    axes = drawing.subplots()
    axes.set(xlabel=xlabel, ylabel=ylabel)
    return axes


def _cells(runs: Runs, figure: Figure) -> dict[str, Any]:
    """Return the drawn cells with the colour of each."""
    names = figure.cells or tuple(runs.plan.cells)
    return {name: COLORS[i % len(COLORS)] for i, name in enumerate(names)}


def _thin(*arrays: Array) -> list[Array]:
    step = max(1, len(arrays[0]) // POINTS)
    return [array[::step] for array in arrays]


def _convergence(drawing: Drawing, runs: Runs, figure: Figure) -> None:
    """Best objective by generation: the median over seeds, with the middle half of them shaded."""
    axes = _axes(drawing, "generation", "best objective" + ", 0 to 1" * figure.normalized)
    for cell, color in _cells(runs, figure).items():
        histories = [np.array([step[2] for step in run["history"]], dtype=float) for _, run in runs.of(cell)]
        if not histories:
            continue
        length = max(map(len, histories))
        curves = np.array([np.pad(h, (0, length - len(h)), mode="edge") for h in histories])
        if figure.normalized:
            low, high = curves[:, -1:], np.nanmax(curves, axis=1, keepdims=True)
            curves = (curves - low) / np.where(high > low, high - low, 1.0)
        at = np.arange(1, length + 1)
        lower, middle, upper = np.nanquantile(curves, (0.25, 0.5, 0.75), axis=0)
        axes.plot(at, middle, color=color, label=cell)
        axes.fill_between(at, lower, upper, color=color, alpha=0.12, linewidth=0)
    axes.set_yscale("linear" if figure.normalized else "log")
    axes.legend(fontsize=8)


def _response(runs: Runs, cell: str, values: Mapping[str, float]) -> Array:
    """Return the first compared angle [deg] that a cell's parameters give, shape (T,)."""
    problem = Problem(runs.plan.cells[cell], runs.problem.logs[:1])
    theta = problem.parameters.vector(values, "a run")
    return np.degrees(problem.responses(theta[None])[0].angle[0, :, 0])


def _responses(drawing: Drawing, runs: Runs, figure: Figure) -> None:
    """The record, and the response of the median run of each cell."""
    axes = _axes(drawing, "time [s]", "angle [deg]")
    time, angle = runs.record
    axes.plot(*_thin(time, angle), **DATA)
    for cell, color in _cells(runs, figure).items():
        if (run := runs.median_run(cell)) is not None:
            axes.plot(*_thin(time, _response(runs, cell, run["theta"])), color=color, lw=1, label=cell)
    axes.legend(fontsize=8)


def _segment_bests(drawing: Drawing, runs: Runs, figure: Figure) -> None:
    """The record, the best candidate of each segment (thin), and the estimate, their average (thick)."""
    axes = _axes(drawing, "time [s]", "angle [deg]")
    time, angle = runs.record
    axes.plot(*_thin(time, angle), **DATA)
    for cell in _cells(runs, figure):
        run: Result = runs.median_run(cell) or {"segment_bests": []}
        for values in run["segment_bests"]:
            axes.plot(*_thin(time, _response(runs, cell, values)), color=COLORS[0], lw=0.6)
        if "theta" in run:
            estimate = _response(runs, cell, run["theta"])
            axes.plot(*_thin(time, estimate), color=COLORS[1], lw=2, label=f"estimate ({cell})")
    axes.legend(fontsize=8)


def _commands(drawing: Drawing, runs: Runs, figure: Figure) -> None:
    axes, log = _axes(drawing, "time [s]", "command [%]"), runs.problem.logs[0]
    axes.step(*_thin(log.time, log.command[:, runs.problem.outputs[0]]), where="post")


def _segments(drawing: Drawing, runs: Runs, figure: Figure) -> None:
    axes = _axes(drawing, "time [s]", "angle [deg]")
    time, angle = runs.record
    axes.plot(*_thin(time, angle))
    for number, (first, end) in enumerate(runs.problem.bounds, 1):
        axes.axvline(float(time[first]), color="grey", lw=0.8, linestyle="--")
        middle = float(time[(first + end) // 2])
        axes.text(middle, 0.97, str(number), transform=axes.get_xaxis_transform(), ha="center", va="top")


def _sensitivity(drawing: Drawing, runs: Runs, figure: Figure) -> None:
    """The output for 20 values of each of some parameters over their bounds, dark to light."""
    problem, (time, angle) = runs.problem, runs.record
    low, high = figure.window_s or (0.0, np.inf)
    part = slice(*np.searchsorted(time, (low, high) if low < time[-1] else (0, np.inf)).tolist())
    drawing.set_figheight(5.0)
    panels = drawing.subplots(-(-len(figure.parameters) // 2), 2, sharex=True, squeeze=False)
    for axes, name in zip(panels.ravel(), figure.parameters, strict=False):
        column = problem.parameters.names.index(name)
        parameter = problem.parameters.parameters[column]
        candidates = np.tile(runs.theta, (CURVES, 1))
        candidates[:, column] = parameter.at(np.linspace(0, 1, CURVES))
        curves = np.degrees(problem.responses(candidates)[0].angle[:, :, 0])
        for shade, curve in zip(np.linspace(0, 0.95, CURVES), curves, strict=True):
            axes.plot(*_thin(time[part], curve[part]), color=mpl.colormaps["viridis"](shade), lw=0.8)
        axes.plot(*_thin(time[part], angle[part]), **DATA)
        axes.set_title(f"{name}: {parameter.lower:g} to {parameter.upper:g} {parameter.unit}", fontsize=9)
        axes.set(xlabel="time [s]", ylabel="angle [deg]")


def _surface(drawing: Drawing, runs: Runs, figure: Figure) -> None:
    """The error over two parameters, all others at the truth."""
    first, second = figure.parameters
    found = surface(runs.problem, runs.theta, (first, second), runs.plan.points(figure), None)
    drawing.set_figheight(4.8)
    axes: Any = drawing.add_subplot(projection="3d")
    error = np.where(np.isfinite(found.error), np.degrees(found.error), np.nan)
    axes.plot_surface(
        *np.meshgrid(*found.values, indexing="ij"), error, cmap="viridis_r", rstride=1, cstride=1
    )
    labels = [f"{p.name} [{p.unit}]" if p.unit else p.name for p in found.parameters]
    axes.set(xlabel=labels[0], ylabel=labels[1], zlabel="error [deg]")


def _arm(drawing: Drawing, runs: Runs, figure: Figure) -> None:
    """The arm's meshes in the pose that begins the data."""
    arm = runs.problem.settings.arm
    model = load_model(arm).compile()
    data = mujoco.MjData(model)
    data.qpos[[model.joint(name).qposadr[0] for name in arm.joint_names]] = runs.problem.logs[0].start
    mujoco.mj_kinematics(model, data)
    drawing.set_figheight(4.8)
    axes: Any = drawing.add_subplot(projection="3d")
    every: list[Array] = []
    for geom, mesh in enumerate(model.geom_dataid):
        if mesh < 0:
            continue
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        turn = data.geom_xmat[geom].reshape(3, 3).T
        corners = model.mesh_vert[first : first + count] @ turn + data.geom_xpos[geom]
        start, number = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
        color = COLORS[int(model.geom_bodyid[geom]) % len(COLORS)]
        faces = corners[model.mesh_face[start : start + number]]
        axes.add_collection3d(Poly3DCollection(faces, facecolors=color, shade=True, linewidths=0))
        every.append(corners)
    low, high = np.concatenate(every).min(axis=0), np.concatenate(every).max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", box_aspect=high - low)
    axes.view_init(elev=20, azim=-60)


KINDS: dict[str, Callable[[Drawing, Runs, Figure], None]] = {
    "convergence": _convergence,
    "responses": _responses,
    "commands": _commands,
    "segments": _segments,
    "segment bests": _segment_bests,
    "sensitivity": _sensitivity,
    "surface": _surface,
    "arm": _arm,
}
