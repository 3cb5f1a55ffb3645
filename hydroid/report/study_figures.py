"""The figures of a study, in the article's arrangement."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.report import style
from hydroid.report.flow_chart import flow_chart
from hydroid.report.truth_figures import COLORS, arm_in_space, landscape_figure, record, sensitivity
from hydroid.settings.study_shown import StudyFigure
from hydroid.study.study import StudyRuns

LINES = ("-", "--", "-.", ":")


def draw(runs: StudyRuns, figure: StudyFigure) -> Figure:
    """Draw one figure of a study."""
    return _KINDS[figure.kind](runs, figure)


def _cells(runs: StudyRuns, figure: StudyFigure) -> list[tuple[str, dict[str, Any]]]:
    """Return the drawn cells with the look of each."""
    names = figure.cells or tuple(runs.plan.cells)
    looks: list[dict[str, Any]] = [
        {"color": COLORS[i % len(COLORS)], "linestyle": LINES[i % len(LINES)], "label": name}
        for i, name in enumerate(names)
    ]
    return list(zip(names, looks, strict=True))


def _frame(figure: StudyFigure, xlabel: str, ylabel: str, height: float = 3.6) -> tuple[Figure, Axes]:
    drawing = style.figure(height)
    axes = drawing.subplots()
    axes.set_title(figure.title)
    axes.set_xlabel(xlabel)
    axes.set_ylabel(ylabel)
    return drawing, axes


def _convergence(runs: StudyRuns, figure: StudyFigure) -> Figure:
    """Best objective by generation: the median over seeds, with the middle half of them shaded."""
    label = "best objective, 0 to 1" if figure.normalized else "best objective"
    drawing, axes = _frame(figure, "generation", label)
    for cell, look in _cells(runs, figure):
        histories = [result["history"] for _, result in runs.of(cell)]
        if not histories:
            continue
        length = max(map(len, histories))
        curves = np.full((len(histories), length), np.nan)
        for row, history in zip(curves, histories, strict=True):
            best = [np.nan if step[2] is None else step[2] for step in history]
            row[: len(best)], row[len(best) :] = best, best[-1]
        if figure.normalized:
            low, high = curves[:, -1:], np.nanmax(curves, axis=1, keepdims=True)
            curves = (curves - low) / np.where(high > low, high - low, 1.0)
        at = np.arange(1, length + 1)
        lower, middle, upper = np.nanquantile(curves, (0.25, 0.5, 0.75), axis=0)
        axes.plot(at, middle, **look)
        axes.fill_between(at, lower, upper, color=look["color"], alpha=0.12, linewidth=0)
    if not figure.normalized:
        style.logarithmic(axes.yaxis)
    style.legend_below(drawing, axes, columns=2)
    return drawing


def _spread(runs: StudyRuns, figure: StudyFigure) -> Figure:
    """One dot per run, a line at the median, and the article's value."""
    cells = _cells(runs, figure)
    printed = {
        cell: values[table.columns.index(figure.column)]
        for table in runs.plan.study.tables
        if figure.column in table.columns
        for cell, values in table.article.items()
    }
    drawing = style.figure(0.9 + 0.32 * len(cells), left=style.room_for([c for c, _ in cells], 9.0))
    axes = drawing.subplots()
    axes.set_title(figure.title)
    every: list[float] = []
    for height, (cell, _) in enumerate(cells):
        values = np.array([row.values[figure.column] for row, _ in runs.of(cell)])
        values = values[np.isfinite(values)]
        axes.plot(values, np.full(len(values), height), "o", color=style.SEARCH, alpha=0.6, markersize=4)
        if len(values):
            axes.plot([np.median(values)] * 2, [height - 0.3, height + 0.3], color=style.REFINED, lw=2)
        if (value := printed.get(cell)) is not None:
            axes.plot(value, height, "x", color=style.MEASURED, markersize=7)
            every.append(value)
        every += values.tolist()
    axes.set_yticks(range(len(cells)), [cell for cell, _ in cells], fontsize=9)
    axes.invert_yaxis()
    unit = runs.plan.units[figure.column]
    style.value_axis(axes.xaxis, np.array(every))
    axes.set_xlabel(f"{figure.column} [{unit}]" if unit else figure.column)
    axes.plot((), (), "o", color=style.SEARCH, label="one seed")
    axes.plot((), (), color=style.REFINED, lw=2, label="median")
    if printed:
        axes.plot((), (), "x", color=style.MEASURED, label="article")
    style.legend_below(drawing, axes)
    return drawing


