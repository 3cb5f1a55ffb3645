"""Runs of one fit that differ in their seeds only: the spread of their errors and
estimates."""

from collections.abc import Sequence

import numpy as np

from hydroid.joint_verdict import JointVerdict
from hydroid.reporting.page import Cell, Table
from hydroid.reporting.parameters_report import status
from hydroid.run.record import FinishedRun

SPREAD = (
    "name",
    "unit",
    "median",
    "lowest",
    "lower_quartile",
    "upper_quartile",
    "highest",
    "flag",
)


def merged_tables(runs: Sequence[FinishedRun]) -> dict[str, Table]:
    """Return the tables `spread` and `runs` of runs that differ in their seeds only,
    the best run first.

    A seed may lead to further terms, and so to parameters that others lack; their cells
    are empty, as are errors of joints that diverged. The spread is over the runs that
    have a value.
    """
    runs = sorted(runs, key=lambda run: run.rms_deg)
    units = dict[str, str]()
    # errors stand before parameters, whatever run brings them in
    for run in runs:
        for verdict in run.summary.verdict:
            units[_error_name(verdict)] = verdict.shown.unit
    flags = dict[str, str]()
    for run in runs:
        for name, estimate in run.summary.estimate.items():
            units[name] = estimate.unit
            flags.setdefault(name, status(estimate))
    values = [_errors(run) | run.summary.values for run in runs]
    spread = list[tuple[Cell, ...]]()
    for name, unit in units.items():
        quantiles = _quantiles([of_run.get(name) for of_run in values])
        spread.append((name, unit, *quantiles, flags.get(name, "")))
    header = ["run", "seed", *(f"{name} [{unit}]" for name, unit in units.items())]
    rows = list[tuple[Cell, ...]]()
    for run, of_run in zip(runs, values, strict=True):
        rows.append((run.folder, run.seed, *map(of_run.get, units)))
    title = f"{len(runs)} runs"
    by_run = "Runs, smallest error first"
    last_first = tuple(header[:1:-1])
    return {
        "spread": Table(title, SPREAD, tuple(spread), optional=SPREAD[4:6]),
        "runs": Table(by_run, tuple(header), tuple(rows), optional=last_first),
    }


def _quantiles(values: Sequence[float | None]) -> list[float | None]:
    """Return the quantiles of SPREAD of the values that there are, each None without
    any."""
    given = [value for value in values if value is not None]
    if not given:
        return [None] * 5
    return np.quantile(given, [0.5, 0, 0.25, 0.75, 1]).tolist()


def _error_name(verdict: JointVerdict) -> str:
    return f"error of {verdict.name}"


def _errors(run: FinishedRun) -> dict[str, float | None]:
    """Return each joint's error on the fitted logs [deg], of one that slides [mm].

    None: there is none.
    """
    errors = dict[str, float | None]()
    for verdict in run.summary.verdict:
        name = _error_name(verdict)
        errors[name] = None
        if verdict.fitted_deg is not None:
            errors[name] = verdict.shown.of_degrees(1.0) * verdict.fitted_deg
    return errors
