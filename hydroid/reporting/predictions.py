"""Pages of predictions, what models make of logs: of a fit, from what its run stores,
and of a validation.
"""

from collections.abc import Sequence
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
from hydroid.reporting.knowledge_report import (
    error_section,
    further_findings,
    quantity_section,
    unknown_section,
    warnings,
)
from hydroid.reporting.page import Page, Section, short_name
from hydroid.reporting.parameters_report import (
    in_words,
    parameter_section,
    parameter_table,
    prior_section,
)
from hydroid.reporting.residual_report import residual_section
from hydroid.reporting.response_report import error_table, response_section
from hydroid.reporting.search_report import search_section
from hydroid.reporting.verdict_table import (
    Verdicts,
    horizon_section,
    lead,
    next_step,
    outside,
    verdict_sections,
)
from hydroid.run.record import Record, load_record
from hydroid.settings.arm import Arm
from hydroid.words import listed

MOST_LOGS = 6
"""logs that the foot of a page names"""


def validation_page(
    predictions: Sequence[Prediction], fits: Verdicts, arm: Arm, *steps: Finding
) -> Page:
    """Return the page of several fits on several logs.

    Its tables are `verdict`, `errors` and `horizons`.
    """
    ordered = sorted(predictions, key=lambda p: p.unseen is not True)
    sections = [
        *verdict_sections(fits, *steps),
        *prediction_sections(ordered, arm, fits),
    ]
    files = {"errors": error_table(ordered, arm, one_fit=len(fits) == 1)}
    warned = outside(next(iter(fits.values())))
    logs = [
        short_name(Path(source).name)
        for source in dict.fromkeys(p.log.source for p in ordered)
    ]
    made_from = (
        f"Fits: {listed([*map(short_name, fits)])}",
        f"logs: {listed(logs, MOST_LOGS)}",
    )
    page = Page(
        "validation", "Validation", lead(fits), tuple(sections), warned, files=files
    )
    return replace(page, made_from=made_from)


def prediction_sections(
    predictions: Sequence[Prediction], arm: Arm, fits: Verdicts
) -> list[Section]:
    """Return errors and responses of each joint in each log, and the errors by
    prediction time."""
    if len(fits) == 1:
        predictions = [replace(one, fit="simulated") for one in predictions]
    horizons = horizon_section(fits)
    return [
        response_section(predictions, arm, fits.values()),
        *([horizons] if horizons else []),
    ]


def draw(run: str | Path, *, figures: bool = False) -> Path:
    """Draw the report of a finished run in its folder, from what it stores; return the
    page."""
    folder = Path(run)
    page = fit_page(load_record(run))
    page_file.write_page(page, folder)
    if figures:
        page_file.write_figures(page, folder / "figures")
    return folder / f"{page.name}.html"


def fit_page(record: Record) -> Page:
    """Return the page of a fit, with the unseen logs that it was validated on."""
    settings = record.settings
    summary = record.summary
    fitted = record.result.fitted
    shown = [*record.validations.values(), *fitted]
    fits = {str(summary.final): record.verdict}
    sections = (
        *verdict_sections(
            fits, next_step(summary, record.verdict, record.folder, fitted)
        ),
        *prediction_sections(shown, settings.arm, fits),
        quantity_section(settings, summary),
        error_section(settings, summary),
        unknown_section(settings, summary),
        residual_section(settings, summary, fitted),
        speed_section(settings, summary, [one.log for one in fitted]),
        step_section(settings, summary),
        parameter_section(settings, summary, *further_findings(summary)),
        prior_section(settings, summary),
        correlation_section(settings, summary),
        search_section(record),
    )
    in_order = sorted(filter(None, sections), key=lambda section: section.folded)
    title = f"Fit of {settings.arm.name}, stage {2 if settings.stage == 'hyd' else 1}"
    made_by = {
        k: str(v)
        for k, v in record.identity.items()
        if k in ("hydroid", "mujoco", "numpy", "python")
    }
    unseen = [*record.validations.values()]
    apart = [Path(one.log.source).name for one in unseen if one.apart]
    left_out = (
        [f"The verdict does not count {listed(apart)}: validated with --apart."]
        if apart
        else []
    )
    out = map(str, standing_out(unseen, record.verdict, record.folder))
    said = (str(in_words(one, settings)) for one in warnings(summary))
    warned = (*left_out, *out, *outside(record.verdict), *said)
    # the history and the Pareto set with every bit, in the search's units: rad unless
    # relative
    theta, objectives = record.result.front
    unit = "" if settings.objective.relative else "_rad"
    segments = (f"segment_{s}{unit}" for s in range(1, objectives.shape[1]))
    header = (
        *next(iter(summary.estimates.values())).values,
        *segments,
        f"overall{unit}",
    )
    data = {
        "history.csv": csv_text([HISTORY, *record.result.history.tolist()]),
        "pareto.csv": csv_text(
            [header, *np.column_stack([theta, objectives]).tolist()]
        ),
    }
    files = {
        "parameters": parameter_table(settings, summary),
        "errors": error_table(shown, settings.arm, one_fit=True),
    }
    made_from = _made_from(record)
    return Page(
        "report",
        title,
        lead(fits),
        tuple(in_order),
        warned,
        made_by,
        data,
        files,
        made_from,
    )


def _made_from(record: Record) -> tuple[str, ...]:
    """Return the logs, settings, seed and date of a fit, for the foot of its page."""
    logs = [short_name(Path(one.log.source).name) for one in record.result.fitted]
    model = record.settings.simulation.model
    settings = f"settings: config.yaml in {record.folder}, model {record.summary.final}"
    if record.settings.stage == "hyd":
        settings += f" ({model})"
    date = record.identity.get("finished")
    seed = f"seed {record.seed}"
    return (
        f"Fitted to {listed(logs, MOST_LOGS)}",
        settings,
        seed,
        *([str(date)] if date else []),
    )
