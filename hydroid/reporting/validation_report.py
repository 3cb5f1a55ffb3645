"""The page of a validation, and tables of runs that differ in their seeds."""

from collections.abc import Sequence

import numpy as np

from hydroid.findings import Finding
from hydroid.fitting.validation import Prediction
from hydroid.reporting.page import Page
from hydroid.reporting.parameters_report import status
from hydroid.reporting.predictions import prediction_sections
from hydroid.reporting.table import Table
from hydroid.reporting.verdict_table import Verdicts, lead, verdict_section
from hydroid.run.record import Record
from hydroid.settings.arm import Arm

SPREAD = ("name", "unit", "median", "lowest", "lower_quartile", "upper_quartile", "highest", "flag")


def validation_page(predictions: Sequence[Prediction], fits: Verdicts, arm: Arm, *steps: Finding) -> Page:
    """Return the page of several fits on several logs; its tables are `verdict`, `errors` and `horizons`."""
    ordered = sorted(predictions, key=lambda p: p.unseen is not True)
    sections = verdict_section(fits, *steps), *prediction_sections(ordered, arm, fits)
    return Page("validation", "Validation", lead(fits), sections)


def merged_tables(runs: Sequence[Record]) -> dict[str, Table]:
    """Return the tables `spread` and `runs` of runs that differ in their seeds only, the best run first."""
    runs = sorted(runs, key=lambda run: run.rms_deg)
    parameters = runs[0].settings.parameter_set().parameters
    names, rms = tuple(f"{p.name} [{p.unit}]" for p in parameters), [run.rms_deg for run in runs]
    theta = np.array([[run.summary.values[p.name] for p in parameters] for run in runs])

    columns, best = np.column_stack([theta, rms]), runs[0].summary.estimate
    units = {p.name: p.unit for p in parameters} | {"rms output error": "deg"}
    spread = np.quantile(columns, [0.5, 0, 0.25, 0.75, 1], axis=0).T.tolist()
    rows = [
        (name, unit, *row, status(best[name]) if name in best else "")
        for (name, unit), row in zip(units.items(), spread, strict=True)
    ]
    each = [(run.folder, run.seed, run.rms_deg, *row) for run, row in zip(runs, theta.tolist(), strict=True)]
    header = ("run", "seed", "rms output error [deg]", *names)
    return {
        "spread": Table(f"{len(runs)} runs", SPREAD, tuple(rows), optional=SPREAD[4:6]),
        "runs": Table("Runs, smallest error first", header, tuple(each), optional=names[::-1]),
    }
