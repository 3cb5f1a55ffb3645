"""What logs determine at some parameters: intervals, directions, noise; a page and a section of a fit's."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hydroid.fitting.findings import log_findings
from hydroid.parameters import Array
from hydroid.posterior.by_log import by_log
from hydroid.posterior.covariance import Uncertainty
from hydroid.posterior.directions import Identifiability
from hydroid.posterior.flags import WEAK_ABOVE
from hydroid.posterior.intervals import THRESHOLD, Profile
from hydroid.problem.problem import Problem
from hydroid.report.by_log_report import by_log_table
from hydroid.report.chart import Chart, Mark, Panel
from hydroid.report.page import Page, Plot, Section, Verdict, log_names
from hydroid.report.parameter_bars import parameter_bar
from hydroid.report.phrases import direction_phrases, profile_warnings, rank_phrase, status_phrase
from hydroid.report.table import Cell, Table, unless_nan
from hydroid.report.verdict import uncertainty_lights
from hydroid.words import sentence

_SHOWN = 0.1
"""parts of a direction below this are left out of its row"""
_FEW_REFITS = 40
"""refits below which a 2.5 % quantile lies between the two lowest"""
_CORRELATED, _MOST_PAIRS = 0.5, 20
_PROFILE_MARGIN = 0.3
"""part of a profile's interval that is drawn beyond each end"""
_CAPTIONS = {
    "correlation": "Near ±1 only a combination of the two parameters is known. Parameters that are not "
    "identifiable are left out.",
    "profiles": "The error, in units of the noise, with one parameter held and the others fitted again. "
    "The interval is where it stays below the threshold; dashed: the linear approximation.",
}


@dataclass(frozen=True, eq=False)
class UncertaintyStudy:
    """What logs determine at some parameters.

    Attributes:
        problem: the logs and the model.
        source: where the parameters are from, in words.
        uncertainty: intervals there.
        identifiability: directions there.
        profiles: profile likelihoods, as far as they were asked for.
        refits: estimates of the bootstrap, shape (N, P); None where it was not asked for.
        moved: says that a better optimum was found, and that all this is about it; empty: it was not.
    """

    problem: Problem
    source: str
    uncertainty: Uncertainty
    identifiability: Identifiability
    profiles: tuple[Profile, ...] = ()
    refits: Array | None = None
    moved: str = ""


def uncertainty_page(study: UncertaintyStudy) -> Page:
    """Return the page of a study; its tables are `intervals`, `directions` and `noise`."""
    problem, found, result = study.problem, study.uncertainty, study.identifiability
    drawn = Plot("profiles", _CAPTIONS["profiles"], partial(draw_profiles, study))
    columns = problem.parameters.parameters, found.theta, found.interval, found.status
    bars = tuple(
        parameter_bar(p, problem.settings.parameters[p.name], float(value), ends, status)
        for p, value, ends, status in zip(*columns, strict=True)
    )
    intervals = Section(
        "Intervals",
        bars=bars,
        plots=(drawn,) if study.profiles else (),
        more={"intervals": interval_table(study)},
    )
    phrases = direction_phrases(problem, result)
    unknown = Section(
        "What is not known",
        "" if phrases else "Nothing: every direction is determined.",
        tuple(f"{phrase}." for phrase in phrases),
    )
    lead = rank_phrase(result)
    warnings = (
        *((study.moved,) if study.moved else ()),
        *profile_warnings(study.profiles),
        *map(sentence, log_findings(by_log(problem, found))),
    )
    verdict = Verdict(lead, f"At {study.source}.", uncertainty_lights(problem, found))
    sections = (intervals, unknown, *determined_sections(problem, found, result))
    return Page("identifiability", "What the logs determine", lead, sections, warnings, verdict=verdict)


