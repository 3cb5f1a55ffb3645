"""Several runs with different seeds: the spread of their estimates as a page."""

from collections.abc import Collection, Sequence

import numpy as np

from hydroid.parameters import Array, Parameter, ParameterSet
from hydroid.posterior.covariance import at_bounds
from hydroid.posterior.flags import Flag
from hydroid.reporting.page import Light, Page, Section, Verdict
from hydroid.reporting.parameters_report import parameter_bar
from hydroid.reporting.table import Cell, Table
from hydroid.run.collection import Collection as Runs
from hydroid.run.collection import RunEstimate, RunResult
from hydroid.words import listed

_NEAR = 0.05
"""part of the smallest error by which runs that found the same optimum may differ"""


def spread_page(collected: Runs) -> Page:
    """Return the page of several runs that differ in their seeds only.

    Its tables are `runs` (run by run), `runs_search` and, where runs were refined, `runs_refined`.
    """
    settings, runs, parameters = collected.settings, collected.runs, collected.parameters
    idle = [n for n in parameters.names if all(n in run.without_effect for run in runs)]
    estimates = {"search": [run.searched for run in runs]}
    if any(run.refined for run in runs):
        estimates["refined"] = [run.best for run in runs]
    tables = {f"runs_{name}": spread_table(parameters, each, idle, name) for name, each in estimates.items()}
    best = collected.best
    note = f" {listed(idle)} had no effect in any run." if idle else ""
    lead = f"The smallest error is {best.rms_deg:.4g}° rms, of seed {best.seed}.{note}"
    bars = tuple(
        parameter_bar(settings, p, best.summary.estimate[p.name], [float(run.best.theta[i]) for run in runs])
        for i, p in enumerate(parameters.parameters)
    )
    text = "Bar: from the lower to the upper bound. Orange line: the best run. Blue dots: all runs."
    sections = (
        Section("Where the estimates lie", text, bars=bars, more=tables),
        Section("Run by run", tables={"runs": runs_table(parameters, runs)}),
    )
    title, verdict = f"{len(runs)} runs with different seeds", Verdict(lead, lights=(_agreement(runs),))
    return Page("runs", title, lead, sections, verdict=verdict)


def _agreement(runs: Sequence[RunResult]) -> Light:
    """The light for whether the runs reach the same error."""
    least = min(run.best.rms for run in runs)
    near = sum(run.best.rms <= (1 + _NEAR) * least for run in runs)
    words = f"{near} of {len(runs)} end within {100 * _NEAR:.0f} % of the smallest error."
    return Light("Runs agree", "good" if near == len(runs) else "fair", words)


def final_spread(page: Page) -> Table:
    """Return the table of the runs' final estimates."""
    return page.tables.get("runs_refined") or page.tables["runs_search"]


def spread_table(
    parameters: ParameterSet, runs: Sequence[RunEstimate], without_effect: Collection[str], name: str
) -> Table:
    """Return median and spread over runs of each parameter and of the output error.

    `name` is the estimate's: search or refined. `without_effect` names parameters without effect in any run.
    """
    theta = np.array([run.theta for run in runs])
    rows: list[tuple[Cell, ...]] = [
        (p.name, p.unit, *_quartiles(values), _flag(p, values, without_effect))
        for p, values in zip(parameters.parameters, theta.T, strict=True)
    ]
    rows.append(("rms output error", "deg", *_quartiles(np.degrees([run.rms for run in runs])), ""))
    header = ("name", "unit", "median", "lowest", "lower quartile", "upper quartile", "highest", "flag")
    seeds = ", ".join(str(run.seed) for run in runs)
    note, optional = f"Seeds: {seeds}.", ("lower quartile", "upper quartile")
    return Table(f"{len(runs)} runs, {name}", header, tuple(rows), note, optional)


def runs_table(parameters: ParameterSet, runs: Sequence[RunResult]) -> Table:
    """Return one row per run, the smallest output error first."""
    values = tuple(f"{p.name} [{p.unit}]" for p in parameters.parameters)
    rows = tuple(
        (str(run.path), run.seed, run.rms_deg, *map(float, run.best.theta))
        for run in sorted(runs, key=lambda run: (run.best.rms, run.seed))
    )
    header = ("run", "seed", "rms output error [deg]", *values)
    return Table("Runs, smallest error first", header, rows, optional=values[::-1])


def _quartiles(values: Array) -> tuple[float, ...]:
    low, q1, median, q3, high = np.quantile(values, [0, 0.25, 0.5, 0.75, 1])
    return float(median), float(low), float(q1), float(q3), float(high)


def _flag(parameter: Parameter, values: Array, without_effect: Collection[str]) -> str:
    """Say what is to be known about a parameter over several runs, values of shape (N,); may be empty."""
    if not parameter.lower < parameter.upper or (parameter.fixed is not None and not np.ptp(values)):
        return Flag.FIXED.value
    if parameter.name in without_effect:
        return Flag.NO_EFFECT.value
    counts = ((side, int(np.sum(at))) for side, at in at_bounds(parameter, values))
    return ", ".join(f"at {side} bound in {n} of {len(values)} runs" for side, n in counts if n)
