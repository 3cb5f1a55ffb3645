"""The analysis of an estimate on logs: what they determine, and what each parameter does to the outputs."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from contourpy import contour_generator

from hydroid.files import file_name
from hydroid.parameters import Array
from hydroid.posterior.jacobian import NO_EFFECT_BELOW
from hydroid.posterior.sweep import WIDE, Surface, Sweep
from hydroid.problem.problem import Problem
from hydroid.reporting.chart import ZERO, Chart, Mark, Panel, finite, joined
from hydroid.reporting.objectives import in_reader_units, norm_label
from hydroid.reporting.page import Page, Plot, Section, Tab, log_names
from hydroid.reporting.table import Cell, Table, numbers_csv
from hydroid.settings.problem import ObjectiveSettings
from hydroid.words import number

_QUANTITIES = {
    "angle": ("Angle", "q", "deg", 180 / np.pi),
    "pressure_a": ("Pressure A", "pA", "bar", 1e-5),
    "pressure_b": ("Pressure B", "pB", "bar", 1e-5),
}
_MOST = 12
"""parameters that are drawn of a channel, those with the largest effect"""
_BINS = 150
_FAMILY = 7
"""values of a parameter within its bounds that are drawn"""
_LEVELS = 12
_HELD = "All other parameters are held at the estimate."
_CAPTION = (
    "Left: change per 1 % of the parameter. Right: the output for values of it over its bounds, the others "
    "held. Parameters without effect on the output are not drawn, of many those with the largest effect are."
)


def analysis_page(
    problem: Problem,
    theta: Array,
    determined: Page | None = None,
    sweep: Sweep | None = None,
    surfaces: Sequence[Surface] = (),
) -> Page:
    """Return the page of an analysis: of what was asked for.

    Args:
        problem: the logs and the model.
        theta: the estimate, shape (P,).
        determined: the page of what the logs determine.
        sweep: effects of the parameters on the outputs; adds the table `sensitivity`, and a CSV per channel.
        surfaces: errors over two parameters; add the table `surface`, and a CSV each.
    """
    lead = "What each parameter does to the outputs and to the error, the others held at the estimate."
    page = determined or Page("analysis", "Analysis of the estimate", lead, ())
    sections, data = page.sections, {**page.data}
    if sweep is not None:
        sections += (_sensitivity_section(problem, theta, sweep, data),)
    if surfaces:
        sections += (_surface_section(surfaces, problem.settings.objective, data),)
    return replace(page, name="analysis", sections=sections, data=data)


def _sensitivity_section(problem: Problem, theta: Array, sweep: Sweep, data: dict[str, str]) -> Section:
    """Return the effect of each parameter on each channel; its numbers are added to `data` as CSV."""
    logs, taken = log_names(problem.logs), set[str]()
    free = [problem.parameters.parameters[i] for i in sweep.free]
    residual = problem.residuals(theta[None])[0]
    rows, tabs = list[tuple[Cell, ...]](), list[Tab]()
    for channel, change, sweeps in zip(problem.channels, sweep.slopes, sweep.responses, strict=True):
        what, symbol, unit, factor = _QUANTITIES[channel.quantity]
        log, short, time = logs[channel.log], f"{symbol}{channel.joint}", problem.logs[channel.log].time
        output = factor * (channel.measured - residual[channel.rows] / channel.weight)
        slopes, responses = factor * change, factor * sweeps
        rms = np.sqrt(np.mean(slopes**2, axis=1))
        shown = np.argsort(-np.nan_to_num(rms), kind="stable")[:_MOST]
        panels: list[Panel] = []
        for i in shown[~(rms[shown] <= NO_EFFECT_BELOW * np.nanmax(rms, initial=0.0))]:
            line = Mark("line", time, finite(slopes[i]), color="orange")
            title = f"{free[i].name}: {number(rms[i])} {unit} rms per 1 %"
            family = _family(time, output, responses[i])
            between = " to ".join(number(v) for v in sweep.values[i][[0, -1]])
            lost = int(np.sum(~np.isfinite(responses[i]).all(axis=1)))
            values = f"{between} {free[i].unit}".strip() + (f", {lost} infeasible" if lost else "")
            panels.append(Panel("time [s]", "change", (ZERO, line), title, 150))
            panels.append(Panel("time [s]", f"[{unit}]", family, values, 150))
        name = file_name(f"sensitivity_{Path(log).stem}_{short}", taken)
        title, chart = f"{what} of joint {channel.joint}", partial(Chart, tuple(panels), 2, bins=_BINS)
        if panels:
            tabs.append(Tab(f"{title}, {log}", (Plot(name, f"{title} in {log}. {_CAPTION}", chart),)))
        header = ("time_s", f"{short}_{unit}", *(f"{p.name}_{unit}_per_pct" for p in free))
        data[f"{name}.csv"] = numbers_csv(header, np.column_stack([time, output, slopes.T]))
        rows += [(log, f"{short} [{unit}]", p.name, float(r)) for p, r in zip(free, rms, strict=True)]
    note = "rms change of the output for 1 % of the parameter, all others held; –: the simulation diverges."
    table = Table("Sensitivity", ("log", "output", "parameter", "rms per 1 %"), tuple(rows), note)
    return Section("Effect of each parameter", tabs=tuple(tabs), more={"sensitivity": table})


def _family(time: Array, output: Array, responses: Array) -> tuple[Mark, ...]:
    """Draw an output, shape (T,), and its responses to some of the values of a parameter, shape (N, T)."""
    reach = max(float(np.ptp(output)), 1e-3)  # a response farther off has run away
    near = np.where(np.abs(responses - output.mean()) < 2 * reach, finite(responses), np.nan)
    *between, last = np.linspace(0, len(near) - 1, _FAMILY).round().astype(int).tolist()
    looks = [(i, "grey", "between") for i in between[1:]]
    looks += [(0, "blue", "lower bound"), (last, "pink", "upper bound")]
    marks = [Mark("line", time, near[i], color=color, label=label, width=1) for i, color, label in looks]
    return (*marks, Mark("line", time, output, color="ink", label="at the estimate", look="dashed"))


def _surface_section(
    surfaces: Sequence[Surface], objective: ObjectiveSettings, data: dict[str, str]
) -> Section:
    """Return the error over pairs of parameters; its numbers are added to `data` as CSV."""
    rows, plots = list[tuple[Cell, ...]](), list[Plot]()
    for surface in surfaces:
        names = [parameter.name for parameter in surface.parameters]
        name, caption = f"surface_{'_'.join(names)}", f"Error over {' and '.join(names)}. {_HELD}"
        plots.append(Plot(name, caption, partial(landscape, surface, objective)))
        columns = *np.meshgrid(*surface.values, indexing="ij"), in_reader_units(objective, surface.error)
        header = (*names, "error" if objective.relative else "error_deg")
        data[f"{name}.csv"] = numbers_csv(header, np.column_stack([*map(np.ravel, columns)]))
        *lowest, least = surface.lowest
        least, at = in_reader_units(objective, np.array([least, surface.estimate_error])).tolist()
        rows.append((", ".join(names), *lowest, least, *surface.estimate, at))
    values = ("first", "second", norm_label(objective))
    header = (f"{value}, {which}" for which in ("lowest", "estimate") for value in values)
    note = f"{_HELD[:-1]}, which is a grid point where the grid reaches it."
    table = Table("Error over two parameters", ("parameters", *header), tuple(rows), note)
    return Section("Error over two parameters", tables={"surface": table}, plots=tuple(plots))


def landscape(surface: Surface, objective: ObjectiveSettings) -> Chart:
    """Draw lines of equal error, the estimate, the lowest point and where simulations diverge.

    As in the article's figure 11.
    """
    error, unit = in_reader_units(objective, finite(surface.error)), "" if objective.relative else " deg"
    known, marks = error[np.isfinite(error)], list[Mark]()
    if known.size and known.max() > known.min():
        # a point that reproduces its data exactly would stretch equal ratios to nothing
        low, high = max(known.min(), 1e-3 * known.max()), known.max()
        levels = (np.geomspace if high > 5 * low else np.linspace)(low, high, _LEVELS + 2)[1:-1]
        lines: Any = contour_generator(*surface.values, np.ma.masked_invalid(error.T))
        for level, alpha in zip(levels, np.linspace(1, 0.3, _LEVELS), strict=True):
            label = f"{number(level)}{unit}"
            marks.append(Mark("line", *joined(lines.lines(level)), label=label, alpha=float(alpha)))
    (a, b), (i, j) = surface.values, np.nonzero(~np.isfinite(error))
    if len(i):
        label = f"infeasible ({len(i)} points)"
        marks.append(Mark("points", a[i], b[j], color="pale", label=label, look="square", width=7))
    # where both are one point, the estimate lies on the other
    for *at, value, label, look in (
        (*surface.lowest, "lowest point drawn", {"color": "ink", "width": 11}),
        (*surface.estimate, surface.estimate_error, "estimate", {"look": "diamond", "width": 8}),
    ):
        text = f"{label} ({number(float(in_reader_units(objective, np.array(value))))}{unit})"
        marks.append(Mark("points", *np.array(at)[:, None], label=text, **{"color": "orange"} | look))
    x, y = (f"{p.name} [{p.unit}]" if p.unit else p.name for p in surface.parameters)
    ends = [(float(values[0]), float(values[-1])) for values in surface.values]
    log_x, log_y = (low > 0 and high > WIDE * low for low, high in ends)
    title = f"Lines of equal {norm_label(objective)}"
    return Chart((Panel(x, y, tuple(marks), title, 420, ends[0], ends[1], log_x, log_y),))
