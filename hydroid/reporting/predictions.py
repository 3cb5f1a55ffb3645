"""Pages of predictions, what models make of logs: of a fit, from what its run stores, and of a validation."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import chain, cycle
from pathlib import Path

import numpy as np

from hydroid.arrays import rms
from hydroid.files import csv_text
from hydroid.findings import Finding
from hydroid.fitting.search import HISTORY
from hydroid.fitting.validation import Prediction
from hydroid.fitting.verdict import rms_deg, standing_out
from hydroid.reporting import page_file
from hydroid.reporting.actuator_report import response_section, speed_section
from hydroid.reporting.chart import SERIES, Chart, Mark, Panel, finite
from hydroid.reporting.correlation_report import correlation_section
from hydroid.reporting.knowledge_report import (
    error_section,
    further_findings,
    quantity_section,
    unknown_section,
    warnings,
)
from hydroid.reporting.outlines import motion_section
from hydroid.reporting.page import Page, Plot, Section, Table, log_names, short_name
from hydroid.reporting.parameters_report import in_words, parameter_section, parameter_table, prior_section
from hydroid.reporting.residual_report import residual_section
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
from hydroid.words import listed, number, two_digits

_MATRIX = "Rms error of each joint. Green: within its tolerance; amber: within twice that; red: beyond."
_KINDS = {True: "unseen", False: "fitted", None: ""}
_COLUMNS = {
    "fit": "fit",
    "log": "log",
    "kind": "log is",
    "name": "joint",
    "mae_deg": "mean absolute [{0}]",
    "rms_deg": "rms [{0}]",
    "max_deg": "largest [{0}]",
    "fit_percent": "fit [%]",
    "expected_deg": "expected [{0}]",
    "inside_percent": "inside band [%]",
}


def prediction_sections(predictions: Sequence[Prediction], arm: Arm, fits: Verdicts) -> list[Section]:
    """Return the arm in motion, each joint's error in each log with the responses behind it, and all numbers.

    The first prediction of a log is the one that moves. Of each joint the errors are shown of the first
    prediction that compares it; they are coloured by the tolerances of the first fit that does.
    """
    if len(fits) == 1:
        predictions = [replace(one, fit="simulated") for one in predictions]
    by_log: dict[str, list[Prediction]] = {}
    for one in predictions:
        by_log.setdefault(one.log.source, []).append(one)
    names = log_names(by_log)
    compared = {
        log: [*dict.fromkeys(j for one in group for j in one.joints)] for log, group in by_log.items()
    }
    bins = min(1000, max(150, 9000 // sum(map(len, compared.values()))))
    tolerances = dict[int, float]()
    for one in chain.from_iterable(fits.values()):
        tolerances.setdefault(one.joint, one.tolerance_deg)
    tabs: list[Plot] = []
    for log, group in by_log.items():
        for joint in compared[log]:
            title = f"{arm.joint_names[joint - 1]} in {names[log]}"
            several = [one for one in group if joint in one.joints]
            first = several[0]
            slides = arm.joints[joint - 1].slides
            # of many logs fewer samples are drawn: the page stays small
            drawing = partial(draw_response, title, joint, several, bins, slides=slides)
            error, tolerance = rms_deg([first.error(joint)]), tolerances.get(joint, np.inf)
            state = "good" if error <= tolerance else "fair" if error <= 2 * tolerance else "bad"
            size = f"{two_digits(1e3 * np.radians(error))} mm" if slides else f"{two_digits(error)}°"
            size = size if np.isfinite(error) else "diverged"
            row, column = f"{names[log]} {_kind(first)}".strip(), arm.joint_names[joint - 1]
            tabs.append(Plot(f"response_{len(tabs) + 1}", title, drawing, True, size, row, column, state))
    rows = [
        row | {"fit": short_name(one.fit), "log": names[one.log.source], "kind": _kind(one)}
        for one in predictions
        for row in one.plain(arm.joint_names)
    ]
    note = "fit: 100 % is perfect, 0 % as bad as a constant. expected: the rms error that the fit predicts."
    for row in rows:
        if row["joint"] in arm.slides:
            row |= {key: error and 1e3 * np.radians(error) for key, error in row.items() if "_deg" in key}
    unit = "deg, mm of joints that slide" if arm.slides else "deg"
    columns = {key: name.format(unit) for key, name in _COLUMNS.items()}
    if len(fits) == 1:
        del columns["fit"]
    optional = tuple(columns[key] for key in ("mae_deg", "max_deg", "inside_percent", "expected_deg"))
    errors = Table.of("All errors", columns, rows, note, optional)
    title, text = ("Errors by log", _MATRIX) if len(tabs) > 1 else ("Response", "")
    sections = (
        motion_section(arm, {names[log]: first for log, (first, *_) in by_log.items()}),
        Section(title, text, tabs=tuple(tabs)),
        Section(errors.title, tables={"errors": errors}, folded=True),
        horizon_section(fits),
    )
    return [*filter(None, sections)]


def _kind(one: Prediction) -> str:
    return "unseen, not counted" if one.apart else _KINDS[one.unseen]


def draw_response(
    title: str, joint: int, several: Sequence[Prediction], bins: int, *, slides: bool = False
) -> Chart:
    """Draw the measured angle of one joint, every model's response and residual, command and pressures."""
    log, column = several[0].log, joint - 1
    place, unit, factor = ("position", "mm", 1e3) if slides else ("angle", "deg", np.degrees(1.0))
    measured = factor * log.angle[:, column]
    upper = [Mark("line", log.time, measured, color="ink", label="measured", width=5, alpha=0.35)]
    middle = [Mark("rule", y=np.zeros(1), color="grey", width=1)]
    # a response that runs away, by three ranges of the measured angle, must not flatten the others
    far = 3.0 * max(np.ptp(measured), 1.0)
    for i, (one, color) in enumerate(zip(several, cycle(SERIES), strict=False)):
        residual, name, time = factor * finite(one.error(joint)), short_name(one.fit), one.log.time
        size = rms(residual)
        label = f"{name} ({number(size)} {unit} rms)" if np.isfinite(size) else f"{name} (diverged)"
        residual[np.abs(residual) > far] = np.nan
        angle = factor * one.log.angle[:, column] - residual
        upper.append(Mark("line", time, angle, color=color, label=label, off=i > 0))
        middle.append(Mark("line", time, residual, color=color, label=label, width=1, off=i > 0))
        if band := one.bands.get(joint):
            half = factor * band.half
            useless = ", wider than the motion" if np.mean(2 * half) > np.ptp(measured) else ""
            # nor must a band that the parameters leave open
            half = np.fmin(half, 2.0 * np.nanmax(np.abs(residual), initial=1e-6))
            label = f"{name}, 95 % band{useless}"
            middle.insert(0, Mark("band", time, -half, half, color=color, label=label, alpha=0.18, off=i > 0))
    panels = [
        Panel("", f"{place} [{unit}]", tuple(upper), title, 280),
        Panel("", f"residual [{unit}]", tuple(middle), height=190),
    ]
    if log.pressure is not None and np.isfinite(pressure := log.pressure[:, column]).any():
        marks = tuple(
            Mark("line", log.time, 1e-5 * p, color=color, label=f"chamber {side}")
            for side, color, p in zip("AB", ("green", "pink"), pressure.T, strict=True)
        )
        panels.append(Panel("", "pressure [bar]", marks, height=150))
    command = Mark("step", log.time, log.command[:, column], color="grey")
    panels.append(Panel("time [s]", "command [%]", (command,), height=140, y_limits=(-108, 108)))
    return Chart(tuple(panels), linked=True, bins=bins)


