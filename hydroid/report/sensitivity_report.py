"""What each parameter does to each output against time (article, figure 10)."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hydroid.files import file_name
from hydroid.parameters import Array, Parameter
from hydroid.posterior.jacobian import NO_EFFECT_BELOW
from hydroid.posterior.sweep import Sweep
from hydroid.problem.problem import Problem
from hydroid.report import style
from hydroid.report.page import Page, Plot, Section, log_names
from hydroid.report.table import Cell, Table, numbers_csv
from hydroid.words import number, plain

_QUANTITIES = {
    "angle": ("Angle", "q", "deg", 180 / np.pi),
    "pressure_a": ("Pressure A", "pA", "bar", 1e-5),
    "pressure_b": ("Pressure B", "pB", "bar", 1e-5),
}
_ROW, _MOST = 0.95, 12
"""height of a panel [in]; more parameters than this stand in two columns"""
_SMALL: dict[str, Any] = {"fontsize": 9, "fontweight": "normal"}
_DASHED = (0, (4, 2))


@dataclass(frozen=True, eq=False)
class ChannelCurves:
    """One output at the estimate and around it, in a reader's `unit`.

    time: [s], shape (T,). output: at the estimate, shape (T,). parameters: the F free ones. slopes: change of
    the output per 1 % of each, shape (F, T). values: of each parameter over its bounds, shape (F, N).
    responses: the output at them, shape (F, N, T); NaN where the simulation diverges.
    """

    name: str
    unit: str
    time: Array
    output: Array
    parameters: Sequence[Parameter]
    slopes: Array
    values: Array
    responses: Array


def sensitivity_page(problem: Problem, theta: Array, sweep: Sweep) -> Page:
    """Return the page of a sensitivity study: the table `sensitivity` and one CSV per channel."""
    logs = log_names(problem.logs)
    free = [problem.parameters.parameters[i] for i in sweep.free]
    residual = problem.residuals(theta[None])[0]
    rows: list[tuple[Cell, ...]] = []
    plots: list[Plot] = []
    data: dict[str, str] = {}
    taken: set[str] = set()
    for channel, slope, response in zip(problem.channels, sweep.slopes, sweep.responses, strict=True):
        what, symbol, unit, factor = _QUANTITIES[channel.quantity]
        log, short, time = logs[channel.log], f"{symbol}{channel.joint}", problem.logs[channel.log].time
        output = factor * (channel.measured - residual[channel.rows] / channel.weight)
        title = f"{what} of joint {channel.joint} in {log}"
        curves = factor * slope, sweep.values, factor * response
        one = ChannelCurves(title, unit, time, output, free, *curves)
        name = file_name(f"sensitivity_{Path(log).stem}_{short}", taken)
        about = f"{title}: response for values of each parameter over its bounds, the others held."
        plots += [
            Plot(name, f"{title}: change per 1 % of each parameter.", partial(slopes, one)),
            Plot(name.replace("sensitivity", "bounds", 1), about, partial(response_families, one)),
        ]
        header = ("time_s", f"{short}_{unit}", *(f"{p.name}_{unit}_per_pct" for p in free))
        data[f"{name}.csv"] = numbers_csv(header, np.column_stack([time, output, one.slopes.T]))
        rms = np.sqrt(np.mean(one.slopes**2, axis=1))
        rows += [(log, f"{short} [{unit}]", p.name, float(r)) for p, r in zip(free, rms, strict=True)]
    note = "rms change of the output for 1 % of the parameter, all others held; –: the simulation diverges."
    table = Table("Sensitivity", ("log", "output", "parameter", "rms per 1 %"), tuple(rows), note)
    section = Section("Effect of each parameter", tables={"sensitivity": table}, plots=tuple(plots))
    lead = "How much each output changes with each parameter, against time."
    return Page("sensitivity", "Sensitivity of the outputs to each parameter", lead, (section,), data=data)


def slopes(channel: ChannelCurves) -> Figure:
    """Draw the change of a channel per 1 % of each parameter against time."""
    drawing, panels, top = _panels(channel, "change per 1 % of each parameter")
    unit, time = channel.unit, channel.time
    top.plot(*style.decimated(time, channel.output), color=style.MEASURED)
    top.set_ylabel(f"[{unit}]")
    top.set_title("the output at the estimate", **_SMALL)
    strength = np.sqrt(np.mean(channel.slopes**2, axis=1))
    none = strength <= NO_EFFECT_BELOW * np.nanmax(strength, initial=0.0)
    each = zip(panels, channel.parameters, channel.slopes, strength, none, strict=True)
    for axes, parameter, curve, rms, idle in each:
        most = 0.0 if idle else float(np.max(np.abs(curve)))
        axes.plot(*style.decimated(time, style.finite(curve)), color=style.REFINED)
        axes.axhline(0.0, color=style.GREY, linewidth=0.8)
        # what is no more than rounding is drawn flat
        reach = 1.15 * most if np.isfinite(most) and most > 0 else 1.0
        axes.set_ylim(-reach, reach)
        axes.set_ylabel(f"[{unit}/%]")
        size = f"rms {number(float(rms))} {unit} per 1 %" if np.isfinite(rms) else "the changed arm diverges"
        axes.set_title(f"{parameter.name}: {'no effect on this output' if idle else size}", **_SMALL)
    return drawing


def response_families(channel: ChannelCurves) -> Figure:
    """Draw a channel for several values of each parameter within its bounds."""
    drawing, panels, top = _panels(channel, "each parameter over its bounds")
    time, output = channel.time, channel.output
    top.set_axis_off()
    colors = colormaps["viridis"](np.linspace(0.0, 0.95, channel.values.shape[1]))
    reach = max(float(np.ptp(output)), 1e-3)  # a response farther off has run away
    each = zip(panels, channel.parameters, channel.values, channel.responses, strict=True)
    for axes, parameter, values, curves in each:
        for color, curve in zip(colors, curves, strict=True):
            axes.plot(*style.decimated(time, style.finite(curve)), color=color, linewidth=0.8)
        axes.plot(*style.decimated(time, output), color=style.MEASURED, linewidth=1.2, linestyle=_DASHED)
        known = curves[np.isfinite(curves)]
        low, high = (float(f(known, initial=f(output))) for f in (np.min, np.max))
        low, high = max(low, output.min() - reach), min(high, output.max() + reach)
        margin = 0.06 * (high - low) + 1e-9
        axes.set_ylim(low - margin, high + margin)
        axes.set_ylabel(f"[{channel.unit}]")
        lost = int(np.sum(~np.isfinite(curves).all(axis=1)))
        note = f", {lost} of {len(values)} infeasible" if lost else ""
        named = f"{parameter.name} [{parameter.unit}]" if parameter.unit else parameter.name
        axes.set_title(f"{named}: {plain(values[0])} to {plain(values[-1])}{note}", **_SMALL)
    key = top.inset_axes((0.08, 0.35, 0.3, 0.18))
    key.imshow(np.linspace(0, 1, 256)[None], aspect="auto", cmap="viridis", extent=(0, 1, 0, 1))
    key.set_yticks(())
    key.set_xticks((0, 1), ("lower bound", "upper bound"), fontsize=8)
    key.grid(False)
    top.plot((), (), color=style.MEASURED, linestyle=_DASHED, label="at the estimate")
    top.legend(loc="center right")
    return drawing


def _panels(channel: ChannelCurves, title: str) -> tuple[Figure, list[Axes], Axes]:
    """Return a figure with a wide panel above one panel per parameter."""
    count = len(channel.parameters)
    columns = 1 if count <= _MOST else 2
    rows = -(-count // columns)
    width = 6.4 if columns == 1 else 10.0
    drawing = style.figure(1.15 + _ROW * (rows + 1), width, left=0.95, top=0.75, bottom=0.5)
    style.headline(drawing, f"{channel.name}:\n{title}")
    grid = drawing.add_gridspec(rows + 1, columns, hspace=0.62, wspace=0.25)
    top = drawing.add_subplot(grid[0, :])
    panels = [drawing.add_subplot(grid[1 + i % rows, i // rows]) for i in range(count)]
    for i, axes in enumerate(panels):
        last = i % rows == rows - 1 or i == count - 1
        axes.tick_params(labelsize=8, labelbottom=last)
        if last:
            axes.set_xlabel("time [s]")
    for axes in (top, *panels):
        axes.margins(x=0)
        axes.yaxis.set_label_coords(-0.7 / (width / columns), 0.5)
    top.tick_params(labelsize=8, labelbottom=False)
    return drawing, panels, top
