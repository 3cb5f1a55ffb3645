"""Responses against time: measured and simulated angle, what they differ by, what was commanded."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hydroid.identification.fit import Fit
from hydroid.identification.problem import Problem
from hydroid.parameters import Array
from hydroid.report.channels import Channel
from hydroid.report.plots.style import (
    GREY,
    MEASURED,
    OTHERS,
    PALE,
    POLISHED,
    SEARCH,
    figure,
    finite,
    legend_below,
    span,
    styled,
)
from hydroid.report.table import number
from hydroid.report.words import estimate_label

_NUMBER_ROOM = 0.035  # of the width, for a segment's number


@dataclass(frozen=True, eq=False)
class _Trace:
    """A simulated angle [deg] and how it is drawn."""

    label: str
    angle: Array
    color: str
    width: float
    dashes: tuple[float, ...] = ()


@styled
def response(problem: Problem, fit: Fit, channel: Channel) -> Figure:
    """Measured angle of one channel and every estimate's response, residual, command; segments numbered."""
    traces: list[_Trace] = []
    others = iter(OTHERS)
    for name in dict.fromkeys([fit.final, fit.searched.name, *fit.estimates]):
        angle = np.degrees(finite(channel.simulated(fit.estimates[name].responses)))
        label = estimate_label(fit, name)
        if name == fit.searched.name:
            traces.append(_Trace(label, angle, SEARCH, 1.5))
        elif name == fit.final:
            traces.append(_Trace(label, angle, POLISHED, 1.5))
        else:
            traces.append(_Trace(label, angle, next(others), 0.9, (3, 1.5)))
    return _traces(f"Joint {channel.joint} in {channel.log}", channel, traces)


@styled
def validation(channel: Channel, simulated: Mapping[str, Array]) -> Figure:
    """Measured angle of a log and the responses [rad], shape (T,), of several fits by name."""
    colors = (POLISHED, SEARCH, *OTHERS)
    traces = [
        _Trace(
            name,
            np.degrees(finite(angle)),
            colors[i % len(colors)],
            1.4,
            (4, 1.5) if i >= len(colors) else (),
        )
        for i, (name, angle) in enumerate(simulated.items())
    ]
    return _traces(f"Joint {channel.joint} in {channel.log}", channel, traces)


def _traces(title: str, channel: Channel, traces: Sequence[_Trace]) -> Figure:
    drawing = figure(6.0)
    upper, middle, lower = drawing.subplots(3, 1, sharex=True, height_ratios=(3, 1.7, 1.2))
    measured = np.degrees(channel.measured)
    upper.plot(channel.time, measured, color=MEASURED, linewidth=2.4, alpha=0.6, label="measured")
    for order, trace in enumerate(traces):
        depth = 3 - order / 100  # the first is the most important and lies on top
        _plot(upper, channel.time, trace.angle, trace, depth, _with_rms(trace, measured))
        _plot(middle, channel.time, measured - trace.angle, trace, depth)
    upper.set_ylim(span([t.angle for t in traces], measured))
    residuals = [measured - t.angle for t in traces]
    # the best response sets the scale: others may leave the frame
    closest = min(
        residuals, key=lambda r: np.inf if np.isnan(r).any() else float(np.ptp(r)), default=measured
    )
    middle.set_ylim(span(residuals, np.append(closest, 0.0), room=2.0))
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


def _plot(axes: Axes, time: Array, angle: Array, trace: _Trace, depth: float, label: str = "") -> None:
    style = (0, trace.dashes) if trace.dashes else "-"
    axes.plot(
        time,
        angle,
        color=trace.color,
        linewidth=trace.width,
        linestyle=style,
        label=label or None,
        zorder=depth,
    )


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
