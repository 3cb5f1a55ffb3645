"""The error that a search minimises: learning curve, Pareto set, and the error over two parameters."""

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, NullLocator, StrMethodFormatter

from hydroid.fitting.fit import Fit
from hydroid.report import style
from hydroid.report.page import Page, Plot, Section
from hydroid.report.phrases import estimate_label, in_reader_units, norm_label
from hydroid.report.table import Cell, Table, number, numbers_csv
from hydroid.settings.problem import ObjectiveSettings
from hydroid.uncertainty.sweep import WIDE, Surface

_MOST_SEGMENT_LABELS = 24
_LEVELS = 14


def learning(fit: Fit, objective: ObjectiveSettings) -> Figure:
    """Draw the best objective so far and the population's median against evaluations."""
    evaluations = fit.history[:, 1]
    best, median = (style.finite(in_reader_units(objective, fit.history[:, c])) for c in (4, 5))
    drawing = style.figure(3.4)
    axes = drawing.subplots()
    marker = "o" if len(evaluations) < 3 else ""
    axes.plot(evaluations, median, "--", color=style.GREY, marker=marker, label="median of the population")
    axes.plot(evaluations, best, color=style.SEARCH, linewidth=2.0, marker=marker, label="best so far")
    style.value_axis(axes.yaxis, np.concatenate([best, median]))
    axes.set_title("Objective against the number of candidates evaluated")
    axes.set_xlabel("candidates evaluated")
    axes.set_ylabel(norm_label(objective))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
    style.legend_below(drawing, axes)
    return drawing


def pareto(fit: Fit, objective: ObjectiveSettings) -> Figure:
    """Draw each candidate of the Pareto set as a line over the segments' objectives."""
    front = style.finite(in_reader_units(objective, fit.front[1].segments))
    drawing = style.figure(3.9)
    axes = drawing.subplots()
    count = front.shape[1]
    at = np.arange(1, count + 1)
    if count == 1:
        axes.plot(np.ones(len(front)), front[:, 0], "_", color=style.GREY, markersize=14, alpha=0.55)
    look: dict[str, Any] = {
        "colors": style.GREY,
        "linewidths": 0.8,
        "alpha": 0.55,
        "label": f"Pareto set ({len(front)})",
    }
    axes.add_collection(LineCollection([np.column_stack([at, row]) for row in front], **look))
    drawn = [front.ravel()]
    for depth, (name, (color, mark)) in enumerate(style.estimate_looks(fit).items()):
        values = style.finite(in_reader_units(objective, fit.estimates[name].segments))
        drawn.append(values)
        look = {"linewidth": 2.0 if color in (style.SEARCH, style.REFINED) else 1.3, "zorder": 4 - depth / 10}
        axes.plot(at, values, color=color, marker=mark, label=estimate_label(fit, name), **look)
    style.value_axis(axes.yaxis, np.concatenate(drawn))
    axes.set_title("Error in each segment, one line per candidate")
    axes.set_xlabel("segment")
    axes.set_ylabel(norm_label(objective))
    axes.set_xlim(0.7, count + 0.3)
    axes.set_xticks(at[:: math.ceil(count / _MOST_SEGMENT_LABELS)])
    style.legend_below(drawing, axes)
    return drawing


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
