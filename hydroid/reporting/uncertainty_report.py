"""What logs determine at some parameters: the page of an analysis, and sections of a fit's."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from hydroid.estimate import Covariance, FitSummary
from hydroid.findings import Finding
from hydroid.fitting.summary import account
from hydroid.posterior.covariance import Uncertainty
from hydroid.posterior.directions import Identifiability
from hydroid.posterior.flags import WEAK_ABOVE
from hydroid.posterior.profile import THRESHOLD, Profile
from hydroid.problem.problem import Problem
from hydroid.reporting.chart import Chart, Mark, Panel
from hydroid.reporting.page import Page, Plot, Section, Verdict, log_names
from hydroid.reporting.parameters_report import parameter_section, parameter_table
from hydroid.reporting.table import Cell, Table
from hydroid.run.record import ChannelNoise, channel_noise
from hydroid.words import sentence

_SHOWN = 0.1
"""parts of a direction below this are left out of its row"""
_CORRELATED, _MOST_PAIRS = 0.5, 20
_PROFILE_MARGIN = 0.3
"""part of a profile's interval that is drawn beyond each end"""
_PROFILES = (
    "The error, in units of the noise, with one parameter held and the others fitted again. The interval is "
    "where it stays below the threshold; dashed: the linear approximation."
)


@dataclass(frozen=True, eq=False)
class UncertaintyStudy:
    """What logs determine at some parameters.

    Attributes:
        problem: the logs and the model.
        source: where the parameters are from, in words.
        uncertainty: intervals there.
        identifiability: directions there.
        profiles: profile likelihoods, as far as they were asked for.
        moved: says that a better optimum was found, and that all this is about it; empty: it was not.
    """

    problem: Problem
    source: str
    uncertainty: Uncertainty
    identifiability: Identifiability
    profiles: tuple[Profile, ...] = ()
    moved: str = ""

    @cached_property
    def summary(self) -> FitSummary:
        """The parameters with their intervals, and the findings about them."""
        known = account(self.problem, self.uncertainty, self.identifiability)
        return known.model_copy(update={"findings": (*profile_findings(self.profiles), *known.findings)})

    @property
    def table(self) -> Table:
        """Every parameter with its intervals by each method."""
        extra = {p.name: p.interval for p in self.profiles}
        return parameter_table(self.problem.settings, self.summary, extra)


def profile_findings(profiles: Sequence[Profile]) -> Iterator[Finding]:
    """Yield which profiles fit better than the estimate somewhere, and which hang on a bound."""
    if better := tuple(profile.name for profile in profiles if profile.better_optimum):
        yield Finding("better optimum", "warning", better)
    for one in profiles:
        if one.bounded:
            yield Finding("profile bounded", "note", one.bounded, {"profile": one.name})


def uncertainty_page(study: UncertaintyStudy) -> Page:
    """Return the page of a study; its tables are `parameters`, `directions`, `correlation` and `noise`."""
    problem, summary = study.problem, study.summary
    drawn = Plot("profiles", _PROFILES, partial(draw_profiles, study))
    profiles = (Section("Profiles", plots=(drawn,)),) if study.profiles else ()
    extra = {p.name: p.interval for p in study.profiles}
    points = tuple(sentence(f) for f in summary.findings if f.level == "note")
    warnings = [study.moved, *(sentence(f) for f in summary.findings if f.level != "note")]
    rank, count = study.identifiability.rank, len(study.identifiability.names)
    lead = f"The logs determine {rank} combinations of {count} parameters to {100 * WEAK_ABOVE:.0f} %."
    noise = channel_noise(problem, study.uncertainty)
    sections = (
        parameter_section(problem.settings, summary, extra),
        *profiles,
        Section("What is not known", "" if points else "The logs determine every free parameter.", points),
        *determined_sections(summary, noise, log_names(problem.logs)),
    )
    verdict, title = Verdict(lead, f"At {study.source}."), "What the logs determine"
    return Page("identifiability", title, lead, sections, tuple(filter(None, warnings)), verdict=verdict)


def determined_sections(
    summary: FitSummary, noise: Sequence[ChannelNoise], names: Sequence[str]
) -> tuple[Section, ...]:
    """Return the folded sections on directions and noise; `names` are of the logs."""
    tables = {"noise": noise_table(noise, names)}
    sections = [Section("Noise", tables=tables, folded=True)]
    if summary.covariance is not None and summary.covariance.parameters:
        tables = {"directions": direction_table(summary.covariance)}
        if (pairs := correlation_table(summary)).rows:
            tables["correlation"] = pairs
        sections.insert(0, Section("Directions", tables=tables, folded=True))
    return tuple(sections)


