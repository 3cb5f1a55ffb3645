"""The figures of a study, in the article's arrangement, as vectors."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure as Drawing
from pandas import DataFrame
from scipy.ndimage import minimum_filter
from studies import Figure, Plan, Runs

from hydroid.parameters import Array
from hydroid.problem.problem import Problem


def draw(plan: Plan, runs: Runs, figure: Figure, file: Path) -> None:
    kinds = {
        "convergence": _convergence,
        "sensitivity": _sensitivity,
        "surface": _surface,
    }
    with mpl.rc_context(
        {"font.size": 9, "svg.hashsalt": "hydroid", "axes.spines.top": False}
    ):
        size = (7.0, 4.8 if figure.kind in ("surface", "sensitivity") else 3.6)
        drawing = Drawing(size, layout="constrained")
        kinds.get(figure.kind, _responses)(drawing, plan, runs, figure)
        drawing.suptitle(figure.title, fontsize=10)
        drawing.savefig(file, metadata={"Date": None})


def _lines(
    axes: Any, problem: Problem, curves: Array, window: slice = slice(None), **how: Any
) -> None:
    """Draw angles over time, (n, T), 500 samples at most."""
    time = problem.logs[0].time[window]
    step = max(1, len(time) // 500)
    axes.plot(time[::step], curves[:, window].T[::step], **how)


def _data(axes: Any, problem: Problem, window: slice = slice(None)) -> None:
    angle = np.degrees(problem.logs[0].angle[:, problem.outputs])
    _lines(axes, problem, angle.T, window, color="black", linestyle="--", label="data")


def _convergence(drawing: Drawing, plan: Plan, runs: Runs, figure: Figure) -> None:
    """Best objective by generation: the median over seeds, with the middle half of them
    shaded."""
    axes = drawing.subplots()
    axes.set(
        xlabel="generation", ylabel="best objective" + ", 0 to 1" * figure.normalized
    )
    for number, cell in enumerate(figure.cells):
        texts = [
            run["history"] for run in runs if run["cell"] == cell and "history" in run
        ]
        if not texts:
            continue
        curves = (
            DataFrame([[float(v) for v in text.split()] for text in texts])
            .ffill(axis=1)
            .to_numpy()
        )
        if figure.normalized:
            low, high = curves[:, -1:], np.nanmax(curves, axis=1, keepdims=True)
            curves = (curves - low) / np.where(high > low, high - low, 1.0)
        lower, middle, upper = np.nanquantile(curves, (0.25, 0.5, 0.75), axis=0)
        generation = np.arange(1, len(middle) + 1)
        axes.plot(
            generation, middle, color=f"C{number}", label=f"{cell}, seeds: {len(texts)}"
        )
        axes.fill_between(
            generation, lower, upper, color=f"C{number}", alpha=0.12, linewidth=0
        )
        axes.legend(fontsize=8)
    axes.set_yscale("linear" if figure.normalized else "log")


def _responses(drawing: Drawing, plan: Plan, runs: Runs, figure: Figure) -> None:
    """The angle, and responses of a run of each cell: the one of median error among
    those of one record.

    With the segments' best candidates it is the errors, since the responses lie on each
    other.
    """
    axes, with_bests = drawing.subplots(), figure.kind == "segment bests"
    axes.set(xlabel="time [s]", ylabel="error [deg]" if with_bests else "angle [deg]")
    column = "segment bests" if with_bests else "rms error"
    if not (
        shown := [run for run in runs if run["cell"] in figure.cells and column in run]
    ):
        return
    seed = min(run["seed"] for run in shown)
    for number, cell in enumerate(figure.cells):
        of_one = [
            r
            for r in shown
            if r["cell"] == cell and plan.log(r["seed"]) is plan.log(seed)
        ]
        run = sorted(of_one, key=lambda r: r["rms error"])[(len(of_one) - 1) // 2]
        problem = plan.problem(seed, cell)
        if not number and not with_bests:
            _data(axes, problem)
        theta = [float(run[f"value {name}"]) for name in problem.parameters.names]
        bests = (
            [best.split() for best in run["segment bests"].split(";")]
            if with_bests
            else []
        )
        angles = problem.responses(np.array([*bests, theta], float))[0].angle[:, :, 0]
        curves = np.degrees(
            angles - with_bests * problem.logs[0].angle[:, problem.outputs[0]]
        )
        _lines(axes, problem, curves[:-1], color=f"C{number}", lw=0.6, alpha=0.5)
        _lines(
            axes,
            problem,
            curves[-1:],
            color=f"C{number}",
            lw=1 + with_bests,
            label=cell,
        )
    axes.legend(fontsize=8)


def _sensitivity(drawing: Drawing, plan: Plan, runs: Runs, figure: Figure) -> None:
    """The output for 20 values of each of some parameters over their bounds, dark to
    light."""
    problem, truth = plan.problem(1), plan.directions(1).truth
    window = slice(
        *np.searchsorted(problem.logs[0].time, figure.window_s or (-np.inf, np.inf))
    )
    panels = drawing.subplots(
        -(-len(figure.parameters) // 2), 2, sharex=True, squeeze=False
    )
    for axes, name in zip(panels.ravel(), figure.parameters, strict=False):
        column = problem.parameters.names.index(name)
        parameter, candidates = (
            problem.parameters.parameters[column],
            np.tile(truth, (20, 1)),
        )
        candidates[:, column] = parameter.at(np.linspace(0, 1, 20))
        curves = np.degrees(problem.responses(candidates)[0].angle[:, :, 0])
        axes.set_prop_cycle(color=mpl.colormaps["viridis"](np.linspace(0, 0.95, 20)))
        _lines(axes, problem, curves, window, lw=0.8)
        _data(axes, problem, window)
        axes.set_title(
            f"{name}: {parameter.lower:g} to {parameter.upper:g} {parameter.unit}",
            fontsize=9,
        )
        axes.set(xlabel="time [s]", ylabel="angle [deg]")


def _surface(drawing: Drawing, plan: Plan, runs: Runs, figure: Figure) -> None:
    """The error over two parameters, even on their scales; all others are at the
    truth."""
    problem, count = plan.problem(1), 7 if plan.quick else 31
    at = [problem.parameters.names.index(name) for name in figure.parameters]
    chosen = [problem.parameters.parameters[i] for i in at]
    first, second = np.meshgrid(
        *(p.at(np.linspace(0, 1, count)) for p in chosen), indexing="ij"
    )
    points = np.tile(problem.parameters.vector(plan.truth(1), "truth"), (count**2, 1))
    points[:, at] = np.stack([first, second], axis=-1).reshape(-1, 2)
    error = np.degrees(problem.evaluate(points)[:, -1].reshape(count, count))
    axes, shown = (
        drawing.add_subplot(projection="3d"),
        np.where(np.isfinite(error), error, np.nan),
    )
    minima = int((shown == minimum_filter(error, 3, mode="nearest")).sum())
    axes.set_title(f"{minima} minima on {count} x {count} points", fontsize=9)
    axes.plot_surface(first, second, shown, cmap="viridis_r", rstride=1, cstride=1)
    labels = [f"{p.name} [{p.unit}]" if p.unit else p.name for p in chosen]
    axes.set(xlabel=labels[0], ylabel=labels[1], zlabel="error [deg]")