def _response(problem: Problem, values: Mapping[str, float]) -> Array:
    """Return the first compared angle [deg] in the first log that parameters give."""
    theta = problem.parameters.vector(values, "a run")
    return np.degrees(problem.responses(theta[None])[0].angle[0, :, 0])


def _responses(runs: StudyRuns, figure: StudyFigure) -> Figure:
    """The record, and the response of the median run of each cell."""
    drawing, axes = _frame(figure, "time [s]", "angle [deg]")
    time, angle = record(runs)
    axes.plot(*style.decimated(time, angle), color=style.MEASURED, linestyle="--", lw=2.2, label="data")
    for cell, look in _cells(runs, figure):
        if (run := runs.median_run(cell)) is not None:
            problem = Problem(runs.plan.cells[cell], runs.problem.logs[:1])
            response = _response(problem, run[1]["theta"])
            axes.plot(*style.decimated(time, response), color=look["color"], lw=1, label=cell)
    style.legend_below(drawing, axes, columns=2)
    return drawing


def _segment_bests(runs: StudyRuns, figure: StudyFigure) -> Figure:
    """The record, the best candidate of each segment, and their average, of the median run of one cell."""
    drawing, axes = _frame(figure, "time [s]", "angle [deg]")
    time, angle = record(runs)
    axes.plot(*style.decimated(time, angle), color=style.MEASURED, linestyle="--", lw=2.2, label="data")
    (cell, _), *_ = _cells(runs, figure)
    if (run := runs.median_run(cell)) is not None:
        problem = Problem(runs.plan.cells[cell], runs.problem.logs[:1])
        for i, values in enumerate(run[1]["segment_bests"]):
            label = "best of one segment" if i == 0 else None
            axes.plot(
                *style.decimated(time, _response(problem, values)), color=style.SEARCH, lw=0.7, label=label
            )
        estimate = _response(problem, run[1]["theta"])
        axes.plot(*style.decimated(time, estimate), color=style.REFINED, lw=2.0, label=f"estimate ({cell})")
    style.legend_below(drawing, axes)
    return drawing


def _commands(runs: StudyRuns, figure: StudyFigure) -> Figure:
    drawing, axes = _frame(figure, "time [s]", "command [%]", 2.6)
    log = runs.problem.logs[0]
    axes.step(
        *style.decimated(log.time, log.command[:, runs.problem.outputs[0]]), where="post", color=style.SEARCH
    )
    axes.set_ylim(-105, 105)
    return drawing


def _segments(runs: StudyRuns, figure: StudyFigure) -> Figure:
    drawing, axes = _frame(figure, "time [s]", "angle [deg]")
    time, angle = record(runs)
    axes.plot(*style.decimated(time, angle), color=style.SEARCH)
    for i, (first, end) in enumerate(runs.problem.bounds, 1):
        if first < len(time):
            axes.axvline(float(time[first]), color=style.GREY, lw=0.8, linestyle="--")
            middle = (time[first] + time[min(end, len(time)) - 1]) / 2
            axes.text(
                float(middle), 0.97, str(i), transform=axes.get_xaxis_transform(), ha="center", va="top"
            )
    return drawing


def _flow_chart(runs: StudyRuns, figure: StudyFigure) -> Figure:
    return flow_chart(runs.problem.settings.search.ga, figure.title)


_KINDS: dict[str, Callable[[StudyRuns, StudyFigure], Figure]] = {
    "convergence": _convergence,
    "spread": _spread,
    "responses": _responses,
    "commands": _commands,
    "segments": _segments,
    "segment bests": _segment_bests,
    "sensitivity": sensitivity,
    "surface": landscape_figure,
    "arm": arm_in_space,
    "flow chart": _flow_chart,
}
