"""The analysis of an estimate on logs: what they determine, and what each parameter does to the outputs."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from hydroid.files import file_name
from hydroid.posterior.flags import WEAK_ABOVE
from hydroid.posterior.linear import Linear
from hydroid.problem.problem import Problem
from hydroid.reporting.chart import SERIES, Chart, Mark, Panel, finite
from hydroid.reporting.page import Page, Plot, Section, Tab, log_names
from hydroid.reporting.parameters_report import parameter_section
from hydroid.reporting.table import Cell, Table, numbers_csv
from hydroid.reporting.uncertainty_report import (
    UncertaintyStudy,
    direction_section,
    unknown_section,
    warnings,
)
from hydroid.words import number

_QUANTITIES = {
    "angle": ("q", "deg", 180 / np.pi),
    "pressure_a": ("pA", "bar", 1e-5),
    "pressure_b": ("pB", "bar", 1e-5),
}
_HELD = "All other parameters are held at the estimate."


def analysis_page(study: UncertaintyStudy, effects: Linear | None = None) -> Page:
    """Return the page of an analysis; its tables are `parameters`, `directions` and `sensitivity`.

    `effects` are those of all free parameters on the outputs; they add a CSV per channel.
    """
    problem, summary, data = study.problem, study.summary, dict[str, str]()
    rank, count = study.identifiability.rank, len(study.identifiability.names)
    lead = f"The logs determine {rank} combinations of {count} parameters to {100 * WEAK_ABOVE:.0f} %."
    sections = (
        parameter_section(problem.settings, summary, study.intervals),
        unknown_section(summary),
        *direction_section(summary),
        *(() if effects is None else [sensitivity_section(problem, effects, data)]),
    )
    title = f"What the logs determine at {study.source}"
    return Page("analysis", title, lead, sections, warnings(summary), data=data)


def sensitivity_section(problem: Problem, effects: Linear, data: dict[str, str]) -> Section:
    """Return the effect of each parameter on each channel; its numbers are added to `data` as CSV."""
    logs, taken, names = log_names(problem.logs), set[str](), problem.settings.arm.joint_names
    free, theta = np.array(problem.parameters.names)[effects.box.varied].tolist(), effects.box.at
    residual, percent = problem.residuals(theta[None])[0], -0.01 * effects.slopes
    percent[effects.diverging] = np.nan
    rows, tabs = list[tuple[Cell, ...]](), list[Tab]()
    for channel in problem.channels:
        symbol, unit, factor = _QUANTITIES[channel.quantity]
        log, short, time = logs[channel.log], f"{symbol}{channel.joint}", problem.logs[channel.log].time
        output, slopes = (
            factor * (channel.measured - residual[channel.rows] / channel.weight),
            factor / channel.weight * percent[:, channel.rows],
        )
        rms = np.sqrt(np.mean(slopes**2, axis=1))
        largest = np.argsort(-np.nan_to_num(rms), kind="stable")[: len(SERIES)]
        marks = [
            Mark(
                "line", time, finite(slopes[i]), color=color, label=f"{free[i]} ({number(rms[i])} {unit} rms)"
            )
            for color, i in zip(SERIES, largest, strict=False)
        ]
        name = file_name(f"sensitivity_{Path(log).stem}_{short}", taken)
        chart = Chart((Panel("time [s]", f"change of {short} [{unit}]", tuple(marks), height=300),))
        caption = f"Change per 1 % of each parameter, the largest {len(SERIES)}. {_HELD}"
        row = f"{channel.quantity.replace('_', ' ')} in {log}"
        plots = (Plot(name, caption, partial(replace, chart), zoom=True),)
        tabs.append(Tab(f"{number(np.nanmax(rms))} {unit}", plots, row, names[channel.joint - 1]))
        header = ("time_s", f"{short}_{unit}", *(f"{p}_{unit}_per_pct" for p in free))
        data[f"{name}.csv"] = numbers_csv(header, np.column_stack([time, output, slopes.T]))
        rows += [(log, f"{short} [{unit}]", p, float(r)) for p, r in zip(free, rms, strict=True)]
    note = "rms change of the output for 1 % of the parameter, all others held; –: the simulation diverges."
    table = Table("Sensitivity", ("log", "output", "parameter", "rms per 1 %"), tuple(rows), note)
    return Section("Effect of each parameter", tabs=tuple(tabs), more={"sensitivity": table})
