"""Several runs with different seeds, of one command or collected from folders: their spread as a page."""

from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from hydroid.fitting.fit import Fit
from hydroid.parameters import Array, ParameterSet
from hydroid.report.page import Light, Page, Section, Verdict
from hydroid.report.parameter_bars import spread_bars
from hydroid.report.phrases import runs_phrase
from hydroid.report.table import Cell, Table
from hydroid.run.collection import RunEstimate, RunResult
from hydroid.settings.fit import FitSettings
from hydroid.words import listed

_NEAR = 0.05
"""part of the smallest error by which runs that found the same optimum may differ"""


def run_result(path: Path, seed: int, fit: Fit, names: Sequence[str]) -> RunResult:
    """Return what a fit in a folder found."""
    searched, best = (RunEstimate(seed, e.theta, e.rms) for e in (fit.searched, fit.best))
    none = frozenset(name for name, idle in zip(names, fit.without_effect, strict=True) if idle)
    return RunResult(path, searched, best, fit.refinement is not None, none)


def spread_page(settings: FitSettings, runs: Sequence[RunResult]) -> Page:
    """Return the page of several runs, at least one, that differ in their seeds only.

    Its tables are `runs` (run by run), `runs_search` and, where runs were refined, `runs_refined`.
    """
    parameters = settings.parameter_set()
    common = frozenset[str].intersection(*(run.without_effect for run in runs))
    idle = [name for name in parameters.names if name in common]
    estimates = {"search": [run.searched for run in runs]}
    if any(run.refined for run in runs):
        estimates["refined"] = [run.best for run in runs]
    tables = {f"runs_{name}": spread_table(parameters, each, idle, name) for name, each in estimates.items()}

    columns = {
        name: (np.array([run.theta for run in each]), np.array([run.rms for run in each]))
        for name, each in estimates.items()
    }
    best = min(runs, key=lambda run: (run.best.rms, run.seed))
    note = f" {listed(idle)} had no effect in any run." if idle else ""
    lead = f"The smallest output error is {best.rms_deg:.4g} deg rms, of seed {best.seed}.{note}"
    bars = spread_bars(parameters, settings.parameters, columns[next(reversed(columns))][0], idle)
    return Page(
        "runs",
        f"{len(runs)} runs with different seeds",
        lead,
        (
            Section(
                "Where the estimates lie",
                "Bar: from the lower to the upper bound. Orange line: the median. Blue dots: the runs.",
                bars=bars,
                more=tables,
            ),
            Section("Run by run", tables={"runs": runs_table(parameters, runs)}),
        ),
        verdict=Verdict(lead, lights=(_agreement(runs),)),
    )


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
        (p.name, p.unit, *_quartiles(values), runs_phrase(p, values, without_effect))
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
