"""Responses against time: what one log commanded and measured at one joint, and what models simulate."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hydroid.fitting.fit import Fit
from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.report import style
from hydroid.report.page import Plot, log_names
from hydroid.report.phrases import estimate_label
from hydroid.report.table import number

MOST_RESPONSES = 12
"""responses drawn at most on a page, those with the largest errors"""
_COLORS = (style.REFINED, style.SEARCH, *style.OTHERS)
_CAPTION = (
    "Top: measured and simulated angle. Middle: measured minus simulated angle; shaded: 95 % "
    "prediction band, where it is known. Bottom: command."
)
_NUMBER_ROOM = 0.035  # of the width, for a segment's number
_WIDEST_BAND = np.pi  # [rad]: infinite where the parameters leave the angle open
_RUNAWAY = 3.0  # ranges of the measured angle: a response farther off has run away
_LEAST_RANGE = 1.0  # [deg] of the measured angle for _RUNAWAY: a joint may be at rest
_LEAST_ANGLE, _LEAST_RESIDUAL = 0.1, 1e-6  # [deg] height of a panel at least: rounding is not drawn


@dataclass(frozen=True, eq=False)
class JointResponse:
    """The record of one joint, and what models simulate.

    Attributes:
        log: name of the log.
        joint: number of the joint, from 1.
        time: [s], shape (T,).
        command: of this joint [%], shape (T,).
        measured: angle [rad], shape (T,).
        simulated: angle [rad] by the model's name, shape (T,).
        segments: number of each segment, from 1, and its samples [first, end).
        bands: half the prediction band [rad] by the model's name, shape (T,).
    """

    log: str
    joint: int
    time: Array
    command: Array
    measured: Array
    simulated: Mapping[str, Array] = field(default_factory=dict[str, Array])
    segments: tuple[tuple[int, int, int], ...] = ()
    bands: Mapping[str, Array] = field(default_factory=dict[str, Array])

    def mean_squares(self) -> list[float]:
        """Return each model's mean squared error [rad²], infinite where it diverged."""
        errors = (np.mean((self.measured - angle) ** 2) for angle in self.simulated.values())
        return [float(np.nan_to_num(error, nan=np.inf)) for error in errors]


def joint_responses(problem: Problem, fit: Fit) -> list[JointResponse]:
    """Return the records and all estimates' responses of a fit, in the order of `problem.measured`."""
    responses: list[JointResponse] = []
    start = 0
    for i, (log, name) in enumerate(zip(problem.logs, log_names(problem.logs), strict=True)):
        for k, joint in enumerate(problem.outputs):
            end = start + len(log.time)
            segments = tuple(
                (number, int(a) - start, int(b) - start)
                for number, (a, b) in enumerate(problem.bounds, start=1)
                if start <= a < end
            )
            simulated = {
                estimate_label(fit, n): fit.estimates[n].responses[i][:, k] for n in style.estimate_looks(fit)
            }
            record = log.time, log.command[:, joint], log.angle[:, joint]
            responses.append(JointResponse(name, joint + 1, *record, simulated, segments))
            start = end
    return responses


def response_plots(
    responses: Mapping[str, JointResponse], errors: Sequence[float], colors: Sequence[str] = _COLORS
) -> tuple[tuple[Plot, ...], str]:
    """Return plots of the responses, by file name, with the largest errors, and a note on those left out."""
    worst = sorted(np.argsort(errors, kind="stable")[::-1][:MOST_RESPONSES])
    items = list(responses.items())
    plots = tuple(Plot(name, _CAPTION, partial(draw, one, colors)) for name, one in (items[i] for i in worst))
    left_out = len(items) - len(plots)
    noun = "response is" if left_out == 1 else "responses are"
    return plots, f" {left_out} further {noun} not drawn; the table has all errors." if left_out else ""


def draw(response: JointResponse, colors: Sequence[str] = _COLORS) -> Figure:
    """Draw the measured angle of one joint, every model's response, residual and command."""
    several = len(response.segments) > 1
    drawing = style.figure(6.0, top=0.5 if several else 0.35)
    upper, middle, lower = panels = drawing.subplots(
        3, 1, sharex=True, gridspec_kw={"height_ratios": (3, 1.7, 1.2), "hspace": 0.12}
    )
    time, measured = response.time, np.degrees(response.measured)
    upper.plot(*style.decimated(time, measured), color=style.MEASURED, lw=4.0, alpha=0.35, label="measured")
    angles = {name: np.degrees(style.finite(angle)) for name, angle in response.simulated.items()}
    residuals = [measured - angle for angle in angles.values()]
    for order, ((name, angle), residual) in enumerate(zip(angles.items(), residuals, strict=True)):
        look = _look(order, len(angles)) | {"color": colors[order % len(colors)]}
        rms = float(np.sqrt(np.mean(residual**2)))
        remark = f"{number(rms)} deg rms" if np.isfinite(rms) else "diverged"
        upper.plot(*style.decimated(time, angle), label=f"{name} ({remark})", **look)
        middle.plot(*style.decimated(time, residual), **look)
        if name in response.bands:
            half = np.degrees(np.minimum(response.bands[name], _WIDEST_BAND))
            label = f"95 % band of {name}"
            middle.fill_between(
                time, -half, half, color=look["color"], alpha=0.15, lw=0, zorder=1, label=label
            )
    reach = _RUNAWAY * max(float(np.ptp(measured)), _LEAST_RANGE)
    upper.set_ylim(_limits(list(angles.values()), measured, reach, _LEAST_ANGLE))
    near = [r for r in residuals if np.nanmax(np.abs(r), initial=0.0) <= reach]
    middle.set_ylim(_limits(near or residuals, np.zeros(1), reach, _LEAST_RESIDUAL))
    middle.axhline(0.0, color=style.MEASURED, linewidth=0.8)
    lower.step(*style.decimated(time, response.command), where="post", color=style.GREY, linewidth=1.1)
    lower.set_ylim(-108, 108)
    lower.set_yticks((-100, 0, 100))
    lower.set_xlim(time[0], time[-1])
    lower.set_xlabel("time [s]")
    for axes, label in zip(panels, ("angle [deg]", "residual [deg]", "command [%]"), strict=True):
        axes.set_ylabel(label)
        axes.yaxis.set_label_coords(-0.085, 0.5)
        axes.tick_params(axis="x", length=3.5 if axes is lower else 0)
    if several:
        _mark_segments(panels, response)
    upper.set_title(f"Joint {response.joint} in {response.log}", pad=18 if several else 8)
    style.legend_below(drawing, upper, columns=2)
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


def _mark_segments(panels: Sequence[Axes], response: JointResponse) -> None:
    """Draw lines between segments, and their numbers above the first panel where there is room."""
    time = response.time
    written = -np.inf
    for ordinal, first, end in response.segments:
        if first:
            for axes in panels:
                axes.axvline(time[first], color=style.PALE, lw=1.0, linestyle=(0, (4, 3)), zorder=0.5)
        middle = (time[first] + time[end - 1]) / 2
        if middle - written >= _NUMBER_ROOM * (time[-1] - time[0]):
            written = middle
            where: dict[str, Any] = {
                "transform": panels[0].get_xaxis_transform(),
                "ha": "center",
                "va": "bottom",
            }
            panels[0].text(middle, 1.02, str(ordinal), fontsize=8, color="#555555", **where)
