"""`hydroid identifiability` for a reader: one page, its tables and figures."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hydroid.files import write_atomic
from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.report.html import Section
from hydroid.report.identifiability import direction_table, noise_table, told_section
from hydroid.report.phrases import status_phrase
from hydroid.report.table import Cell, Table, known
from hydroid.report.write import write_figure, write_table
from hydroid.uncertainty.covariance import Uncertainty
from hydroid.uncertainty.directions import Identifiability
from hydroid.uncertainty.intervals import Profile


@dataclass(frozen=True, eq=False)
class Told:
    """What logs tell at one parameter set.

    Attributes:
        problem: the logs and the model.
        source: where the parameter set is from, in words.
        uncertainty: intervals there.
        identifiability: what the logs tell apart there.
        profiles: profile likelihoods, as far as they were asked for.
        bootstrapped: estimates of the bootstrap's refits, shape (N, P), N may be 0.
    """

    problem: Problem
    source: str
    uncertainty: Uncertainty
    identifiability: Identifiability
    profiles: tuple[Profile, ...] = ()
    bootstrapped: Array | None = None


def interval_table(told: Told) -> Table:
    """Every parameter with its standard deviation, its 95 % intervals by each method, and what to know."""
    found, profiles = told.uncertainty, {p.name: p.interval for p in told.profiles}
    header = ["name", "unit", "value", "standard deviation", "from", "to"]
    header += ["profile from", "profile to"] if profiles else []
    drawn = told.bootstrapped
    header += ["bootstrap from", "bootstrap to"] if drawn is not None else []
    rows: list[tuple[Cell, ...]] = []
    for i, parameter in enumerate(told.problem.parameters.parameters):
        row: list[Cell] = [parameter.name, parameter.unit, float(found.theta[i])]
        row += [known(v) for v in (found.standard_deviation[i], *found.interval[i])]
        if profiles:
            row += [known(v) for v in profiles.get(parameter.name, (np.nan, np.nan))]
        if drawn is not None:
            ends = (
                np.quantile(drawn[:, i], [0.025, 0.975]) if np.isfinite(found.relative[i]) else [np.nan] * 2
            )
            row += [known(v) for v in ends]
        rows.append((*row, status_phrase(found.status[i])))
    note = (
        f"At {told.source}. 95 % intervals for noise as the logs show it there, as far as the model holds; a "
        "dash has no limit. Away from a fit the residual does not measure noise: give objective.noise_deg."
    )
    return Table("What the logs determine", (*header, "flag"), tuple(rows), note)


def write_told(out: Path, told: Told) -> Table:
    """Write the page, its tables and figures; return the table of intervals.

    Raises:
        RunError: the folder cannot be written.
    """
    from hydroid.report import plots
    from hydroid.report.html import report_html
    from hydroid.report.plots.identifiability import profiles

    drawn = plots.told(told.uncertainty, told.identifiability)
    if told.profiles:
        drawn["profiles"] = profiles(told.profiles, told.uncertainty, told.problem.parameters.names)
    vector = {name: plots.svg(figure) for name, figure in drawn.items()}
    tables = {
        "intervals": interval_table(told),
        "directions": direction_table(told.identifiability),
        "noise": noise_table(told.problem, told.uncertainty),
    }
    for name, table in tables.items():
        write_table(out, name, table)
    for name, figure in drawn.items():
        write_figure(out, name, figure, vector[name])
    names, rank = told.identifiability.names, told.identifiability.rank
    section = told_section("", told.problem, told.uncertainty, told.identifiability, vector)
    answer = Section("Intervals", tables=(tables["intervals"],))
    lead = f"The logs determine {rank} independent combinations of the {len(names)} free parameters."
    page = report_html("What the logs determine", lead, (answer, section), {})
    write_atomic(out / "identifiability.html", page)
    return tables["intervals"]