def validation_page(predictions: Sequence[Prediction], fits: Verdicts, arm: Arm, *steps: Finding) -> Page:
    """Return the page of several fits on several logs; its tables are `verdict`, `errors` and `horizons`."""
    ordered = sorted(predictions, key=lambda p: p.unseen is not True)
    sections = *verdict_sections(fits, *steps), *prediction_sections(ordered, arm, fits)
    return Page("validation", "Validation", lead(fits), sections, outside(next(iter(fits.values()))))


def draw(run: str | Path, *, figures: bool = False) -> Path:
    """Draw the report of a finished run in its folder, from what it stores; return the page."""
    folder, page = Path(run), fit_page(load_record(run))
    page_file.write_page(page, folder)
    if figures:
        page_file.write_figures(page, folder / "figures")
    return folder / f"{page.name}.html"


def fit_page(record: Record) -> Page:
    """Return the page of a fit, with the unseen logs that it was validated on."""
    settings, summary, fitted = record.settings, record.summary, record.result.fitted
    fits = {str(summary.final): record.verdict}
    sections = (
        *verdict_sections(fits, next_step(summary, record.verdict, record.folder, fitted)),
        *prediction_sections([*record.validations.values(), *fitted], settings.arm, fits),
        quantity_section(settings, summary),
        error_section(settings, summary),
        unknown_section(settings, summary),
        residual_section(settings, summary, fitted),
        speed_section(settings, summary, [one.log for one in fitted]),
        response_section(settings, summary),
        parameter_section(settings, summary, *further_findings(summary)),
        prior_section(settings, summary),
        correlation_section(settings, summary),
        search_section(record),
    )
    in_order = sorted(filter(None, sections), key=lambda section: section.folded)
    title = f"Fit of {settings.arm.name}, stage {2 if settings.stage == 'hyd' else 1}"
    made_by = {k: str(v) for k, v in record.identity.items() if k in ("hydroid", "mujoco", "numpy", "python")}
    unseen = [*record.validations.values()]
    apart = [Path(one.log.source).name for one in unseen if one.apart]
    left_out = [f"The verdict does not count {listed(apart)}: validated with --apart."] if apart else []
    out = map(str, standing_out(unseen, record.verdict, record.folder))
    said = (str(in_words(one, settings)) for one in warnings(summary))
    warned = (*left_out, *out, *outside(record.verdict), *said)
    # the history and the Pareto set with every bit, in the search's units: rad unless relative
    theta, objectives = record.result.front
    unit = "" if settings.objective.relative else "_rad"
    segments = (f"segment_{s}{unit}" for s in range(1, objectives.shape[1]))
    header = (*next(iter(summary.estimates.values())).values, *segments, f"overall{unit}")
    data = {
        "history.csv": csv_text([HISTORY, *record.result.history.tolist()]),
        "pareto.csv": csv_text([header, *np.column_stack([theta, objectives]).tolist()]),
    }
    files = {"parameters": parameter_table(settings, summary)}
    return Page("report", title, lead(fits), tuple(in_order), warned, made_by, data, files)
