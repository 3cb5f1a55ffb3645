"""Several models on the same logs: the page of a validation, and of several finished runs side by side."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf, sqrt

import numpy as np

from hydroid.fitting.validation import Prediction
from hydroid.identified_model import IdentifiedModel
from hydroid.reporting.page import Bar, Light, Page, Section, Verdict, short_name
from hydroid.reporting.parameters_report import parameter_bar
from hydroid.reporting.predictions import motion, prediction_section, response_data
from hydroid.reporting.table import Cell, Table
from hydroid.run.record import Record
from hydroid.settings.arm import Arm
from hydroid.words import sentence


def validation_page(
    predictions: Sequence[Prediction], arm: Arm, folds: Sequence[IdentifiedModel] = ()
) -> Page:
    """Return the page of several fits on several logs; its table is `errors` (article, table 9).

    `folds` are models that were refined without one log each.
    """
    ordered, verdict = ranked(predictions), _verdict(predictions)
    sections = [prediction_section(ordered, arm), *motion(ordered, arm)]
    if folds:
        sections.append(Section("Without one log", tables={"folds": _fold_table(folds)}))
    data = response_data(ordered, arm)
    found = (p.finding for p in predictions)
    warnings = tuple(sentence(f) for f in found if f.level == "warning")
    title = "Validation"
    return Page(
        "validation", title, verdict.prediction, tuple(sections), warnings, data=data, verdict=verdict
    )


def comparison_page(records: Mapping[str, Record]) -> Page:
    """Return the page of several runs side by side, by name: responses to the same logs, and parameters."""
    named = [replace(p, fit=name) for name, record in records.items() for p in record.predictions]
    arm = next(iter(records.values())).settings.arm
    text = "Each parameter with its 95 % interval, fit by fit, between the widest bounds of all."
    warnings = tuple(
        f"{name}: {sentence(f)}"
        for name, record in records.items()
        for f in record.summary.findings
        if f.level != "note"
    )
    verdict = _verdict(named)
    sections = (prediction_section(ranked(named), arm), Section("Parameters", text, bars=_bars(records)))
    title = f"{len(records)} fits side by side"
    return Page("comparison", title, verdict.prediction, sections, warnings, verdict=verdict)


def ranked(predictions: Sequence[Prediction]) -> list[Prediction]:
    """Return predictions with the fit of the smallest error on unseen logs first."""
    order = list(_errors(predictions))
    return sorted(predictions, key=lambda p: order.index(p.fit))


def _judged(predictions: Sequence[Prediction]) -> list[Prediction]:
    """Predictions of unseen logs, or all where there is none."""
    return [p for p in predictions if p.unseen] or list(predictions)


def _errors(predictions: Sequence[Prediction]) -> dict[str, float]:
    """Rms error of each fit on the judged logs [deg], the smallest first; infinite without any."""
    squares: dict[str, list[float]] = {p.fit: [] for p in predictions}
    for one in _judged(predictions):
        squares[one.fit].append(one.rms_deg**2)
    errors = {fit: sqrt(sum(each) / len(each)) if each else inf for fit, each in squares.items()}
    return dict(sorted(errors.items(), key=lambda item: item[1]))


def _verdict(predictions: Sequence[Prediction]) -> Verdict:
    """Return the best fit's error on unseen logs, the others', and whether it is as expected."""
    judged, ((best, error), *others) = _judged(predictions), _errors(predictions).items()
    count, kind = len({p.log.source for p in judged}), "unseen log" if judged[0].unseen else "fitted log"
    which = f"one {kind}" if count == 1 else f"{count} {kind}s"
    prediction = f"{short_name(best)} predicts {which} with an error of {error:.2g}° rms."
    rest = (
        f"Others: {', '.join(f'{short_name(name)} {value:.2g}°' for name, value in others)}."
        if others
        else ""
    )
    own = [p.as_expected for p in judged if p.fit == best and p.bands]
    if not own:
        return Verdict(prediction, rest)
    question = "As the fitted logs lead to expect"
    if False in own:
        light = Light(
            question, "fair", f"No: on {own.count(False)} of {len(own)} logs the error is clearly larger."
        )
    elif None in own:
        light = Light(
            question, "open", f"Not known: the fit leaves {own.count(None)} of {len(own)} responses open."
        )
    else:
        light = Light(question, "good", "Yes.")
    return Verdict(prediction, rest, (light,))


def _bars(records: Mapping[str, Record]) -> tuple[Bar, ...]:
    """One bar per parameter and run, over the widest bounds of all."""
    bars: list[Bar] = []
    sets = {name: record.settings.parameter_set().parameters for name, record in records.items()}
    for parameter in dict.fromkeys(p.name for own in sets.values() for p in own if p.fixed is None):
        having = {name: p for name, own in sets.items() for p in own if p.name == parameter}
        bounds = min(p.lower for p in having.values()), max(p.upper for p in having.values())
        for i, (name, p) in enumerate(having.items()):
            settings, estimate = records[name].settings, records[name].summary.estimate[parameter]
            bar = parameter_bar(settings, p, estimate, bounds=bounds)
            symbol, label = (parameter, f"{bar.name}: {name}") if i == 0 else ("", name)
            bars.append(replace(bar, symbol=symbol, name=label))
    return tuple(bars)


def _fold_table(folds: Sequence[IdentifiedModel]) -> Table:
    """Return the parameters of models that were refined without one log each."""
    values = np.array([fold.theta for fold in folds])
    rows: list[tuple[Cell, ...]] = []
    parameters = folds[0].settings.parameter_set().parameters
    for parameter, column in zip(parameters, values.T, strict=True):
        if parameter.fixed is None:
            mean, spread = float(column.mean()), float(column.std(ddof=1))
            relative = 100 * spread / abs(mean) if mean else inf
            rows.append((parameter.name, parameter.unit, *map(float, column), relative))
    header = ("name", "unit", *(short_name(fold.source) for fold in folds), "spread [%]")
    note = "Each column: refined without one log. spread: their standard deviation relative to their mean."
    return Table("Parameters without one log", header, tuple(rows), note, ("spread [%]",))
