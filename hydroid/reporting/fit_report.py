"""The page of a fit, from what its run stores: the verdict, the prediction, what is known, what to do."""

import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np

from hydroid.findings import Finding
from hydroid.fitting.search import HISTORY
from hydroid.fitting.verdict import judge
from hydroid.reporting import page_file
from hydroid.reporting.page import Page, Section, numbers_csv
from hydroid.reporting.parameters_report import (
    parameter_section,
    quantity_section,
    speed_section,
    unknown_sections,
    warnings,
)
from hydroid.reporting.predictions import prediction_sections
from hydroid.reporting.search_report import search_section
from hydroid.reporting.verdict_table import lead, next_step, verdict_section
from hydroid.run.record import Record, load_record


def draw(run: str | Path, *, figures: bool = False) -> Path:
    """Draw the report of a finished run in its folder, from what it stores; return the page.

    Args:
        run: its folder.
        figures: write every chart as PNG and SVG too, to figures/ beside the page.

    Raises:
        RunError: the folder holds no finished run of this version, or the page cannot be written.
    """
    folder, page = Path(run), fit_page(load_record(run))
    page_file.write_page(page, folder)
    if figures:
        page_file.write_figures(page, folder / "figures")
    return folder / f"{page.name}.html"


def fit_page(record: Record) -> Page:
    """Return the page of a fit, with the unseen logs that it was validated on."""
    settings, summary, result = record.settings, record.summary, record.result
    final, unseen = str(summary.final), [*record.validations.values()]
    fits = {final: judge(settings, result.fitted, result.baselines, unseen)}
    # a validation has the name of the run, a fitted log that of the estimate: here both are the fit
    predictions = [replace(p, fit=final) for p in (*unseen, *result.fitted)]
    step = next_step(settings, fits[final], record.folder, record.given)
    sections = (
        verdict_section(fits, step),
        *prediction_sections(predictions, settings.arm, fits),
        *quantity_section(settings, summary),
        *unknown_sections(summary),
        Section("Do next", steps=_steps(record, step)),
        parameter_section(settings, summary),
        *speed_section(settings, summary, [p.log for p in result.fitted]),
        search_section(record),
    )
    in_order = sorted(sections, key=lambda section: section.folded)
    title = f"Fit of {settings.arm.name}, stage {2 if settings.stage == 'hyd' else 1}"
    made_by = {k: str(v) for k, v in record.identity.items() if k in ("hydroid", "mujoco", "numpy", "python")}
    return Page("report", title, lead(fits), tuple(in_order), warnings(summary), made_by, _data(record))


def _steps(record: Record, first: Finding) -> tuple[Finding, ...]:
    """Return what to do after the first step, and how to make the fit again."""
    run, config, again = (shlex.quote(f"{record.folder}{end}") for end in ("", "/config.yaml", "-again"))
    commands = {
        "look for terms": f"hydroid suggest --fit {run}",
        "fit again": f"hydroid fit-{record.settings.stage} {record.given} --config {config} --out {again}",
    }
    more = (Finding(kind, "note", (), {"command": command}) for kind, command in commands.items())
    return tuple(finding for finding in more if finding.kind != first.kind)


def _data(record: Record) -> dict[str, str]:
    """Return the history and the Pareto set with every bit, in the search's units: rad unless relative."""
    result = record.result
    theta, objectives = result.front
    unit = "" if record.settings.objective.relative else "_rad"
    segments = (f"segment_{s}{unit}" for s in range(1, objectives.shape[1]))
    header = (*record.summary.estimates[record.summary.searched].values, *segments, f"overall{unit}")
    return {
        "history.csv": numbers_csv(HISTORY, result.history),
        "pareto.csv": numbers_csv(header, np.column_stack([theta, objectives])),
    }
