"""Several runs with different seeds: the spread of their estimates as a page."""

import numpy as np

from hydroid.parameters import Array
from hydroid.reporting.page import Page, Section, Verdict
from hydroid.reporting.parameters_report import parameter_bar, status
from hydroid.reporting.table import Table
from hydroid.run.collection import Runs


def spread_page(runs: Runs) -> Page:
    """Return the page of several runs that differ in their seeds only; its tables are `spread` and `runs`."""
    best = runs.best
    near, count = sum(run.rms_deg <= 1.05 * best.rms_deg for run in runs.runs), len(runs.runs)
    bars = tuple(
        parameter_bar(runs.settings, p, best.summary.estimate[p.name], values.tolist())
        for p, values in zip(runs.parameters.parameters, runs.theta.T, strict=True)
    )
    lead = f"The smallest error is {best.rms_deg:.4g}° rms, of seed {best.seed}."
    agree = f"{near} of {count} runs end within 5 % of it."
    text = "Bar: from the lower to the upper bound. Orange line: the best run. Blue dots: all runs."
    sections = (
        Section("Where the estimates lie", text, bars=bars, more={"spread": spread_table(runs)}),
        Section("Run by run", tables={"runs": runs_table(runs)}),
    )
    return Page("runs", f"{count} runs with different seeds", lead, sections, verdict=Verdict(lead, agree))


def spread_table(runs: Runs) -> Table:
    """Return median and spread over runs of each parameter and of the output error; flags of the best run."""

    def quartiles(values: Array) -> tuple[float, ...]:
        low, q1, median, q3, high = np.quantile(values, [0, 0.25, 0.5, 0.75, 1]).tolist()
        return median, low, q1, q3, high

    rows = [
        (p.name, p.unit, *quartiles(values), status(runs.best.summary.estimate[p.name]))
        for p, values in zip(runs.parameters.parameters, runs.theta.T, strict=True)
    ]
    rows.append(("rms output error", "deg", *quartiles(np.array([run.rms_deg for run in runs.runs])), ""))
    header = ("name", "unit", "median", "lowest", "lower quartile", "upper quartile", "highest", "flag")
    return Table(f"{len(runs.runs)} runs", header, tuple(rows), optional=("lower quartile", "upper quartile"))


def runs_table(runs: Runs) -> Table:
    """Return one row per run, the smallest output error first."""
    values = tuple(f"{p.name} [{p.unit}]" for p in runs.parameters.parameters)
    rows = [
        (str(run.path), run.seed, run.rms_deg, *theta.tolist())
        for run, theta in zip(runs.runs, runs.theta, strict=True)
    ]
    header = ("run", "seed", "rms output error [deg]", *values)
    ordered = tuple(sorted(rows, key=lambda row: (row[2], row[1])))
    return Table("Runs, smallest error first", header, ordered, optional=values[::-1])
