"""The figures of a study, in the article's arrangement, as vectors."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure as Drawing
from studies import Figure, Runs

from hydroid.parameters import Array
from hydroid.problem.problem import Problem

COLORS = [f"C{i}" for i in range(10)]


def draw(runs: Runs, figure: Figure, file: Path) -> None:
    """Draw one figure of a study as SVG."""
    kinds = {"convergence": _convergence, "sensitivity": _sensitivity, "surface": _surface}
    with mpl.rc_context({"font.size": 9, "svg.hashsalt": "hydroid", "axes.spines.top": False}):
        size = (7.0, 4.8 if figure.kind in ("surface", "sensitivity") else 3.6)
        drawing = Drawing(size, layout="constrained")
        kinds.get(figure.kind, _responses)(drawing, runs, figure)
        drawing.suptitle(figure.title, fontsize=10)
        drawing.savefig(file, metadata={"Date": None})


def _line(axes: Any, time: Array, values: Array, **how: Any) -> None:
    """Draw a curve over time, 1200 samples at most; without more, the data."""
    step = max(1, len(time) // 1200)
    axes.plot(time[::step], values[::step], **(how or {"color": "black", "linestyle": "--", "label": "data"}))


def _convergence(drawing: Drawing, runs: Runs, figure: Figure) -> None:
    """Best objective by generation: the median over seeds, with the middle half of them shaded."""
    axes = drawing.subplots()
    axes.set(xlabel="generation", ylabel="best objective" + ", 0 to 1" * figure.normalized)
    for cell, color in zip(figure.cells or runs.plan.cells, COLORS, strict=False):
        histories = [np.array([step[2] for step in run["history"]], dtype=float) for _, run in runs.of(cell)]
        length = max(map(len, histories))
        curves = np.array([np.pad(h, (0, length - len(h)), mode="edge") for h in histories])
        if figure.normalized:
            low, high = curves[:, -1:], np.nanmax(curves, axis=1, keepdims=True)
            curves = (curves - low) / np.where(high > low, high - low, 1.0)
        lower, middle, upper = np.nanquantile(curves, (0.25, 0.5, 0.75), axis=0)
        axes.plot(np.arange(1, length + 1), middle, color=color, label=cell)
        axes.fill_between(np.arange(1, length + 1), lower, upper, color=color, alpha=0.12, linewidth=0)
    axes.set_yscale("linear" if figure.normalized else "log")
    axes.legend(fontsize=8)


def _responses(drawing: Drawing, runs: Runs, figure: Figure) -> None:
    """The angle, and responses of the median run of each cell."""
    axes, problem, (time, angle) = drawing.subplots(), runs.problem, runs.record
    axes.set(xlabel="time [s]", ylabel="angle [deg]")
    _line(axes, time, angle)
    for cell, color in zip(figure.cells, COLORS, strict=False):
        if (run := runs.median_run(cell)) is None:
            continue
        of_cell = Problem(runs.plan.cells[cell], problem.logs[:1])
        bests = run["segment_bests"] if figure.kind == "segment bests" else []
        for values in (*bests, run["theta"]):
            theta = of_cell.parameters.vector(values, "a run")
            response = np.degrees(of_cell.responses(theta[None])[0].angle[0, :, 0])
            how = {"lw": 2, "label": cell} if values is run["theta"] else {"lw": 0.6, "alpha": 0.5}
            _line(axes, time, response, color=color, **how)
    axes.legend(fontsize=8)


def _sensitivity(drawing: Drawing, runs: Runs, figure: Figure) -> None:
    """The output for 20 values of each of some parameters over their bounds, dark to light."""
    problem, (time, angle) = runs.problem, runs.record
    panels = drawing.subplots(-(-len(figure.parameters) // 2), 2, sharex=True, squeeze=False)
    for axes, name in zip(panels.ravel(), figure.parameters, strict=False):
        column = problem.parameters.names.index(name)
        parameter = problem.parameters.parameters[column]
        candidates = np.tile(runs.theta, (20, 1))
        candidates[:, column] = parameter.at(np.linspace(0, 1, 20))
        curves = np.degrees(problem.responses(candidates)[0].angle[:, :, 0])
        for shade, curve in zip(np.linspace(0, 0.95, 20), curves, strict=True):
            _line(axes, time, curve, color=mpl.colormaps["viridis"](shade), lw=0.8)
        _line(axes, time, angle)
        axes.set_title(f"{name}: {parameter.lower:g} to {parameter.upper:g} {parameter.unit}", fontsize=9)
        axes.set(xlabel="time [s]", ylabel="angle [deg]", xlim=figure.window_s)


def _surface(drawing: Drawing, runs: Runs, figure: Figure) -> None:
    """The error over two parameters, even on their scales; all others are at the truth."""
    problem, count = runs.problem, 7 if runs.plan.quick else 31
    at = [problem.parameters.names.index(name) for name in figure.parameters]
    chosen = [problem.parameters.parameters[i] for i in at]
    first, second = np.meshgrid(*(p.at(np.linspace(0, 1, count)) for p in chosen), indexing="ij")
    points = np.tile(runs.theta, (count**2, 1))
    points[:, at] = np.stack([first, second], axis=-1).reshape(-1, 2)
    error = np.degrees(problem.evaluate(points).overall.reshape(count, count))
    axes = drawing.add_subplot(projection="3d")
    shown = np.where(np.isfinite(error), error, np.nan)
    axes.plot_surface(first, second, shown, cmap="viridis_r", rstride=1, cstride=1)
    labels = [f"{p.name} [{p.unit}]" if p.unit else p.name for p in chosen]
    axes.set(xlabel=labels[0], ylabel=labels[1], zlabel="error [deg]")