def determined_sections(
    problem: Problem, uncertainty: Uncertainty, result: Identifiability
) -> tuple[Section, ...]:
    """Return the folded sections on directions, correlation (if there is any) and noise."""
    directions = Section(
        "Directions: which combinations are determined",
        tables={"directions": direction_table(result)},
        folded=True,
    )
    sections = [directions]
    if np.sum(_correlated(uncertainty)) > 1:
        pairs = {"correlation": correlation_table(uncertainty, result.names)}
        sections.append(Section("Correlation of the estimates", tables=pairs, folded=True))
    if (logs := by_log(problem, uncertainty)) is not None:
        tables = {"by_log": by_log_table(problem, uncertainty, logs)}
        sections.append(Section("Parameters log by log", tables=tables, folded=True))
    noise = Section("Noise", tables={"noise": noise_table(problem, uncertainty)}, folded=True)
    return (*sections, noise)


def interval_table(study: UncertaintyStudy) -> Table:
    """Return every parameter with its standard deviation, its 95 % intervals by each method, and its flag."""
    found, refits = study.uncertainty, study.refits
    profiles = {p.name: p.interval for p in study.profiles}
    header = ["name", "unit", "value", "standard deviation", "from", "to"]
    header += ["profile from", "profile to"] if profiles else []
    header += ["bootstrap from", "bootstrap to"] if refits is not None else []
    rows: list[tuple[Cell, ...]] = []
    for i, parameter in enumerate(study.problem.parameters.parameters):
        row: list[Cell] = [parameter.name, parameter.unit, float(found.theta[i])]
        row += [unless_nan(v) for v in (found.standard_deviation[i], *found.interval[i])]
        if profiles:
            row += [unless_nan(v) for v in profiles.get(parameter.name, (np.nan, np.nan))]
        if refits is not None:
            identifiable = np.isfinite(found.relative[i])
            ends = np.quantile(refits[:, i], [0.025, 0.975]) if identifiable else (-np.inf, np.inf)
            row += [unless_nan(v) for v in ends] if found.free[i] else [None, None]
        rows.append((*row, status_phrase(found.status[i])))
    note = (
        f"At {study.source}. 95 % intervals. The noise is taken from the residuals, and the intervals are "
        "only right if the model is right. A dash (–): no limit. A parameter at a bound has no interval. "
        "If these parameters are not a fit to these logs, the residuals are no measure of the noise: set "
        "objective.noise_deg."
    )
    if refits is not None:
        few = ", too few for 95 %: about their lowest and highest" if len(refits) < _FEW_REFITS else ""
        note += f" bootstrap: {len(refits)} refits{few}; – for a parameter that is not identifiable."
    return Table("What the logs determine", (*header, "flag"), tuple(rows), note, ("standard deviation",))


def direction_table(result: Identifiability) -> Table:
    """Return every direction with its standard deviation and its largest parts, best determined first."""
    rows: list[tuple[Cell, ...]] = []
    for value, axis in zip(result.singular, result.axes, strict=True):
        order = [i for i in np.argsort(-np.abs(axis), kind="stable") if abs(axis[i]) >= _SHOWN]
        parts = ", ".join(f"{result.names[i]} {axis[i]:+.2f}".replace("-", "−") for i in order)
        rows.append((float(value), 100 / value if value > 0 else np.inf, parts))
    note = (
        "A direction changes several parameters together. The relative changes give the proportions: A "
        "+0.8, B −0.4 means that B falls by 1 % when A grows by 2 %. A large standard deviation means that "
        f"the logs hardly show such a change. {result.rank} of {len(result.names)} directions have a "
        f"relative standard deviation of {100 * WEAK_ABOVE:.0f} % or less."
    )
    header = ("singular value", "standard deviation [%]", "relative changes")
    return Table("Directions", header, tuple(rows), note, header[:1])


