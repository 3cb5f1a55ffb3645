"""Responses against time: measured and simulated angle, what they differ by, what was commanded."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hydroid.fitting.fit import Fit
from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.report.channels import Channel
from hydroid.report.plots.style import (
    GREY,
    MEASURED,
    OTHERS,
    PALE,
    REFINED,
    SEARCH,
    figure,
    finite,
    legend_below,
    styled,
)
from hydroid.report.table import number
from hydroid.report.words import estimate_label

_NUMBER_ROOM = 0.035  # of the width, for a segment's number
_RUNAWAY = 3.0  # motions of the measured angle: a response farther off than that has run away
_STILL = 1.0  # [deg] motion that counts at least, or a joint at rest would call everything a runaway
_LEAST_ANGLE, _LEAST_RESIDUAL = 0.1, 1e-6  # [deg] height of a panel at least: no picture of rounding


@dataclass(frozen=True, eq=False)
class _Trace:
    """A simulated angle [deg] and how it is drawn."""

    label: str
    angle: Array
    color: str


@styled
def response(problem: Problem, fit: Fit, channel: Channel) -> Figure:
    """Measured angle of one channel and every estimate's response, residual, command; segments numbered."""
    traces: list[_Trace] = []
    others = iter(OTHERS)
    for name in dict.fromkeys([fit.final, fit.searched.name, *fit.estimates]):
        angle = np.degrees(finite(channel.simulated(fit.estimates[name].responses)))
        label = estimate_label(fit, name)
        if name == fit.searched.name:
            traces.append(_Trace(label, angle, SEARCH))
        elif name == fit.final:
            traces.append(_Trace(label, angle, REFINED))
        else:
            traces.append(_Trace(label, angle, next(others)))
    return _traces(f"Joint {channel.joint} in {channel.log}", channel, traces)


@styled
def validation(channel: Channel, simulated: Mapping[str, Array]) -> Figure:
    """Measured angle of a log and the responses [rad], shape (T,), of several fits by name."""
    colors = (REFINED, SEARCH, *OTHERS)
    traces = [
        _Trace(name, np.degrees(finite(angle)), colors[i % len(colors)])
        for i, (name, angle) in enumerate(simulated.items())
    ]
    return _traces(f"Joint {channel.joint} in {channel.log}", channel, traces)


def _traces(title: str, channel: Channel, traces: Sequence[_Trace]) -> Figure:
    drawing = figure(6.0)
    upper, middle, lower = drawing.subplots(3, 1, sharex=True, height_ratios=(3, 1.7, 1.2))
    measured = np.degrees(channel.measured)
    upper.plot(channel.time, measured, color=MEASURED, linewidth=4.0, alpha=0.35, label="measured")
    for order, trace in enumerate(traces):
        look = _look(order, len(traces))
        upper.plot(channel.time, trace.angle, color=trace.color, label=_with_rms(trace, measured), **look)
        middle.plot(channel.time, measured - trace.angle, color=trace.color, **look)
    reach = _RUNAWAY * max(float(np.ptp(measured)), _STILL)
    upper.set_ylim(_around([t.angle for t in traces], measured, reach, _LEAST_ANGLE))
    residuals = [measured - t.angle for t in traces]
    near = [r for r in residuals if np.nanmax(np.abs(r), initial=0.0) <= reach]
    middle.set_ylim(_around(near or residuals, np.zeros(1), reach, _LEAST_RESIDUAL))
    middle.axhline(0.0, color=MEASURED, linewidth=0.8)
    lower.step(channel.time, channel.command, where="post", color=GREY, linewidth=1.1)
    lower.set_ylim(-108, 108)
    lower.set_yticks((-100, 0, 100))
    lower.set_xlim(channel.time[0], channel.time[-1])
    lower.set_xlabel("time [s]")
    for axes, label in (
        (upper, "angle [deg]"),
        (middle, "residual [deg]"),
        (lower, "command [%]"),
    ):
        axes.set_ylabel(label)
    drawing.align_ylabels()
    _mark_segments((upper, middle, lower), channel)
    upper.set_title(title, pad=18 if len(channel.segments) > 1 else 8)
    legend_below(drawing, upper, columns=2)
    return drawing


def _look(order: int, count: int) -> dict[str, Any]:
    """Line of one of several responses: where they coincide, each still shows through those drawn after it.

    The first is wide and whole; later ones lie on it, narrower, each dashed in a place of its own.
    """
    width = max(0.8, 2.0 * 0.85**order)
    slots = min(count, 4)
    places = (1, slots - 1, slots - order % slots)
    dash, gap, offset = (3.5 * n / width for n in places)  # 3.5 pt each: matplotlib multiplies by the width
    style = (offset, (dash, gap)) if order else "-"
    return {"linewidth": width, "linestyle": style, "dash_capstyle": "butt", "zorder": 3 + order / 100}


def _around(curves: Sequence[Array], core: Array, reach: float, least: float) -> tuple[float, float]:
    """Limits [deg] around core and all curves, as far as `reach` beyond the core, and at least `least` apart.

    A response that runs away must not flatten those worth looking at.
    """
    low, high = float(core.min()), float(core.max())
    known = np.concatenate([core, *(curve[np.isfinite(curve)] for curve in curves)])
    low, high = max(float(known.min()), low - reach), min(float(known.max()), high + reach)
    margin = max(0.06 * (high - low), (least - (high - low)) / 2)
    return low - margin, high + margin


def _with_rms(trace: _Trace, measured: Array) -> str:
    if np.isnan(trace.angle).any():
        return f"{trace.label} (diverged)"
    return f"{trace.label} ({number(float(np.sqrt(np.mean((measured - trace.angle) ** 2))))} deg rms)"


def _mark_segments(panels: Sequence[Axes], channel: Channel) -> None:
    """Lines between segments through all panels, and their numbers above the first where there is room."""
    if len(channel.segments) < 2:
        return
    whole = channel.time[-1] - channel.time[0]
    written = -np.inf
    for ordinal, first, end in channel.segments:
        begins, ends = channel.time[first], channel.time[end - 1]
        if first:
            for axes in panels:
                axes.axvline(begins, color=PALE, linewidth=1.0, linestyle=(0, (4, 3)), zorder=0.5)
        middle = (begins + ends) / 2
        if middle - written < _NUMBER_ROOM * whole:
            continue
        written = middle
        panels[0].text(
            middle,
            1.02,
            str(ordinal),
            transform=panels[0].get_xaxis_transform(),
            ha="center",
            va="bottom",
            fontsize=8,
            color="#555555",
        )
