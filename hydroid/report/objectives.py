"""The error that a search minimises: its learning curve, and the Pareto set."""

import numpy as np

from hydroid.fitting.fit import Fit
from hydroid.report.chart import SERIES, Chart, Mark, Panel, finite, joined, value_axis
from hydroid.report.phrases import estimate_label, in_reader_units, norm_label
from hydroid.settings.problem import ObjectiveSettings

_MOST_LINES = 100
"""candidates of the Pareto set that are drawn, those with the lowest errors"""


def learning(fit: Fit, objective: ObjectiveSettings) -> Chart:
    """Draw the best objective so far and the population's median against evaluations."""
    evaluations = fit.history[:, 1]
    best, median = (finite(in_reader_units(objective, fit.history[:, column])) for column in (4, 5))
    marks = (
        Mark("line", evaluations, median, color="grey", label="median of the population", look="dashed"),
        Mark("line", evaluations, best, color="blue", label="best so far", width=2),
        Mark("points", evaluations, best, color="blue", width=5),
    )
    limits, log = value_axis(np.concatenate([best, median]))
    title, y = "Objective against the number of candidates evaluated", norm_label(objective)
    return Chart((Panel("candidates evaluated", y, marks, title, 260, y_limits=limits, log_y=log),))


def pareto(fit: Fit, objective: ObjectiveSettings) -> Chart:
    """Draw each candidate of the Pareto set as a line over the segments' objectives."""
    front = finite(in_reader_units(objective, fit.front[1].segments))
    front = front[np.argsort(fit.front[1].overall, kind="stable")[:_MOST_LINES]]
    at = np.arange(1.0, front.shape[1] + 1)
    # one line with gaps: a line each would be a legend entry and a glyph each
    lines = joined(np.column_stack([at, one]) for one in front)
    kind = "points" if len(at) == 1 else "line"
    marks = [Mark(kind, *lines, color="grey", label=f"Pareto set ({len(fit.front[0])})", width=1, alpha=0.6)]
    most_important_first = dict.fromkeys((fit.final, fit.searched.name, *fit.estimates))
    for color, name in zip(SERIES, most_important_first, strict=False):
        one = finite(in_reader_units(objective, fit.estimates[name].segments))
        marks.append(Mark("line", at, one, color=color, label=estimate_label(fit, name), width=2))
        marks.append(Mark("points", at, one, color=color, width=6))
    limits, log = value_axis(np.concatenate([mark.y for mark in marks]))
    title, ends = "Error in each segment, one line per candidate", (0.7, len(at) + 0.3)
    y = norm_label(objective)
    return Chart((Panel("segment", y, tuple(marks), title, 300, ends, limits, log_y=log),))
