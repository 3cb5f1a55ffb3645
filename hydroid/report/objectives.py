"""The error that a search minimises: learning curve, Pareto set, and the error over two parameters."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, NullLocator

from hydroid.parameters import Array
from hydroid.posterior.sweep import WIDE, Surface
from hydroid.report import style
from hydroid.report.chart import SERIES, Chart, Mark, Panel
from hydroid.report.page import Page, Plot, Section
from hydroid.report.phrases import in_reader_units, norm_label
from hydroid.report.table import Cell, Table, numbers_csv
from hydroid.settings.problem import ObjectiveSettings
from hydroid.words import number

_MOST_LINES = 100
"""candidates of the Pareto set that are drawn, those with the lowest errors"""
_LEVELS = 14


def learning(history: Array, objective: ObjectiveSettings) -> Chart:
    """Draw the best objective so far and the population's median against evaluations."""
    evaluations = history[:, 1]
    best, median = (style.finite(in_reader_units(objective, history[:, c])) for c in (4, 5))
    marks = (
        Mark("line", evaluations, median, color="grey", label="median of the population", look="dashed"),
        Mark("line", evaluations, best, color="blue", label="best so far", width=2),
        Mark("points", evaluations, best, color="blue", width=5),
    )
    limits, log = value_axis(np.concatenate([best, median]))
    title = "Objective against the number of candidates evaluated"
    panel = Panel(
        "candidates evaluated", norm_label(objective), marks, title, 260, y_limits=limits, log_y=log
    )
    return Chart((panel,))


def pareto(objectives: Array, estimates: Mapping[str, Array], objective: ObjectiveSettings) -> Chart:
    """Draw each candidate of the Pareto set, and the estimates, as a line over the segments' objectives.

    `objectives`, shape (n, S + 1), end with that over the whole record.
    """
    front = style.finite(in_reader_units(objective, objectives[:, :-1]))
    front = front[np.argsort(objectives[:, -1], kind="stable")[:_MOST_LINES]]
    at = np.arange(1.0, front.shape[1] + 1)
    # one line with gaps: a line each would be a legend entry and a glyph each
    along = np.tile(np.append(at, np.nan), len(front))
    values = np.column_stack([front, np.full(len(front), np.nan)]).ravel()
    label = f"Pareto set ({len(objectives)})"
    marks = [Mark("line", along, values, color="grey", label=label, width=1, alpha=0.6)]
    if len(at) == 1:
        marks.append(Mark("points", along, values, color="grey", width=6))
    for color, (name, segments) in zip(SERIES, estimates.items(), strict=False):
        one = style.finite(in_reader_units(objective, segments))
        marks.append(Mark("line", at, one, color=color, label=name, width=2))
        marks.append(Mark("points", at, one, color=color, width=6))
    limits, log = value_axis(np.concatenate([mark.y for mark in marks]))
    title, ends = "Error in each segment, one line per candidate", (0.7, len(at) + 0.3)
    return Chart(
        (Panel("segment", norm_label(objective), tuple(marks), title, 300, ends, limits, log_y=log),)
    )


def value_axis(values: Array) -> tuple[tuple[float, float] | None, bool]:
    """Return limits and whether an axis is logarithmic: where positive values span more than a decade."""
    known = values[np.isfinite(values)]
    if not known.size or (known.min() > 0 and known.max() > 10 * known.min()):
        return None, bool(known.size)
    top = 1.05 * float(known.max()) if known.max() > 0 else 1.0
    return (min(0.0, 1.05 * float(known.min())), top), False


