"""How a search went: its learning curve, and the Pareto set it ended with."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import StrMethodFormatter

from hydroid.fitting.fit import Fit
from hydroid.problem.problem import Problem
from hydroid.report.plots.style import (
    GREY,
    REFINED,
    SEARCH,
    estimate_looks,
    every,
    figure,
    finite,
    legend_below,
    styled,
    value_axis,
)
from hydroid.report.words import estimate_label, in_reader_units, norm_label


@styled
def learning(problem: Problem, fit: Fit) -> Figure:
    """Best of the run and median of the population against evaluations."""
    settings = problem.settings.objective
    evaluations = fit.history[:, 1]
    best, median = (finite(in_reader_units(settings, fit.history[:, c])) for c in (4, 5))
    drawing = figure(3.4)
    axes = drawing.subplots()
    marker = "o" if len(evaluations) < 3 else ""
    axes.plot(
        evaluations, median, color=GREY, linestyle="--", marker=marker, label="median of the population"
    )
    axes.plot(evaluations, best, color=SEARCH, linewidth=2.0, marker=marker, label="best so far")
    value_axis(axes.yaxis, np.concatenate([best, median]))
    axes.set_title("Learning curve: the search's objective")
    axes.set_xlabel("parameter sets evaluated")
    axes.set_ylabel(norm_label(settings))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
    legend_below(drawing, axes)
    return drawing


@styled
def pareto(problem: Problem, fit: Fit) -> Figure:
    """Parallel coordinates: each line is a parameter set, each position the objective of one segment."""
    settings = problem.settings.objective
    front = finite(in_reader_units(settings, fit.front[1].segments))
    drawing = figure(3.9)
    axes = drawing.subplots()
    count = front.shape[1]
    at = np.arange(1, count + 1)
    alone = count == 1
    for row in front:
        axes.plot(at, row, color=GREY, linewidth=0.8, alpha=0.55, marker="_" if alone else "", markersize=14)
    handles = [Line2D([], [], color=GREY, linewidth=0.8, label=f"Pareto set ({len(front)})")]
    shown = [front.ravel()]
    for depth, (name, (color, mark)) in enumerate(estimate_looks(fit).items()):
        values = finite(in_reader_units(settings, fit.estimates[name].segments))
        shown.append(values)
        wide = 2.0 if color in (SEARCH, REFINED) else 1.3
        label = estimate_label(fit, name)
        (line,) = axes.plot(
            at, values, color=color, linewidth=wide, marker=mark, label=label, zorder=4 - depth / 10
        )
        handles.append(line)
    value_axis(axes.yaxis, np.concatenate(shown))
    axes.set_title("Pareto set: error in each segment")
    axes.set_xlabel("segment")
    axes.set_ylabel(norm_label(settings))
    axes.set_xlim(0.7, count + 0.3)
    axes.set_xticks(at[:: every(count, 24)])
    drawing.legend(handles=handles, loc="outside lower center", ncols=3)
    return drawing
