"""The report of a validation: how well several fits predict several logs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import degrees
from pathlib import Path

import numpy as np

from hydroid.fitting.validation import ErrorIndices
from hydroid.identified import IdentifiedModel
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.quantities.band import Band
from hydroid.report.fit_report import INDICES, INDICES_NOTE, index_cells
from hydroid.report.page import Page, Section, file_name, log_names, short_name, unique
from hydroid.report.responses import JointResponse, response_plots
from hydroid.report.table import Cell, Table, number

_BANDS = "Prediction bands"
_BAND_HEADER = (
    "noise [deg]",
    "expected error [deg]",
    "error [deg]",
    "error of the model [deg]",
    "inside [%]",
)
_BAND_NOTE = (
    "noise: standard deviation that the fit saw in its own residuals. expected error: rms, of this noise and "
    "of the parameters' uncertainty together. error: rms. error of the model: the part of the error that the "
    "expected one does not explain. inside: samples within the 95 % band; 95 % are expected if the model is "
    "right, and slow noise may leave it for a while."
)


@dataclass(frozen=True, eq=False)
class Validation:
    """One fit's response to one log.

    Attributes:
        fit: its name.
        log: what it is compared with.
        response: outputs [rad], shape (T, K).
        indices: of the error by joint, numbered from 1.
        bands: prediction bands by joint; empty of a model that is no fit.
    """

    fit: str
    log: Log
    response: Array
    indices: Mapping[int, ErrorIndices]
    bands: Mapping[int, Band] = field(default_factory=dict[int, Band])


def validation_page(results: Sequence[Validation], folds: Sequence[IdentifiedModel] = ()) -> Page:
    """Return the page of several fits on several logs; its table is `validation` (article, table 9)."""
    logs = {result.log.source: result.log for result in results}
    names = dict(zip(logs, log_names(list(logs.values())), strict=True))
    rows: list[tuple[Cell, ...]] = []
    band_rows: list[tuple[Cell, ...]] = []
    verdicts: list[str] = []
    records: dict[object, tuple[JointResponse, dict[str, Array], dict[str, Array]]] = {}
    for result in results:
        log, name = result.log, names[result.log.source]
        for column, (joint, indices) in enumerate(result.indices.items()):
            command, measured = log.command[:, joint - 1], log.angle[:, joint - 1]
            simulated: dict[str, Array] = {}
            halves: dict[str, Array] = {}
            record = log.time, command, measured
            response = JointResponse(name, joint, *record, simulated, bands=halves)
            # fits that read the log with another delay or period were not compared with the same record
            key = name, joint, measured.tobytes(), command.tobytes()
            _, simulated, halves = records.setdefault(key, (response, simulated, halves))
            fit = unique(short_name(result.fit), simulated)
            simulated[fit] = result.response[:, column]
            rows.append((fit, name, joint, *index_cells(indices)))
            if band := result.bands.get(joint):
                halves[fit] = band.half
                band_rows.append((fit, name, joint, *_band_cells(band)))
                verdicts.append(f"{fit} on {name}, joint {joint}: {_verdict(band)}")
    table = Table(
        "Output error on given logs",
        ("fit", "log", "joint", *INDICES),
        tuple(rows),
        INDICES_NOTE,
        INDICES[:3:2],
    )
    taken: set[str] = set()
    responses = {
        file_name(f"validation_{Path(each.log).stem}_joint_{each.joint}", taken): each
        for each, *_ in records.values()
    }
    plots, more = response_plots(responses, [max(each.mean_squares()) for each in responses.values()])
    fits, count = len({row[0] for row in rows}), len(names)
    lead = f"{fits} fit{'s' * (fits != 1)} on {count} log{'s' * (count != 1)}.{more}"
    section = Section("Output error", tables={"validation": table}, plots=plots)
    bands = Table(_BANDS, ("fit", "log", "joint", *_BAND_HEADER), tuple(band_rows), _BAND_NOTE)
    limits = Section("What limits the prediction", points=tuple(verdicts), tables={"bands": bands})
    sections = [section, limits] if band_rows else [section]
    if folds:
        sections.append(Section("Without one log", tables={"folds": _fold_table(folds)}))
    return Page("validation", "Validation", lead, tuple(sections))


def _fold_table(folds: Sequence[IdentifiedModel]) -> Table:
    """Return the parameters of models that were refined without one log each."""
    values = np.array([fold.theta for fold in folds])
    rows: list[tuple[Cell, ...]] = []
    parameters = folds[0].settings.parameter_set().parameters
    for parameter, column in zip(parameters, values.T, strict=True):
        if parameter.fixed is None:
            mean, spread = float(column.mean()), float(column.std(ddof=1))
            relative = 100 * spread / abs(mean) if mean else np.inf
            rows.append((parameter.name, parameter.unit, *map(float, column), relative))
    header = ("name", "unit", *(short_name(fold.source) for fold in folds), "spread [%]")
    note = "Each column: refined without one log. spread: their standard deviation relative to their mean."
    return Table("Parameters without one log", header, tuple(rows), note, ("spread [%]",))


def _band_cells(band: Band) -> tuple[Cell, ...]:
    """Return the cells of _BAND_HEADER."""
    errors = (degrees(x) for x in (band.noise, band.expected, band.error, band.model_error))
    return (*errors, 100 * band.inside)


def _verdict(band: Band) -> str:
    """Say what limits the prediction."""
    inside = f"{100 * band.inside:.0f} % of the samples lie inside the band."
    if not band.model_limits:
        return f"{inside} The noise and the uncertainty of the parameters explain the error."
    ratio = number(band.model_error / band.noise)
    return f"{inside} The model limits the prediction, not the noise: its error is {ratio} times the noise."