def surface_page(surfaces: Sequence[Surface], objective: ObjectiveSettings) -> Page:
    """Return the page of error surfaces: the table `surface` and one CSV per surface."""
    rows: list[tuple[Cell, ...]] = []
    plots: list[Plot] = []
    data: dict[str, str] = {}
    for surface in surfaces:
        first, second = surface.parameters
        name = f"surface_{first.name}_{second.name}"
        caption = f"Error over {first.name} and {second.name}, all other parameters held at the estimate."
        plots.append(Plot(name, caption, partial(contours, surface, objective)))
        a, b = (grid.ravel() for grid in np.meshgrid(*surface.values, indexing="ij"))
        header = (first.name, second.name, "error" if objective.relative else "error_deg")
        error = in_reader_units(objective, surface.error.ravel())
        data[f"{name}.csv"] = numbers_csv(header, np.column_stack([a, b, error]))
        *lowest, least = surface.lowest
        least, at = in_reader_units(objective, np.array([least, surface.estimate_error]))
        rows.append((f"{first.name}, {second.name}", *lowest, float(least), *surface.estimate, float(at)))
    unit = norm_label(objective)
    columns = (f"{c}, {which}" for which in ("lowest", "estimate") for c in ("first", "second", unit))
    note = "All other parameters are held at the estimate, which is a grid point where the grid reaches it."
    table = Table("Error over two parameters", ("parameters", *columns), tuple(rows), note)
    section = Section("Lowest points and estimates", tables={"surface": table}, plots=tuple(plots))
    lead = f"{unit.capitalize()} over the whole record, all other parameters held at the estimate."
    return Page("surface", "Error over two parameters", lead, (section,), data=data)


def contours(surface: Surface, objective: ObjectiveSettings) -> Figure:
    """Draw contours of the error and mark the estimate, the lowest point and where simulations diverge.

    As in the article's figure 11.
    """
    error = in_reader_units(objective, style.finite(surface.error)).T
    drawing = style.figure(5.0, right=0.3)
    axes = drawing.subplots()
    axes.set_facecolor(style.PALE)
    known = error[np.isfinite(error)]
    if known.size and known.max() > known.min():
        # a point that reproduces its data exactly would stretch a logarithmic scale to nothing
        low = max(float(known.min()), 1e-3 * float(known.max()))
        wide = known.max() > 5 * low
        levels = (np.geomspace if wide else np.linspace)(low, float(known.max()), _LEVELS)
        norm = (LogNorm if wide else Normalize)(levels[0], levels[-1])
        shown = *surface.values, np.clip(error, low, None), levels
        filled = axes.contourf(*shown, norm=norm, cmap="viridis_r", extend="neither")
        axes.contour(*shown, colors="white", linewidths=0.4, alpha=0.6)
        look: dict[str, Any] = {
            "format": FuncFormatter(style.tick),
            "label": norm_label(objective),
            "pad": 0.03,
        }
        bar = drawing.colorbar(filled, ax=axes, **look)
        bar.set_ticks(list(levels[:: max(1, _LEVELS // 6)]))
        bar.ax.yaxis.set_minor_locator(NullLocator())
    unit = "" if objective.relative else " deg"
    for (x, y, value), color, mark, size, label in (
        (surface.lowest, "white", "o", 10, "lowest point drawn"),
        # where both are one point, the estimate lies on the other
        ((*surface.estimate, surface.estimate_error), style.REFINED, "D", 6, "estimate"),
    ):
        text = f"{label} ({number(float(in_reader_units(objective, np.array(value))))}{unit})"
        look: dict[str, Any] = {
            "markeredgecolor": "black",
            "markersize": size,
            "clip_on": False,
            "linestyle": "none",
        }
        axes.plot(x, y, mark, color=color, label=text, **look)
    infeasible: list[Patch] = []
    if surface.infeasible:
        name = f"infeasible ({surface.infeasible} points)"
        infeasible.append(Patch(facecolor=style.PALE, edgecolor=style.GREY, label=name))
    for axis, values, parameter in zip(
        (axes.xaxis, axes.yaxis), surface.values, surface.parameters, strict=True
    ):
        if values[0] > 0 and values[-1] > WIDE * values[0]:
            style.logarithmic(axis)
        axis.set_label_text(f"{parameter.name} [{parameter.unit}]" if parameter.unit else parameter.name)
    axes.set(xlim=surface.values[0][[0, -1]], ylim=surface.values[1][[0, -1]])
    first, second = (parameter.name for parameter in surface.parameters)
    axes.set_title(f"Error over {first} and {second}, all other parameters at the estimate")
    style.legend_below(drawing, axes, extra=infeasible)
    return drawing
