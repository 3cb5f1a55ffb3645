"""The chart of the residual checks: each residual over time, angle, velocity and command."""

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from hydroid.advice.proposals import UNITS
from hydroid.advice.residuals import Regressor, ResidualCheck
from hydroid.reporting.chart import ZERO, Chart, Mark, Panel
from hydroid.reporting.page import Plot, Tab

_CAPTION = "Measured minus simulated angle, and its mean with two standard errors. Shaded: at a stop."


def residual_tabs(checks: Sequence[ResidualCheck], places: Sequence[str]) -> tuple[Tab, ...]:
    """Return a tab for each residual; `places` names joint and log of each."""
    return tuple(
        Tab(place, (Plot(f"residual_{i + 1}", _CAPTION, partial(residual_panels, check)),))
        for i, (check, place) in enumerate(zip(checks, places, strict=True))
    )


def residual_panels(check: ResidualCheck) -> Chart:
    """Draw a residual over time, angle, velocity and command, and its autocorrelation."""
    time, period = check.time, float(check.time[1] - check.time[0])
    edges = np.flatnonzero(np.diff(check.at_stop, prepend=False, append=False))
    starts, ends = time[edges[::2]], time[np.minimum(edges[1::2], len(time) - 1)]
    stops = Mark("spans", starts, end=ends, color="pink", label="at its stop", alpha=0.25)
    residual = Mark("line", time, np.degrees(check.residual), color="orange", width=1.2)
    panels = [Panel("time [s]", "residual [deg]", (stops, residual) if len(edges) else (residual,))]
    for what in Regressor:
        if (binned := check.binned.get(what)) is not None:
            factor = 1.0 if what is Regressor.COMMAND else math.degrees(1.0)
            at = 0.5 * factor * (binned.edges[:-1] + binned.edges[1:])
            mean, error, spread = map(np.degrees, (binned.mean, 2 * binned.error, binned.deviation))
            samples: dict[str, Any] = {"color": "pale", "label": "spread of the samples", "alpha": 0.5}
            errors: dict[str, Any] = {"color": "orange", "label": "two standard errors", "alpha": 0.3}
            marks = (
                Mark("band", at, mean - spread, mean + spread, **samples),
                Mark("band", at, mean - error, mean + error, **errors),
                Mark("line", at, mean, color="orange", label="mean"),
                Mark("points", at, mean, color="orange", width=6),
                ZERO,
            )
            panels.append(Panel(f"{what.value} [{UNITS[what]}]", "residual [deg]", marks))
    lags = period * np.arange(len(check.autocorrelation), dtype=float)
    panels.append(Panel("lag [s]", "autocorrelation", (Mark("line", lags, check.autocorrelation), ZERO)))
    return Chart(tuple(panels), columns=3, bins=300)