def direction_table(known: Covariance) -> Table:
    """Return every direction with its standard deviation and its largest parts, best determined first."""
    _, singular, axes = np.linalg.svd(np.array(known.root))
    axes *= np.where(axes[np.arange(len(axes)), np.argmax(np.abs(axes), axis=1)] < 0, -1.0, 1.0)[:, None]
    rows: list[tuple[Cell, ...]] = []
    for value, axis in zip(singular, axes, strict=True):
        order = [i for i in np.argsort(-np.abs(axis), kind="stable") if abs(axis[i]) >= _SHOWN]
        parts = ", ".join(f"{known.parameters[i]} {axis[i]:+.2f}".replace("-", "−") for i in order)
        rows.append((100 / float(value) if value > 0 else np.inf, parts))
    note = "A direction changes several parameters together, in these proportions of their values."
    return Table("Directions", ("standard deviation [%]", "relative changes"), tuple(rows), note)


def correlation_table(summary: FitSummary) -> Table:
    """Return the pairs of parameters whose estimates are clearly correlated, the strongest first."""
    assert summary.covariance is not None
    names = summary.covariance.parameters
    inverse = np.linalg.pinv(np.array(summary.covariance.root))
    deviation = np.linalg.norm(inverse, axis=1)
    known = np.array([summary.estimate[name].sd is not None for name in names]) & (deviation > 0)
    scaled = inverse[known] / deviation[known, None]
    values = np.triu(scaled @ scaled.T, 1)
    names = [name for name, one in zip(names, known, strict=True) if one]
    order = np.argsort(-np.abs(values), axis=None, kind="stable")[:_MOST_PAIRS]
    pairs = [divmod(int(k), max(len(names), 1)) for k in order]
    rows = tuple(
        (names[i], names[j], float(values[i, j])) for i, j in pairs if abs(values[i, j]) >= _CORRELATED
    )
    note = "Near ±1 the logs determine only a combination of the two."
    return Table("Correlated pairs", ("parameter", "with", "correlation"), rows, note)


def noise_table(noise: Sequence[ChannelNoise], names: Sequence[str]) -> Table:
    """Return the noise of every channel, and where it was taken from."""
    rows = tuple(
        (
            names[one.log],
            one.joint,
            f"{one.signal} [{one.unit}]",
            *(one.residual, one.level, one.correlation_s, one.effective_samples, one.source),
        )
        for one in noise
    )
    found = "rms residual", "noise", "correlation time [s]", "effective sample size", "source"
    note = "noise: the standard deviation that the intervals use; source: where it comes from."
    return Table("Noise", ("log", "joint", "signal", *found), rows, note, ("rms residual", "source"))


def draw_profiles(study: UncertaintyStudy) -> Chart:
    """Draw the deviance around each profiled parameter's interval, with the linear approximation."""
    parameters = {p.name: p for p in study.problem.parameters.parameters}
    panels: list[Panel] = []
    for profile in study.profiles:
        own = study.summary.estimate[profile.name]
        low, high = np.clip(profile.interval, profile.values[0], profile.values[-1])
        margin = _PROFILE_MARGIN * (high - low)
        ends = max(low - margin, profile.values[0]), min(high + margin, profile.values[-1])
        fine = np.union1d(np.linspace(*ends, 201), profile.values)
        # between its points the square root is taken for linear, as in the interval
        root = np.sqrt(np.maximum(profile.deviance, 0.0)) * np.sign(profile.values - own.value)
        curve = np.interp(fine, profile.values, root) ** 2
        interval = np.array([low]), np.array([high])
        marks = [
            Mark("spans", interval[0], end=interval[1], color="sky", label="95 % interval", alpha=0.2),
            Mark("line", fine, curve, color="blue", label="profile"),
            Mark("points", profile.values, profile.deviance, color="blue", width=6),
            Mark("rule", y=np.array([THRESHOLD]), color="orange", label="threshold of 95 %", width=1),
        ]
        if own.sd:
            line = ((fine - own.value) / own.sd) ** 2
            look = {"color": "grey", "label": "linear approximation", "width": 1, "look": "dashed"}
            marks.append(Mark("line", fine, line, **look))  # pyright: ignore[reportArgumentType]
        unit = parameters[profile.name].unit
        limits = min(-0.2, 1.2 * float(profile.deviance.min())), 2.5 * THRESHOLD
        across = f"{profile.name} [{unit}]" if unit else profile.name
        panel = Panel(across, "deviance", tuple(marks), "", 240, (float(ends[0]), float(ends[1])), limits)
        panels.append(panel)
    return Chart(tuple(panels), columns=min(2, len(panels)))