def noise_table(problem: Problem, uncertainty: Uncertainty) -> Table:
    """Return the noise of every channel, and where it was taken from."""
    names = log_names(problem.logs)
    rows: list[tuple[Cell, ...]] = []
    for channel, noise in zip(problem.channels, uncertainty.noise, strict=True):
        angle = channel.quantity == "angle"
        factor = (np.degrees(1) if angle else 1e-5) / channel.weight
        residual = factor * float(np.sqrt(np.mean(uncertainty.jacobian.residual[channel.rows] ** 2)))
        signal = f"{channel.quantity.replace('_', ' ')} [{'deg' if angle else 'bar'}]"
        seconds = noise.correlation_time * problem.logs[channel.log].period
        found = residual, factor * noise.level, seconds, noise.effective_sample_size, noise.source
        rows.append((names[channel.log], channel.joint, signal, *found))
    found = "rms residual", "noise", "correlation time [s]", "effective sample size", "source"
    note = (
        "rms residual: of the measured minus the simulated signal. noise: standard deviation of the noise "
        "that the intervals use, and where it comes from (source): the residual, corrected for what the fit "
        "absorbed; the settings; or the smallest value allowed. correlation time: after it the noise's "
        "autocorrelation is below 1/e. effective sample size: the number of independent samples that would "
        "determine the noise level equally well."
    )
    return Table("Noise", ("log", "joint", "signal", *found), tuple(rows), note, ("rms residual", "source"))


def correlation_table(uncertainty: Uncertainty, names: Sequence[str]) -> Table:
    """Return the pairs of parameters whose estimates are clearly correlated, the strongest first."""
    values = np.triu(np.nan_to_num(uncertainty.correlation), 1)
    order = np.argsort(-np.abs(values), axis=None, kind="stable")[:_MOST_PAIRS]
    pairs = zip(*np.unravel_index(order, values.shape), strict=True)
    rows = tuple(
        (names[int(i)], names[int(j)], float(values[i, j]))
        for i, j in pairs
        if abs(values[i, j]) >= _CORRELATED
    )
    note = f"Pairs of {_CORRELATED} and above, at most {_MOST_PAIRS}. {_CAPTIONS['correlation']}"
    return Table("Correlated pairs", ("parameter", "with", "correlation"), rows, note)


def _correlated(uncertainty: Uncertainty) -> NDArray[np.bool_]:
    """Return the free parameters that are identifiable: the others have no correlation."""
    return np.isfinite(np.diag(uncertainty.correlation))


def draw_profiles(study: UncertaintyStudy) -> Chart:
    """Draw the deviance around each profiled parameter's interval, with the linear approximation."""
    uncertainty, parameters = study.uncertainty, study.problem.parameters
    panels: list[Panel] = []
    for profile in study.profiles:
        i = parameters.names.index(profile.name)
        centre, deviation = uncertainty.theta[i], uncertainty.standard_deviation[i]
        low, high = np.clip(profile.interval, profile.values[0], profile.values[-1])
        margin = _PROFILE_MARGIN * (high - low)
        ends = max(low - margin, profile.values[0]), min(high + margin, profile.values[-1])
        fine = np.union1d(np.linspace(*ends, 201), profile.values)
        # between its points the square root is taken for linear, as in the interval
        root = np.sqrt(np.maximum(profile.deviance, 0.0)) * np.sign(profile.values - centre)
        curve = np.interp(fine, profile.values, root) ** 2
        marks = [
            Mark(
                "spans", np.array([low]), end=np.array([high]), color="sky", label="95 % interval", alpha=0.2
            ),
            Mark("line", fine, curve, color="blue", label="profile"),
            Mark("points", profile.values, profile.deviance, color="blue", width=6),
            Mark("rule", y=np.array([THRESHOLD]), color="orange", label="threshold of 95 %", width=1),
        ]
        if np.isfinite(deviation) and deviation > 0:
            parabola = ((fine - centre) / deviation) ** 2
            marks.append(
                Mark(
                    "line", fine, parabola, color="grey", label="linear approximation", width=1, look="dashed"
                )
            )
        unit = parameters.parameters[i].unit
        across = f"{profile.name} [{unit}]" if unit else profile.name
        limits = min(-0.2, 1.2 * float(profile.deviance.min())), 2.5 * THRESHOLD
        panels.append(
            Panel(across, "deviance", tuple(marks), "", 240, (float(ends[0]), float(ends[1])), limits)
        )
    return Chart(tuple(panels), columns=min(2, len(panels)))
