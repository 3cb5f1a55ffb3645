"""The chart of the residual checks: each residual over time, angle, velocity and command."""

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from hydroid.advice.residuals import Binned, Regressor, ResidualCheck
from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.report.chart import Chart, Mark, Panel
from hydroid.report.page import Plot, Tab, log_names

UNITS = {Regressor.ANGLE: "deg", Regressor.VELOCITY: "deg/s", Regressor.COMMAND: "%"}
_MOST = 8
"""angles that are drawn, those with the largest errors"""
_HEIGHT = 190
_BINS = 300
_CAPTION = (
    "Measured minus simulated angle over time, and its mean in intervals of angle, velocity and command, "
    "with two standard errors of the mean for correlated samples. Shaded stretches of time: the joint stands "
    "at its stop."
)


def residual_tabs(
    problem: Problem, checks: Sequence[ResidualCheck], notes: Callable[[ResidualCheck], str]
) -> tuple[Tab, ...]:
    """Return a tab for each of the angles with the largest errors."""
    names = log_names(problem.logs)
    tabs: list[Tab] = []
    for i, check in enumerate(sorted(checks, key=lambda check: -check.rms)[:_MOST]):
        draw = partial(residual_panels, problem, check)
        plot = Plot(f"residual_checks_{i + 1}" if i else "residual_checks", _CAPTION, draw)
        tabs.append(Tab(f"joint {check.joint}, {names[check.log]}", (plot,), notes(check)))
    return tuple(tabs)


def residual_panels(problem: Problem, check: ResidualCheck) -> Chart:
    """Draw a residual over time, angle, velocity and command, and its autocorrelation."""
    regressed = (_over(what, check.binned[what]) for what in Regressor if what in check.binned)
    period = problem.logs[check.log].period
    return Chart((_over_time(check), *regressed, _correlation(check, period)), columns=3, bins=_BINS)


def _over_time(check: ResidualCheck) -> Panel:
    line = Mark("line", check.time, np.degrees(check.residual), color="orange", width=1.2)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], check.at_stop, [False]]).astype(int)))
    starts, ends = edges[::2], np.minimum(edges[1::2], len(check.time) - 1)
    stops = Mark(
        "spans", check.time[starts], end=check.time[ends], color="pink", label="at its stop", alpha=0.25
    )
    marks = (stops, line) if len(starts) else (line,)
    return Panel("time [s]", "residual [deg]", marks, height=_HEIGHT)


def _over(what: Regressor, binned: Binned) -> Panel:
    factor = 1.0 if what is Regressor.COMMAND else math.degrees(1.0)
    centre: Array = 0.5 * factor * (binned.edges[:-1] + binned.edges[1:])
    mean, error, spread = (np.degrees(v) for v in (binned.mean, 2 * binned.error, binned.deviation))
    marks = (
        Mark(
            "band",
            centre,
            mean - spread,
            mean + spread,
            color="pale",
            label="spread of the samples",
            alpha=0.5,
        ),
        Mark(
            "band", centre, mean - error, mean + error, color="orange", label="two standard errors", alpha=0.3
        ),
        Mark("line", centre, mean, color="orange", label="mean"),
        Mark("points", centre, mean, color="orange", width=6),
        Mark("rule", y=np.zeros(1), color="grey", width=1),
    )
    return Panel(f"{what.value} [{UNITS[what]}]", "residual [deg]", marks, height=_HEIGHT)


def _correlation(check: ResidualCheck, period: float) -> Panel:
    lags = period * np.arange(len(check.autocorrelation), dtype=float)
    line = Mark("line", lags, check.autocorrelation, color="blue")
    zero = Mark("rule", y=np.zeros(1), color="grey", width=1)
    return Panel("lag [s]", "autocorrelation", (line, zero), height=_HEIGHT)
