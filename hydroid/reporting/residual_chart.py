"""The chart of the residual checks: each residual over time, angle, velocity and command."""

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from hydroid.advice.proposals import UNITS
from hydroid.advice.residuals import Binned, Regressor, ResidualCheck
from hydroid.parameters import Array
from hydroid.reporting.chart import Chart, Mark, Panel
from hydroid.reporting.page import Plot, Tab

_HEIGHT = 190
_BINS = 300
_CAPTION = (
    "Measured minus simulated angle over time, and its mean over angle, velocity and command with two "
    "standard errors. Shaded: the joint stands at its stop."
)


def residual_tabs(checks: Sequence[ResidualCheck], places: Sequence[str]) -> tuple[Tab, ...]:
    """Return a tab for each residual; `places` names joint and log of each."""
    return tuple(
        Tab(place, (Plot(f"residual_{i + 1}", _CAPTION, partial(residual_panels, check)),))
        for i, (check, place) in enumerate(zip(checks, places, strict=True))
    )


def residual_panels(check: ResidualCheck) -> Chart:
    """Draw a residual over time, angle, velocity and command, and its autocorrelation."""
    regressed = (_over(what, check.binned[what]) for what in Regressor if what in check.binned)
    period = float(check.time[1] - check.time[0])
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
