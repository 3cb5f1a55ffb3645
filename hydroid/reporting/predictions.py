"""Pages of predictions, what models make of logs: of a fit, from what its run stores,
and of a validation.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from hydroid.files import csv_text
from hydroid.findings import Finding
from hydroid.fitting.search import HISTORY
from hydroid.fitting.validation import Prediction
from hydroid.fitting.verdict import standing_out
from hydroid.reporting import page_file
from hydroid.reporting.actuator_report import speed_section, step_section
from hydroid.reporting.correlation_report import correlation_section
from hydroid.reporting.data_report import data_section
from hydroid.reporting.knowledge_report import (
    error_section,
    every_quantity_section,
    further_findings,
    quantity_section,
    quantity_table,
    unknown_section,
    warnings,
)
from hydroid.reporting.load_report import load_section
from hydroid.reporting.model_report import model_section
from hydroid.reporting.oil_report import oil_section
from hydroid.reporting.page import Page, Section, short_name
from hydroid.reporting.parameters_report import (
    parameter_section,
    parameter_table,
    prior_section,
    sentence,
)
from hydroid.reporting.residual_report import residual_section
from hydroid.reporting.response_report import error_table, response_section
from hydroid.reporting.search_report import search_section
from hydroid.reporting.shared_pump import slow_down
from hydroid.reporting.use_report import use_section
from hydroid.reporting.validity_report import log_next, validity_section
from hydroid.reporting.verdict_table import (
    Verdicts,
    horizon_section,
    lead,
    next_step,
    outside,
    verdict_sections,
)
from hydroid.run.record import FinishedRun, load_record
from hydroid.settings.arm import Arm
from hydroid.words import listed, time_words

MOST_LOGS = 6
"""logs that the foot of a page names"""
SOFTWARE = ("hydroid", "mujoco", "numpy", "python")
"""whose versions stand at the foot of a page"""


def validation_page(
    predictions: Sequence[Prediction], fits: Verdicts, arm: Arm, *steps: Finding
) -> Page:
    """Return the page of several fits on several logs.

    Its tables are `verdict`, `errors` and `horizons`.
    """
    ordered = sorted(predictions, key=lambda p: p.unseen is not True)
    verdicts = verdict_sections(fits, predictions, *steps)
    sections = (*verdicts, *prediction_sections(ordered, arm, fits))
    logs = dict.fromkeys(prediction.log.source for prediction in ordered)
    return Page(
        "validation",
        "Validation",
        lead(fits),
        sections,
        warnings=outside(next(iter(fits.values()))),
        files={"errors": error_table(ordered, arm, one_fit=len(fits) == 1)},
        made_from=(
            f"Fits: {listed([*map(short_name, fits)])}",
            f"logs: {_log_list(logs)}",
        ),
    )


def _log_list(sources: Iterable[str]) -> str:
    """Return the names of logs as the foot of a page has them."""
    names = [short_name(Path(source).name) for source in sources]
    return listed(names, MOST_LOGS)


def prediction_sections(
    predictions: Sequence[Prediction], arm: Arm, fits: Verdicts
) -> list[Section]:
    """Return errors and responses of each joint in each log, and the errors by
    prediction time."""
    if len(fits) == 1:
        predictions = [replace(p, fit="simulated") for p in predictions]
    sections = [response_section(predictions, arm, fits.values())]
    horizons = horizon_section(fits)
    if horizons is not None:
        sections.append(horizons)
    return sections


def write_report(run: str | Path, *, figures: bool = False) -> Path:
    """Write the report of a finished run in its folder, from what it stores; return the
    page."""
    folder = Path(run)
    page = fit_page(load_record(run))
    page_file.write_page(page, folder)
    if figures:
        page_file.write_figures(page, folder / "figures")
    return folder / f"{page.name}.html"


def fit_page(run: FinishedRun) -> Page:
    """Return the page of a fit, with the unseen logs that it was validated on."""
    settings = run.settings
    fits = {str(run.summary.final): run.verdict}
    shown = [*run.validations.values(), *run.result.fitted]
    versions = {
        name: str(run.identity[name]) for name in SOFTWARE if name in run.identity
    }
    return Page(
        "report",
        title=f"Fit of {settings.arm.name}, stage {2 if settings.stage == 'hyd' else 1}",
        lead=lead(fits),
        sections=_fit_sections(run, fits, shown),
        warnings=_fit_warnings(run),
        versions=versions,
        data=_search_data(run),
        files={
            "parameters": parameter_table(settings, run.summary),
            "quantities": quantity_table(settings, run.summary),
            "errors": error_table(shown, settings.arm, one_fit=True),
        },
        made_from=_made_from(run),
    )


def _fit_sections(
    run: FinishedRun, fits: Verdicts, shown: Sequence[Prediction]
) -> tuple[Section, ...]:
    """Return the sections of the page of a fit, those that are folded last."""
    settings = run.settings
    summary = run.summary
    fitted = run.result.fitted
    logs = [prediction.log for prediction in fitted]
    step = next_step(summary, run.verdict, run.folder, fitted)
    sections = (
        *verdict_sections(fits, shown, step, points=log_next(run)),
        *prediction_sections(shown, settings.arm, fits),
        quantity_section(settings, summary),
        error_section(settings, summary, run.verdict),
        validity_section(run),
        data_section(run),
        unknown_section(settings, summary),
        residual_section(settings, summary, fitted),
        oil_section(settings, summary, shown, slow_down(run.model, logs)),
        speed_section(settings, summary, logs),
        step_section(settings, summary),
        load_section(run.model, logs),
        every_quantity_section(settings, summary),
        model_section(run),
        parameter_section(settings, summary, *further_findings(summary)),
        prior_section(settings, summary),
        correlation_section(settings, summary),
        search_section(run),
        use_section(run),
    )
    return tuple(sorted(filter(None, sections), key=lambda section: section.folded))


def _fit_warnings(run: FinishedRun) -> tuple[str, ...]:
    """Return what must be read before the estimate of a fit is used."""
    warned = list[str]()
    unseen = [*run.validations.values()]
    apart = [Path(p.log.source).name for p in unseen if p.apart]
    if apart:
        what = f"The verdict does not count {listed(apart)}: validated with --apart."
        warned.append(what)
    warned += map(str, standing_out(unseen, run.verdict, run.folder))
    warned += outside(run.verdict)
    for finding in warnings(run.summary):
        warned.append(sentence(finding, run.settings))
    return tuple(warned)


def _search_data(run: FinishedRun) -> dict[str, str]:
    """Return the history and the Pareto set of the search as CSV with every bit, in its
    units: rad unless relative."""
    theta, objectives = run.result.front
    unit = "" if run.settings.objective.relative else "_rad"
    names = [*next(iter(run.summary.estimates.values())).values]
    names += [f"segment_{number}{unit}" for number in range(1, objectives.shape[1])]
    names.append(f"overall{unit}")
    candidates = np.column_stack([theta, objectives]).tolist()
    return {
        "history.csv": csv_text([HISTORY, *run.result.history.tolist()]),
        "pareto.csv": csv_text([names, *candidates]),
    }


def _made_from(run: FinishedRun) -> tuple[str, ...]:
    """Return the logs, settings, seed, time and date of a fit, for the foot of its
    page."""
    logs = [prediction.log.source for prediction in run.result.fitted]
    settings = f"settings: config.yaml in {run.folder}, model {run.summary.final}"
    if run.settings.stage == "hyd":
        settings += f" ({run.settings.simulation.model})"
    made_from = [f"Fitted to {_log_list(logs)}", settings, f"seed {run.seed}"]
    if run.seconds:
        made_from.append(f"took {time_words(sum(run.seconds.values()))}")
    if date := run.identity.get("finished"):
        made_from.append(str(date))
    return tuple(made_from)
