"""What logs determine at some parameters: intervals, directions, noise; a page and a section of a fit's."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.report.names import log_names
from hydroid.report.page import Page, Plot, Section
from hydroid.report.phrases import direction_phrases, profile_warnings, rank_phrase, status_phrase
from hydroid.report.plots import uncertainty as plots
from hydroid.report.table import Cell, Table, unless_nan
from hydroid.uncertainty.covariance import Uncertainty
from hydroid.uncertainty.directions import Identifiability
from hydroid.uncertainty.flags import WEAK_ABOVE
from hydroid.uncertainty.intervals import Profile

_SHOWN = 0.1
"""parts of a direction below this are left out of its row"""
_FEW_REFITS = 40
"""refits below which a 2.5 % quantile lies between the two lowest"""
_CAPTIONS = {
    "singular_values": "The inverse of the relative standard deviation of each combination, for noise as the "
    f"logs show it. Below the dashed line it is known to worse than {100 * WEAK_ABOVE:.0f} %; a hollow mark "
    "at the foot: the logs do not depend on it.",
    "directions": "Each column is one combination of relative changes, best determined first.",
    "correlation": "Near ±1 only a combination of the two parameters is known. Blank: not identifiable.",
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
    """

    problem: Problem
    source: str
    uncertainty: Uncertainty
    identifiability: Identifiability
    profiles: tuple[Profile, ...] = ()
    refits: Array | None = None


def uncertainty_page(study: UncertaintyStudy) -> Page:
    """Return the page of a study; its tables are `intervals`, `directions` and `noise`."""
    names = study.problem.parameters.names
    drawn: tuple[Plot, ...] = ()
    if study.profiles:
        draw = partial(plots.profiles, study.profiles, study.uncertainty, names)
        drawn = (Plot("profiles", _CAPTIONS["profiles"], draw),)
    intervals = Section("Intervals", tables={"intervals": interval_table(study)}, plots=drawn)
    determined = determined_section(study.problem, study.uncertainty, study.identifiability)
    lead = rank_phrase(study.identifiability)
    warnings = profile_warnings(study.profiles)
    return Page("identifiability", "What the logs determine", lead, (intervals, determined), warnings)


def determined_section(problem: Problem, uncertainty: Uncertainty, result: Identifiability) -> Section:
    """Return the section about directions and noise."""
    return Section(
        "Which combinations the logs determine",
        points=direction_phrases(problem, result),
        tables={"directions": direction_table(result), "noise": noise_table(problem, uncertainty)},
        plots=tuple(
            Plot(name, _CAPTIONS[name], draw)
            for name, draw in (
                ("singular_values", partial(plots.singular_values, result)),
                ("directions", partial(plots.directions, result)),
                ("correlation", partial(plots.correlation, uncertainty, result.names)),
            )
        ),
    )


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
        f"At {study.source}. 95 % intervals for noise as the logs show it there, as far as the model holds."
        " –: no limit. A parameter at a bound has none. Away from a fit the residual does not measure the "
        "noise: set objective.noise_deg."
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
        f"Relative changes of unit length. {result.rank} of {len(result.names)} directions have a standard "
        f"deviation of {100 * WEAK_ABOVE:.0f} % or less."
    )
    header = ("singular value", "standard deviation [%]", "relative changes")
    return Table("Directions", header, tuple(rows), note, header[:1])


def noise_table(problem: Problem, uncertainty: Uncertainty) -> Table:
    """Return the noise of every channel, and where it was taken from."""
    names = log_names([log.source for log in problem.logs])
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
        "correlation time: after it the noise's autocorrelation is below 1/e. effective sample size: number "
        "of independent samples that would determine its level as well."
    )
    return Table("Noise", ("log", "joint", "signal", *found), tuple(rows), note, ("rms residual", "source"))
