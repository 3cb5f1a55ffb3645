"""Several runs with different seeds: the spread of their estimates as a page."""

from collections.abc import Collection

import numpy as np

from hydroid.parameters import Array, Parameter, ParameterSet
from hydroid.posterior.covariance import at_bounds
from hydroid.posterior.flags import Flag
from hydroid.reporting.page import Page, Section, Verdict
from hydroid.reporting.parameters_report import parameter_bar
from hydroid.reporting.table import Table
from hydroid.run.collection import Runs


def spread_page(runs: Runs) -> Page:
    """Return the page of several runs that differ in their seeds only; its tables are `spread` and `runs`."""
    settings, parameters, best, theta = runs.settings, runs.parameters, runs.best, runs.theta
    idle = [
        name
        for name in parameters.names
        if all(run.summary.estimate[name].flag == Flag.NO_EFFECT for run in runs.runs)
    ]
    errors = np.array([run.rms_deg for run in runs.runs])
    near, count = int(np.sum(errors <= 1.05 * best.rms_deg)), len(errors)
    bars = tuple(
        parameter_bar(settings, parameter, best.summary.estimate[parameter.name], values.tolist())
        for parameter, values in zip(parameters.parameters, theta.T, strict=True)
    )
    lead = f"The smallest error is {best.rms_deg:.4g}° rms, of seed {best.seed}."
    agree = f"{near} of {count} runs end within 5 % of it."
    text = "Bar: from the lower to the upper bound. Orange line: the best run. Blue dots: all runs."
    spread = {"spread": spread_table(parameters, theta, errors, idle)}
    sections = (
        Section("Where the estimates lie", text, bars=bars, more=spread),
        Section("Run by run", tables={"runs": runs_table(runs)}),
    )
    return Page("runs", f"{count} runs with different seeds", lead, sections, verdict=Verdict(lead, agree))


def spread_table(parameters: ParameterSet, theta: Array, rms_deg: Array, idle: Collection[str]) -> Table:
    """Return median and spread over N runs of each parameter and of the output error.

    Args:
        parameters: P of them.
        theta: final estimates, shape (N, P).
        rms_deg: their rms errors [deg], shape (N,).
        idle: names of parameters without effect in any run.
    """

    def quartiles(values: Array) -> tuple[float, ...]:
        low, q1, median, q3, high = np.quantile(values, [0, 0.25, 0.5, 0.75, 1]).tolist()
        return median, low, q1, q3, high

    rows = [
        (p.name, p.unit, *quartiles(values), _flag(p, values, p.name in idle))
        for p, values in zip(parameters.parameters, theta.T, strict=True)
    ]
    rows.append(("rms output error", "deg", *quartiles(rms_deg), ""))
    header = ("name", "unit", "median", "lowest", "lower quartile", "upper quartile", "highest", "flag")
    return Table(f"{len(theta)} runs", header, tuple(rows), optional=("lower quartile", "upper quartile"))


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


def _flag(parameter: Parameter, values: Array, idle: bool) -> str:
    """Say what is to be known about a parameter over several runs, values of shape (N,); may be empty."""
    if not parameter.lower < parameter.upper or (parameter.fixed is not None and not np.ptp(values)):
        return Flag.FIXED.value
    if idle:
        return Flag.NO_EFFECT.value
    counts = ((side, int(np.sum(at))) for side, at in at_bounds(parameter, values))
    return ", ".join(f"at {side} bound in {n} of {len(values)} runs" for side, n in counts if n)
