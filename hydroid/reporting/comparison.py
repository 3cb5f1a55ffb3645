"""Several models on the same logs: the page of a validation, and of several finished runs side by side."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf

import numpy as np

from hydroid.findings import Finding
from hydroid.fitting.validation import Prediction
from hydroid.identified_model import IdentifiedModel
from hydroid.reporting.page import Bar, Page, Section, short_name
from hydroid.reporting.parameters_report import parameter_bar
from hydroid.reporting.predictions import motion, prediction_section, response_data
from hydroid.reporting.table import Table
from hydroid.reporting.verdict import by_fit, verdict
from hydroid.run.record import Record
from hydroid.settings.arm import Arm


def validation_page(
    predictions: Sequence[Prediction], arm: Arm, folds: Sequence[IdentifiedModel] = ()
) -> Page:
    """Return the page of several fits on several logs; its table is `errors` (article, table 9).

    `folds` are models that were refined without one log each.
    """
    parts = (Section("Without one log", tables={"folds": _fold_table(folds)}),) if folds else ()
    warnings = tuple(str(f) for f in (p.finding for p in predictions) if f.level == "warning")
    return _page("validation", "Validation", predictions, arm, warnings, *parts)


def comparison_page(records: Mapping[str, Record]) -> Page:
    """Return the page of several runs side by side, by name: responses to the same logs, and parameters."""
    named = [replace(p, fit=name) for name, record in records.items() for p in record.predictions]
    text = "Each parameter with its 95 % interval, fit by fit, between the widest bounds of all."
    findings: list[tuple[str, Finding]] = [(n, f) for n, r in records.items() for f in r.summary.findings]
    warnings = tuple(f"{name}: {finding}" for name, finding in findings if finding.level != "note")
    arm, bars = next(iter(records.values())).settings.arm, Section("Parameters", text, bars=_bars(records))
    return _page("comparison", f"{len(records)} fits side by side", named, arm, warnings, bars)


def _page(
    name: str,
    title: str,
    predictions: Sequence[Prediction],
    arm: Arm,
    warnings: tuple[str, ...],
    *parts: Section,
) -> Page:
    fits = by_fit(predictions)
    ordered, judged = [p for own in fits.values() for p in own], verdict(fits)
    sections = (prediction_section(ordered, arm), *parts, *motion(ordered, arm))
    data = response_data(ordered, arm)
    return Page(name, title, judged.prediction, sections, warnings, data=data, verdict=judged)


def _bars(records: Mapping[str, Record]) -> tuple[Bar, ...]:
    """One bar per parameter and run, over the widest bounds of all."""
    bars: list[Bar] = []
    sets = {name: record.settings.parameter_set().parameters for name, record in records.items()}
    for parameter in dict.fromkeys(p.name for own in sets.values() for p in own if p.fixed is None):
        having = {name: p for name, own in sets.items() for p in own if p.name == parameter}
        lower, upper = min(p.lower for p in having.values()), max(p.upper for p in having.values())
        for i, (name, p) in enumerate(having.items()):
            wide = replace(p, lower=lower, upper=upper, log=p.log and lower > 0)
            bar = parameter_bar(records[name].settings, wide, records[name].summary.estimate[parameter])
            symbol, label = (parameter, f"{bar.name}: {name}") if i == 0 else ("", name)
            bars.append(replace(bar, symbol=symbol, name=label))
    return tuple(bars)


def _fold_table(folds: Sequence[IdentifiedModel]) -> Table:
    """Return the parameters of models that were refined without one log each."""
    parameters = folds[0].settings.parameter_set().parameters
    names = [short_name(fold.source) for fold in folds]
    rows = [
        {"name": p.name, "unit": p.unit}
        | dict(zip(names, values.tolist(), strict=True))
        | {"spread [%]": 100 * float(values.std(ddof=1)) / abs(mean) if (mean := values.mean()) else inf}
        for p, values in zip(parameters, np.transpose([fold.theta for fold in folds]), strict=True)
        if p.fixed is None
    ]
    note = "Each column: refined without one log. spread: their standard deviation relative to their mean."
    return Table.of("Parameters without one log", rows, note, ("spread [%]",))
