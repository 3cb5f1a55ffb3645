"""Several models on the same logs: the page of a validation, and of several finished runs side by side."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from hydroid.fitting.validation import Prediction
from hydroid.identified_model import IdentifiedModel
from hydroid.reporting.page import Page, Section, short_name
from hydroid.reporting.parameters_report import parameter_section
from hydroid.reporting.predictions import motion, prediction_section, response_data
from hydroid.reporting.table import Cell, Table
from hydroid.reporting.uncertainty_report import warnings
from hydroid.reporting.verdict import by_fit, verdict
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
    ordered, judged = [p for own in fits.values() for p in own], verdict(fits)
    sections = (prediction_section(ordered, arm), *motion(ordered, arm), *parts)
    data = response_data(ordered, arm)
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
        cells = {short_name(model): values.get(name) for model, (_, values) in models.items()}
        known = np.array([value for value in cells.values() if value is not None])
        spread = 100 * float(known.std(ddof=1) / known.mean()) if len(known) > 1 and known.any() else None
        return {"name": name, "unit": unit, **cells, "spread [%]": spread}

    note = "spread: standard deviation of the values relative to their mean."
    return Table.of("Parameters side by side", (row(*one) for one in units.items()), note, ("spread [%]",))
