"""The report of a validation: how well several fits predict several logs."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import degrees
from pathlib import Path

import numpy as np

from hydroid.estimate import finite
from hydroid.fitting.validation import ErrorIndices
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.posterior.band import Band
from hydroid.report.fit_tables import INDICES, INDICES_NOTE, index_cells
from hydroid.report.moving_arm import Movement, motion_section
from hydroid.report.page import Light, Page, Section, Verdict, file_name, log_names, short_name, unique
from hydroid.report.responses import JointResponse, logged_pressures, response_data, response_tabs
from hydroid.report.table import Cell, Table
from hydroid.settings.arm import Arm

_BANDS = "Prediction bands"
_BAND_HEADER = (
    "noise [deg]",
    "expected error [deg]",
    "error [deg]",
    "further error [deg]",
    "inside [%]",
)
_EXPECTED = "As the fitted logs lead to expect"
PREDICTION = "Prediction"
"""title of a section"""
FROM_FIT = "The fit was made from this log."
_NOTES = {True: "Unseen: the fit was not made from this log.", False: FROM_FIT}
_BAND_NOTE = (
    "noise: standard deviation, estimated from the error on the fitted logs; the model's error there is part "
    "of it. expected error: rms, of this noise and of the parameters' uncertainty together. error: rms. "
    "further error: the part of the error that the expected one does not explain. inside: samples within the "
    "95 % band; 95 % are expected if the model is right, and slow noise may leave it for a while."
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
        fitted: whether the fit was made from this log; None: not known.
        arm: which moves in the page; None: it is not shown.
    """

    fit: str
    log: Log
    response: Array
    indices: Mapping[int, ErrorIndices]
    bands: Mapping[int, Band] = field(default_factory=dict[int, Band])
    fitted: bool | None = None
    arm: Arm | None = None

    @property
    def unseen(self) -> bool:
        """Whether the fit is known not to have seen the log."""
        return self.fitted is False

    @property
    def as_expected(self) -> bool | None:
        """Whether the error is no larger than the fitted logs lead to expect; None: a band is missing."""
        if any(band.model_limits for band in self.bands.values()):
            return False
        return True if self.bands and all(band.exists for band in self.bands.values()) else None

    @property
    def rms(self) -> float:
        """Rms error over all joints [deg]."""
        return degrees(math.sqrt(sum(i.rms**2 for i in self.indices.values()) / len(self.indices)))


def validation_page(results: Sequence[Validation], folds: Sequence[IdentifiedModel] = ()) -> Page:
    """Return the page of several fits on several logs; its table is `validation` (article, table 9)."""
    logs = {result.log.source: result.log for result in results}
    names = dict(zip(logs, log_names(list(logs.values())), strict=True))
    rows: list[tuple[Cell, ...]] = []
    band_rows: list[tuple[Cell, ...]] = []
    verdicts: list[str] = []
    for result, fit in zip(results, _fit_names(results), strict=True):
        name = names[result.log.source]
        for joint, indices in result.indices.items():
            rows.append((fit, name, joint, *index_cells(indices)))
            if band := result.bands.get(joint):
                band_rows.append((fit, name, joint, *_band_cells(band)))
                verdicts.append(f"{fit} on {name}, joint {joint}: {_verdict(band)}")
    table = Table(
        "Output error on given logs",
        ("fit", "log", "joint", *INDICES),
        tuple(rows),
        INDICES_NOTE,
        INDICES[:3:2],
    )
    responses = validation_responses(results)
    notes = {names[r.log.source]: _NOTES[r.unseen] for r in results if r.fitted is not None}
    verdict = _strip(results)
    tabs = sorted(response_tabs(responses, notes), key=lambda tab: tab.note != _NOTES[True])
    section = Section(PREDICTION, tabs=tuple(tabs), tables={"validation": table})
    bands = {"bands": Table(_BANDS, ("fit", "log", "joint", *_BAND_HEADER), tuple(band_rows), _BAND_NOTE)}
    limits = Section("Error that the fitted logs lead to expect", points=tuple(verdicts), more=bands)
    sections = [section, *([limits] if band_rows else []), *_motion(results, names, notes)]
    if folds:
        sections.append(Section("Without one log", tables={"folds": _fold_table(folds)}))
    numbers = {"kind": "validation", "errors": _errors(results, names)}
    return Page(
        "validation",
        "Validation",
        verdict.prediction,
        tuple(sections),
        data=response_data(responses),
        verdict=verdict,
        numbers=numbers,
    )


def _motion(
    results: Sequence[Validation], names: Mapping[str, str], notes: Mapping[str, str]
) -> tuple[Section, ...]:
    """The arm in motion as the best fit simulates it."""
    best = min(_rank(results).items(), key=lambda item: item[1])[0]
    shown = {names[r.log.source]: r for r in results if r.fit == best and r.arm is not None}
    movements = [Movement.of(name, r.log, tuple(r.indices), r.response) for name, r in shown.items()]
    arm = next((r.arm for r in shown.values()), None)
    if arm is None:
        return ()
    several = len({r.fit for r in results}) > 1
    of = f"Simulated by {best}, the fit with the lowest error. " if several else ""
    return motion_section(arm, movements, {name: f"{of}{notes.get(name, '')}".strip() for name in shown})


