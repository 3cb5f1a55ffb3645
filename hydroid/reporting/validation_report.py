"""The page of a validation, and tables of runs that differ in their seeds."""

from collections.abc import Sequence

import numpy as np

from hydroid.fitting.validation import Prediction
from hydroid.parameters import Array
from hydroid.reporting.page import Page
from hydroid.reporting.parameters_report import status
from hydroid.reporting.predictions import prediction_sections
from hydroid.reporting.table import Table
from hydroid.reporting.verdict_table import Verdicts, lead, verdict_section
from hydroid.run.collection import Runs
from hydroid.settings.arm import Arm


def validation_page(predictions: Sequence[Prediction], fits: Verdicts, arm: Arm) -> Page:
    """Return the page of several fits on several logs; its tables are `verdict` and `errors`."""
    ordered = sorted(predictions, key=lambda p: p.unseen is not True)
    sections = verdict_section(fits), *prediction_sections(ordered, arm, fits)
    return Page("validation", "Validation", lead(fits), sections)


def merged_tables(runs: Runs) -> dict[str, Table]:
    """Return the tables `spread` and `runs` of runs that differ in their seeds only."""
    return {"spread": spread_table(runs), "runs": runs_table(runs)}


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
        (run.folder, run.seed, run.rms_deg, *theta.tolist())
        for run, theta in zip(runs.runs, runs.theta, strict=True)
    ]
    header = ("run", "seed", "rms output error [deg]", *values)
    ordered = tuple(sorted(rows, key=lambda row: (row[2], row[1])))
    return Table("Runs, smallest error first", header, ordered, optional=values[::-1])
