"""The objectives of a search: its learning curve, and the Pareto set it ended with."""

import math

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.ticker import StrMethodFormatter

from hydroid.fitting.fit import Fit
from hydroid.report.phrases import estimate_label, in_reader_units, norm_label
from hydroid.report.plots import style
from hydroid.settings.problem import ObjectiveSettings

_MOST_SEGMENT_LABELS = 24


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
    style.legend_below(drawing, style.labelled(axes))
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
    lines = LineCollection(
        [np.column_stack([at, row]) for row in front],
        colors=style.GREY,
        linewidths=0.8,
        alpha=0.55,
        label=f"Pareto set ({len(front)})",
    )
    axes.add_collection(lines)
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
    style.legend_below(drawing, style.labelled(axes))
    return drawing