def validation_responses(results: Sequence[Validation]) -> dict[str, JointResponse]:
    """Return the responses of all fits to each record, by file name; only the best fit is shown at first.

    Fits that read a log with another delay or period were not compared with the same record.
    """
    logs = {result.log.source: result.log for result in results}
    names = dict(zip(logs, log_names(list(logs.values())), strict=True))
    order = sorted(range(len(results)), key=lambda i: _rank(results)[results[i].fit])
    fits = _fit_names(results)
    records: dict[object, tuple[JointResponse, dict[str, Array], dict[str, Array]]] = {}
    for i in order:
        result, log, name = results[i], results[i].log, names[results[i].log.source]
        for column, joint in enumerate(result.indices):
            command, measured = log.command[:, joint - 1], log.angle[:, joint - 1]
            simulated, halves = dict[str, Array](), dict[str, Array]()
            pressures = logged_pressures(log, joint - 1)
            response = JointResponse(
                name, joint, log.time, command, measured, simulated, halves, frozenset(), pressures
            )
            key = name, joint, measured.tobytes(), command.tobytes()
            _, simulated, halves = records.setdefault(key, (response, simulated, halves))
            fit = fits[i] if fits[i] not in simulated else unique(fits[i], simulated)
            simulated[fit] = result.response[:, column]
            if band := result.bands.get(joint):
                halves[fit] = band.half
    taken: set[str] = set()
    return {
        file_name(f"validation_{Path(one.log).stem}_joint_{one.joint}", taken): replace(
            one, off=frozenset(list(one.simulated)[1:])
        )
        for one, *_ in records.values()
    }


def _fit_names(results: Sequence[Validation]) -> list[str]:
    """Names of the fits as shown: numbered where several of one name are compared with one log."""
    taken: dict[str, list[str]] = {}
    return [
        _taken(unique(short_name(r.fit), names := taken.setdefault(r.log.source, [])), names) for r in results
    ]


def _taken(name: str, names: list[str]) -> str:
    names.append(name)
    return name


def _judged(results: Sequence[Validation]) -> list[Validation]:
    """Results on logs that the fits have not seen, or all where there is none."""
    return [result for result in results if result.unseen] or list(results)


def _rank(results: Sequence[Validation]) -> dict[str, float]:
    """Rms error of each fit on unseen logs, or on all where there is none [deg], the smallest first."""
    squares: dict[str, list[float]] = {}
    for result in _judged(results):
        squares.setdefault(result.fit, []).append(result.rms**2)
    errors = {fit: math.sqrt(sum(each) / len(each)) for fit, each in squares.items()}
    errors |= {result.fit: math.inf for result in results if result.fit not in errors}
    return dict(sorted(errors.items(), key=lambda item: item[1]))


def _strip(results: Sequence[Validation]) -> Verdict:
    """The verdict: the best fit's error on unseen logs, the others', and whether it is as expected."""
    judged, errors = _judged(results), _rank(results)
    logs = list(dict.fromkeys(result.log.source for result in judged))
    unseen = judged[0].unseen
    kind = "unseen log" if unseen else "log"
    which = f"{'an' if unseen else 'the'} {kind}" if len(logs) == 1 else f"{len(logs)} {kind}s"
    (best, error), *others = errors.items()
    prediction = f"{short_name(best)} predicts {which} with an error of {error:.2g}° rms."
    rest = [f"{short_name(name)} {value:.2g}°" for name, value in others]
    parameters = f"Others: {', '.join(rest)}." if rest else ""
    lights = [_seen_light(results)]
    if bands := [band for r in judged if r.fit == best for band in r.bands.values()]:
        outside = [band for band in bands if band.model_limits]
        lacking = sum(not band.exists for band in bands)
        inside = f"{min(100 * band.inside for band in bands):.0f} %"
        if outside:
            words = f"No: in {len(outside)} of {len(bands)} responses the error is clearly larger."
            lights.append(Light(_EXPECTED, "fair", words))
        elif lacking:
            words = f"Not known: {lacking} of {len(bands)} responses have no band; the fit leaves them open."
            lights.append(Light(_EXPECTED, "open", words))
        else:
            which = "" if len(bands) == 1 else "at least "
            words = f"Yes: {which}{inside} of the samples lie inside the band."
            lights.append(Light(_EXPECTED, "good", words))
    return Verdict(prediction, parameters, tuple(lights))


def _seen_light(results: Sequence[Validation]) -> Light:
    question = "Unseen logs"
    logs = {result.log.source: result for result in results}
    fresh = [name for name in logs if all(r.unseen for r in results if r.log.source == name)]
    if fresh:
        return Light(question, "good", f"{len(fresh)} of {len(logs)} logs were not fitted.")
    if any(result.fitted is None for result in results):
        return Light(question, "open", "Not known: the values are not from a run folder.")
    return Light(question, "fair", "None: the fits were made from these logs.")


def _errors(results: Sequence[Validation], names: Mapping[str, str]) -> list[dict[str, object]]:
    return [
        {
            "fit": r.fit,
            "log": names[r.log.source],
            "unseen": r.unseen,
            "rms_deg": finite(r.rms),
            "as_expected": r.as_expected,
        }
        for r in results
    ]


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
    """Compare the error with the expected one, which the error on the fitted logs need not make small."""
    if not band.exists:
        return f"The error is {degrees(band.error):.2g}°. There is no band: the fit leaves this angle open."
    inside = f"{100 * band.inside:.0f} % of the samples lie inside the band"
    error, expected = f"{degrees(band.error):.2g}°", f"{degrees(band.expected):.2g}°"
    than = f"than the fitted logs lead to expect ({expected}"
    if band.model_limits:
        chance = f"by chance {degrees(band.limit):.2g}° is exceeded in 5 % of logs"
        larger = f"The error ({error}) is clearly larger {than}; {chance})"
        return f"{inside}. {larger}: the model limits the prediction."
    larger = "no larger" if band.error <= band.expected else "not clearly larger"
    return f"{inside}: the error ({error}) is {larger} {than})."
