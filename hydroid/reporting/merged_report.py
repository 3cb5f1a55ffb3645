"""Runs of one fit that differ in their seeds only: the spread of their errors and
estimates."""

from collections.abc import Sequence

import numpy as np

from hydroid.reporting.page import Cell, Table
from hydroid.reporting.parameters_report import status
from hydroid.run.record import Record

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


def merged_tables(runs: Sequence[Record]) -> dict[str, Table]:
    """Return the tables `spread` and `runs` of runs that differ in their seeds only,
    the best run first.

    A seed may lead to further terms, and so to parameters that others lack; their cells
    are empty, as are errors of joints that diverged. The spread is over the runs that
    have a value.
    """
    runs = sorted(runs, key=lambda run: run.rms_deg)
    units = dict[str, str]()
    flags = dict[str, str]()
    for run in runs:
        units |= {f"error of {one.name}": one.shown.unit for one in run.summary.verdict}
    for run in runs:
        units |= {name: one.unit for name, one in run.summary.estimate.items()}
        flags = {
            name: status(one) for name, one in run.summary.estimate.items()
        } | flags
    values = [_errors(run) | run.summary.values for run in runs]
    rows = [
        (run.folder, run.seed, *map(one.get, units))
        for run, one in zip(runs, values, strict=True)
    ]
    spread: list[tuple[Cell, ...]] = []
    for name, unit in units.items():
        given = [value for one in values if (value := one.get(name)) is not None]
        quantiles = (
            np.quantile(given, [0.5, 0, 0.25, 0.75, 1]).tolist()
            if given
            else [None] * 5
        )
        spread.append((name, unit, *quantiles, flags.get(name, "")))
    header = "run", "seed", *(f"{name} [{unit}]" for name, unit in units.items())
    return {
        "spread": Table(
            f"{len(runs)} runs", SPREAD, tuple(spread), optional=SPREAD[4:6]
        ),
        "runs": Table(
            "Runs, smallest error first", header, tuple(rows), optional=header[:1:-1]
        ),
    }


def _errors(run: Record) -> dict[str, float | None]:
    """Return each joint's error on the fitted logs [deg], of one that slides [mm].

    None: there is none.
    """
    errors = dict[str, float | None]()
    for one in run.summary.verdict:
        factor = one.shown.of_degrees(1.0)
        errors[f"error of {one.name}"] = (
            None if one.fitted_deg is None else factor * one.fitted_deg
        )
    return errors
