"""The figure of the residual checks: each residual over time, angle, velocity and command."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.report import style
from hydroid.report.page import log_names
from hydroid.suggestion.residuals import Binned, Regressor, ResidualCheck

UNITS = {Regressor.ANGLE: "deg", Regressor.VELOCITY: "deg/s", Regressor.COMMAND: "%"}
_MOST_ROWS = 4
"""angles that are drawn, those with the largest errors"""
_COLUMNS = 5


def residual_panels(problem: Problem, checks: Sequence[ResidualCheck]) -> Figure:
    """Draw each residual over time, angle, velocity and command, and its autocorrelation."""
    shown = sorted(checks, key=lambda check: -check.rms)[:_MOST_ROWS]
    names = log_names(problem.logs)
    drawing = style.figure(0.9 + 1.9 * len(shown), 11.0, left=0.75, top=0.75, bottom=0.55)
    style.headline(drawing, "The residual and what it depends on")
    panels = drawing.subplots(
        len(shown), _COLUMNS, squeeze=False, gridspec_kw={"wspace": 0.3, "hspace": 0.75}
    )
    for row, check in zip(panels, shown, strict=True):
        _over_time(row[0], check)
        row[0].set_title(f"joint {check.joint}, {names[check.log]}", fontsize=8, fontweight="normal")
        for axes, what in zip(row[1:4], Regressor, strict=True):
            _over(axes, what, check.binned.get(what))
        _correlation(row[4], check, problem.logs[check.log].period)
        row[0].set_ylabel("residual [deg]", fontsize=8)
        for axes in row:
            axes.tick_params(labelsize=7)
    return drawing


def _over_time(axes: Axes, check: ResidualCheck) -> None:
    axes.plot(*style.decimated(check.time, np.degrees(check.residual)), color=style.REFINED, linewidth=0.8)
    low, high = axes.get_ylim()
    axes.fill_between(
        check.time, low, high, where=check.at_stop.tolist(), color="#CC3311", alpha=0.25, linewidth=0
    )
    axes.set_ylim(low, high)
    axes.margins(x=0)
    axes.set_xlabel("time [s]", fontsize=8)


def _over(axes: Axes, what: Regressor, binned: Binned | None) -> None:
    axes.set_xlabel(f"{what.value} [{UNITS[what]}]", fontsize=8)
    if binned is None:
        axes.set_axis_off()
        return
    factor = 1.0 if what is Regressor.COMMAND else math.degrees(1.0)
    centre: Array = 0.5 * factor * (binned.edges[:-1] + binned.edges[1:])
    bars: dict[str, Any] = {"fmt": "none", "capsize": 0}
    axes.errorbar(
        centre, np.degrees(binned.mean), np.degrees(binned.deviation), ecolor=style.PALE, elinewidth=4, **bars
    )
    axes.errorbar(
        centre, np.degrees(binned.mean), 2 * np.degrees(binned.error), ecolor=style.MEASURED, **bars
    )
    axes.plot(centre, np.degrees(binned.mean), "o-", color=style.REFINED, markersize=3, linewidth=1.0)
    axes.axhline(0.0, color=style.GREY, linewidth=0.8)


def _correlation(axes: Axes, check: ResidualCheck, period: float) -> None:
    axes.plot(period * np.arange(len(check.autocorrelation)), check.autocorrelation, color=style.SEARCH)
    axes.axhline(0.0, color=style.GREY, linewidth=0.8)
    axes.margins(x=0)
    axes.set_xlabel("lag [s]: autocorrelation", fontsize=8)
