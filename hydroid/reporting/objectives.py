"""The error that a search minimises: its learning curve, and the Pareto set."""

from collections.abc import Mapping

import numpy as np

from hydroid.parameters import Array
from hydroid.reporting.chart import SERIES, Chart, Mark, Panel, finite, joined, value_axis
from hydroid.settings.problem import ObjectiveSettings


def norm_label(objective: ObjectiveSettings) -> str:
    """Name the objective, with its unit."""
    label = {1: "mean absolute error", 2: "rms error", "inf": "largest error"}[objective.norm]
    return f"relative {label} [-]" if objective.relative else f"{label} [deg]"


def in_reader_units(objective: ObjectiveSettings, values: Array) -> Array:
    """Return objectives in deg, or as they are where relative."""
    return values if objective.relative else np.degrees(values)


def learning(history: Array, objective: ObjectiveSettings) -> Chart:
    """Draw the best objective so far and the population's median against evaluations."""
    tried, (best, median) = history[:, 1], finite(in_reader_units(objective, history[:, 4:6].T))
    marks = (
        Mark("line", tried, median, color="grey", label="median of the population", look="dashed"),
        Mark("line", tried, best, color="blue", label="best so far", width=2),
        Mark("points", tried, best, color="blue", width=5),
    )
    limits, log = value_axis(np.concatenate([best, median]))
    title, label = "Objective against the number of candidates evaluated", norm_label(objective)
    return Chart((Panel("candidates evaluated", label, marks, title, 260, y_limits=limits, log_y=log),))


def pareto(objectives: Array, estimates: Mapping[str, Array], objective: ObjectiveSettings) -> Chart:
    """Draw each candidate of the Pareto set, and the estimates, as a line over the segments' objectives.

    `objectives`, shape (n, S + 1), end with that over the whole record; the 100 lowest there are drawn.
    """
    front = finite(in_reader_units(objective, objectives[:, :-1]))
    front = front[np.argsort(objectives[:, -1], kind="stable")[:100]]
    at = np.arange(1.0, front.shape[1] + 1)
    # one line with gaps: a line each would be a legend entry and a glyph each
    lines = joined(np.column_stack([at, one]) for one in front)
    kind, label = "points" if len(at) == 1 else "line", f"Pareto set ({len(objectives)})"
    marks = [Mark(kind, *lines, color="grey", label=label, width=1, alpha=0.6)]
    for color, (name, segments) in zip(SERIES, estimates.items(), strict=False):
        one = finite(in_reader_units(objective, segments))
        marks.append(Mark("line", at, one, color=color, label=name, width=2))
        marks.append(Mark("points", at, one, color=color, width=6))
    limits, log = value_axis(np.concatenate([mark.y for mark in marks]))
    title, label = "Error in each segment, one line per candidate", norm_label(objective)
    return Chart((Panel("segment", label, tuple(marks), title, 300, None, limits, log),))
