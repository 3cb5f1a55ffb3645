"""Responses against time: measured and simulated angle, their difference, the command."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hydroid.fitting.fit import Fit
from hydroid.parameters import Array
from hydroid.report.joint_record import JointRecord
from hydroid.report.phrases import estimate_label
from hydroid.report.plots import style
from hydroid.report.table import number

_NUMBER_ROOM = 0.035  # of the width, for a segment's number
_RUNAWAY = 3.0  # ranges of the measured angle: a response farther off has run away
_LEAST_RANGE = 1.0  # [deg] of the measured angle for _RUNAWAY: a joint may be at rest
_LEAST_ANGLE, _LEAST_RESIDUAL = 0.1, 1e-6  # [deg] height of a panel at least: rounding is not drawn


@dataclass(frozen=True, eq=False)
class _Trace:
    """A simulated angle [deg] and its colour."""

    label: str
    angle: Array
    color: str


def fit_response(fit: Fit, record: JointRecord) -> Figure:
    """Draw the measured angle of one joint, every estimate's response, residual and command."""
    traces: list[_Trace] = []
    others = iter(style.OTHERS)
    for name in dict.fromkeys([fit.final, fit.searched.name, *fit.estimates]):
        angle = np.degrees(style.finite(record.simulated(fit.estimates[name].responses)))
        main = {fit.final: style.REFINED} | {fit.searched.name: style.SEARCH}
        traces.append(_Trace(estimate_label(fit, name), angle, main.get(name) or next(others)))
    return _panels(record, traces)


def overlay(record: JointRecord, simulated: Mapping[str, Array]) -> Figure:
    """Draw the measured angle of a log and the responses [rad], shape (T,), of several fits by name."""
    colors = (style.REFINED, style.SEARCH, *style.OTHERS)
    traces = [
        _Trace(name, np.degrees(style.finite(angle)), colors[i % len(colors)])
        for i, (name, angle) in enumerate(simulated.items())
    ]
    return _panels(record, traces)


def _panels(record: JointRecord, traces: Sequence[_Trace]) -> Figure:
    drawing = style.figure(6.0, top=0.5 if len(record.segments) > 1 else 0.35)
    upper, middle, lower = panels = drawing.subplots(
        3, 1, sharex=True, gridspec_kw={"height_ratios": (3, 1.7, 1.2), "hspace": 0.12}
    )
    time, measured = record.time, np.degrees(record.measured)
    upper.plot(
        *style.decimated(time, measured), color=style.MEASURED, linewidth=4.0, alpha=0.35, label="measured"
    )
    residuals = [measured - trace.angle for trace in traces]
    for order, (trace, residual) in enumerate(zip(traces, residuals, strict=True)):
        look = _look(order, len(traces))
        upper.plot(
            *style.decimated(time, trace.angle), color=trace.color, label=_with_rms(trace, residual), **look
        )
        middle.plot(*style.decimated(time, residual), color=trace.color, **look)
    reach = _RUNAWAY * max(float(np.ptp(measured)), _LEAST_RANGE)
    upper.set_ylim(_limits([t.angle for t in traces], measured, reach, _LEAST_ANGLE))
    near = [r for r in residuals if np.nanmax(np.abs(r), initial=0.0) <= reach]
    middle.set_ylim(_limits(near or residuals, np.zeros(1), reach, _LEAST_RESIDUAL))
    middle.axhline(0.0, color=style.MEASURED, linewidth=0.8)
    lower.step(*style.decimated(time, record.command), where="post", color=style.GREY, linewidth=1.1)
    lower.set_ylim(-108, 108)
    lower.set_yticks((-100, 0, 100))
    lower.set_xlim(time[0], time[-1])
    lower.set_xlabel("time [s]")
    for axes, label in zip(panels, ("angle [deg]", "residual [deg]", "command [%]"), strict=True):
        axes.set_ylabel(label)
        axes.yaxis.set_label_coords(-0.085, 0.5)
        axes.tick_params(axis="x", length=3.5 if axes is lower else 0)
    _mark_segments(panels, record)
    upper.set_title(f"Joint {record.joint} in {record.log}", pad=18 if len(record.segments) > 1 else 8)
    style.legend_below(drawing, style.labelled(upper), columns=2)
    return drawing


def _look(order: int, count: int) -> dict[str, Any]:
    """Return the line of one of several responses, so that all show where they coincide.

    The first is wide and whole; later ones lie on it, narrower, each dashed in a place of its own.
    """
    width = max(0.8, 2.0 * 0.85**order)
    slots = min(count, 4)
    places = (1, slots - 1, slots - order % slots)
    dash, gap, offset = (3.5 * n / width for n in places)  # 3.5 pt each: matplotlib multiplies by the width
    line = (offset, (dash, gap)) if order else "-"
    return {"linewidth": width, "linestyle": line, "dash_capstyle": "butt", "zorder": 3 + order / 100}


def _limits(curves: Sequence[Array], core: Array, reach: float, least: float) -> tuple[float, float]:
    """Return limits [deg] around core and all curves, at most `reach` beyond core, at least `least` apart.

    A response that runs away must not flatten the others.
    """
    low, high = float(core.min()), float(core.max())
    known = np.concatenate([core, *(curve[np.isfinite(curve)] for curve in curves)])
    low, high = max(float(known.min()), low - reach), min(float(known.max()), high + reach)
    margin = max(0.06 * (high - low), (least - (high - low)) / 2)
    return low - margin, high + margin


def _with_rms(trace: _Trace, residual: Array) -> str:
    if np.isnan(residual).any():
        return f"{trace.label} (diverged)"
    return f"{trace.label} ({number(float(np.sqrt(np.mean(residual**2))))} deg rms)"


def _mark_segments(panels: Sequence[Axes], record: JointRecord) -> None:
    """Draw lines between segments, and their numbers above the first panel where there is room."""
    if len(record.segments) < 2:
        return
    whole = record.time[-1] - record.time[0]
    written = -np.inf
    for ordinal, first, end in record.segments:
        begins, ends = record.time[first], record.time[end - 1]
        if first:
            for axes in panels:
                axes.axvline(begins, color=style.PALE, linewidth=1.0, linestyle=(0, (4, 3)), zorder=0.5)
        middle = (begins + ends) / 2
        if middle - written < _NUMBER_ROOM * whole:
            continue
        written = middle
        where = {"transform": panels[0].get_xaxis_transform(), "ha": "center", "va": "bottom"}
        panels[0].text(middle, 1.02, str(ordinal), fontsize=8, color="#555555", **where)
