"""Several models: the pages of a validation, of runs side by side, and of runs with different seeds."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from hydroid.fitting.validation import Prediction
from hydroid.identified_model import IdentifiedModel
from hydroid.parameters import Array
from hydroid.reporting.page import Page, Section, Verdict, short_name, unique
from hydroid.reporting.parameters_report import parameter_section, status
from hydroid.reporting.predictions import motion, prediction_section, response_data
from hydroid.reporting.table import Cell, Table
from hydroid.reporting.uncertainty_report import warnings
from hydroid.reporting.verdict import by_fit, verdict
from hydroid.run.collection import Runs
from hydroid.run.record import Record
from hydroid.settings.arm import Arm
from hydroid.settings.fit import FitSettings


def validation_page(
    predictions: Sequence[Prediction], arm: Arm, folds: Sequence[IdentifiedModel] = ()
) -> Page:
    """Return the page of several fits on several logs; its table is `errors` (article, table 9).

    `folds` are models that were refined without one log each.
    """
    parts: list[Section] = []
    if folds:
        table = side_by_side({fold.source: (fold.settings, fold.values) for fold in folds})
        parts.append(Section("Without one log", tables={"folds": table}))
    findings = [p.finding for p in predictions]
    beware = tuple(str(finding) for finding in findings if finding.level == "warning")
    return _page("validation", "Validation", predictions, arm, parts, beware)


def comparison_page(records: Mapping[str, Record]) -> Page:
    """Return the page of several runs side by side, by name: responses to the same logs, and parameters."""
    named = [replace(p, fit=name) for name, record in records.items() for p in record.predictions]
    arm = next(iter(records.values())).settings.arm
    table = side_by_side({name: (r.settings, r.summary.values) for name, r in records.items()})
    parts = [Section("Parameters", tables={"parameters": table})]
    for name, record in records.items():
        section = parameter_section(record.settings, record.summary)
        parts.append(replace(section, title=f"Parameters of {name}", more={}, folded=True))
    beware = tuple(f"{name}: {text}" for name, r in records.items() for text in warnings(r.summary))
    return _page("comparison", f"{len(records)} fits side by side", named, arm, parts, beware)


def _page(
    name: str,
    title: str,
    predictions: Sequence[Prediction],
    arm: Arm,
    parts: Sequence[Section],
    beware: tuple[str, ...],
) -> Page:
    fits = by_fit(predictions)
    ordered = sorted((p for own in fits.values() for p in own), key=lambda p: p.unseen is not True)
    judged, data = verdict(fits), response_data(ordered, arm)
    sections = (prediction_section(ordered, arm), *motion(ordered, arm), *parts)
    return Page(name, title, judged.prediction, sections, beware, data=data, verdict=judged)


def side_by_side(models: Mapping[str, tuple[FitSettings, Mapping[str, float]]]) -> Table:
    """Return the free parameters of models by name, one column each, and how far apart their values are."""
    units = {
        n: p.unit
        for settings, _ in models.values()
        for n, p in settings.parameters.items()
        if p.fixed is None
    }

    def row(name: str, unit: str) -> dict[str, Cell]:
        cells: dict[str, float | None] = {}
        for model, (_, values) in models.items():
            cells[unique(short_name(model), cells)] = values.get(name)
        known = np.array([value for value in cells.values() if value is not None])
        spread = 100 * float(known.std(ddof=1) / known.mean()) if len(known) > 1 and known.any() else None
        return {"name": name, "unit": unit, **cells, "spread [%]": spread}

    note = "spread: standard deviation of the values relative to their mean."
    return Table.of("Parameters side by side", (row(*one) for one in units.items()), note, ("spread [%]",))


def spread_page(runs: Runs) -> Page:
    """Return the page of several runs that differ in their seeds only; its tables are `spread` and `runs`."""
    best, count, mapping = runs.best, len(runs.runs), runs.parameters.mapping
    near = sum(run.rms_deg <= 1.05 * best.rms_deg for run in runs.runs)
    lead = f"The smallest error is {best.rms_deg:.4g}° rms, of seed {best.seed}."
    agree = f"{near} of {count} runs end within 5 % of it. The bars are of its estimate."
    bars = parameter_section(runs.settings, best.summary, others=[mapping(theta) for theta in runs.theta])
    sections = (
        replace(bars, more={"spread": spread_table(runs)}),
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
        (run.folder, run.seed, run.rms_deg, *theta.tolist())
        for run, theta in zip(runs.runs, runs.theta, strict=True)
    ]
    header = ("run", "seed", "rms output error [deg]", *values)
    ordered = tuple(sorted(rows, key=lambda row: (row[2], row[1])))
    return Table("Runs, smallest error first", header, ordered, optional=values[::-1])
