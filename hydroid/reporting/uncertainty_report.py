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
from hydroid.reporting.parameters_report import parameter_section
from hydroid.reporting.table import Table
from hydroid.run.record import ChannelNoise, channel_noise

_PROFILES = (
    "The error, in units of the noise, with one parameter held and the others fitted again. The interval is "
    "where it stays below the threshold."
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
        moved: the better optimum that all this is about, if a profile found one.
    """

    problem: Problem
    source: str
    uncertainty: Uncertainty
    identifiability: Identifiability
    profiles: tuple[Profile, ...] = ()
    moved: tuple[Finding, ...] = ()

    @cached_property
    def summary(self) -> FitSummary:
        """The parameters with their intervals, and the findings about them."""
        known = account(self.problem, self.uncertainty, self.identifiability)
        found = (*self.moved, *_profile_findings(self.profiles), *known.findings)
        return known.model_copy(update={"findings": found})

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """Of the profiled parameters."""
        return {profile.name: profile.interval for profile in self.profiles}


def _profile_findings(profiles: Sequence[Profile]) -> Iterator[Finding]:
    if better := tuple(profile.name for profile in profiles if profile.better_optimum):
        yield Finding("better optimum", "warning", better)
    for one in profiles:
        if one.bounded:
            yield Finding("profile bounded", "note", one.bounded, {"profile": one.name})


def uncertainty_page(study: UncertaintyStudy) -> Page:
    """Return the page of a study; its tables are `parameters`, `directions` and `noise`."""
    problem, summary = study.problem, study.summary
    rank, count = study.identifiability.rank, len(study.identifiability.names)
    lead = f"The logs determine {rank} combinations of {count} parameters to {100 * WEAK_ABOVE:.0f} %."
    profiles = (Plot("profiles", _PROFILES, partial(draw_profiles, study)),) if study.profiles else ()
    sections = (
        parameter_section(problem.settings, summary, study.intervals),
        *([Section("Profiles", plots=profiles)] if profiles else []),
        unknown_section(summary),
        *determined_sections(summary, channel_noise(problem, study.uncertainty), log_names(problem.logs)),
    )
    verdict = Verdict(lead, f"At {study.source}.")
    return Page(
        "identifiability", "What the logs determine", lead, sections, warnings(summary), verdict=verdict
    )


def warnings(summary: FitSummary) -> tuple[str, ...]:
    """Return what must be read before any use of the estimate."""
    return tuple(str(finding) for finding in summary.findings if finding.level != "note")


def unknown_section(summary: FitSummary) -> Section:
    """Return the section of all other findings."""
    points = tuple(str(finding) for finding in summary.findings if finding.level == "note")
    return Section("What is not known", "" if points else "The logs determine every free parameter.", points)


def determined_sections(
    summary: FitSummary, noise: Sequence[ChannelNoise], names: Sequence[str]
) -> Iterator[Section]:
    """Yield the folded sections on directions and noise; `names` are of the logs."""
    if summary.covariance is not None and summary.covariance.parameters:
        yield Section("Directions", tables={"directions": direction_table(summary.covariance)}, folded=True)
    yield Section("Noise", tables={"noise": noise_table(noise, names)}, folded=True)


def direction_table(known: Covariance) -> Table:
    """Return every direction with its standard deviation and its largest parts, best determined first."""
    _, singular, axes = np.linalg.svd(np.array(known.root))
    rows: list[tuple[float, str]] = []
    for value, axis in zip(singular.tolist(), axes, strict=True):
        order = np.argsort(-np.abs(axis), kind="stable")
        parts = [
            (known.parameters[i], axis[i] * np.sign(axis[order[0]])) for i in order if abs(axis[i]) >= 0.1
        ]
        text = ", ".join(f"{name} {part:+.2f}" for name, part in parts).replace("-", "−")
        rows.append((100 / value if value > 0 else np.inf, text))
    header = (
        "standard deviation [%]",
        "parameters that change together, in these proportions of their values",
    )
    return Table("", header, tuple(rows))


def noise_table(noise: Sequence[ChannelNoise], names: Sequence[str]) -> Table:
    """Return the noise of every channel, and where it was taken from."""
    rows = [
        {
            "log": names[one.log],
            "joint": one.joint,
            "signal": f"{one.signal} [{one.unit}]",
            "rms residual": one.residual,
            "noise, standard deviation": one.level,
            "correlation time [s]": one.correlation_s,
            "effective sample size": one.effective_samples,
            "source": one.source,
        }
        for one in noise
    ]
    return Table.of("", rows, optional=("rms residual", "source"))


def draw_profiles(study: UncertaintyStudy) -> Chart:
    """Draw the deviance around each profiled parameter's interval, with the linear approximation."""
    units = {p.name: p.unit for p in study.problem.parameters.parameters}
    panels: list[Panel] = []
    for profile in study.profiles:
        own, values, limit = study.summary.estimate[profile.name], profile.values, np.array([THRESHOLD])
        low, high = np.clip(profile.interval, values[0], values[-1]).tolist()
        margin = 0.3 * (high - low)  # drawn beyond each end
        fine = np.union1d(np.linspace(low - margin, high + margin, 201), values)
        fine = fine[(fine >= values[0]) & (fine <= values[-1])]
        # between its points the square root is taken for linear, as in the interval
        root = np.sqrt(np.maximum(profile.deviance, 0.0)) * np.sign(values - own.value)
        ends = np.array([[low], [high]])
        marks = [
            Mark("spans", ends[0], end=ends[1], color="sky", label="95 % interval", alpha=0.2),
            Mark("line", fine, np.interp(fine, values, root) ** 2, color="blue", label="profile"),
            Mark("points", values, profile.deviance, color="blue", width=6),
            Mark("rule", y=limit, color="orange", label="threshold of 95 %", width=1),
        ]
        if own.sd:
            line, label = ((fine - own.value) / own.sd) ** 2, "linear approximation"
            marks.append(Mark("line", fine, line, color="grey", label=label, width=1, look="dashed"))
        across = f"{profile.name} [{units[profile.name]}]"
        limits = min(-0.2, 1.2 * float(profile.deviance.min())), 2.5 * THRESHOLD
        around = (low - margin, high + margin)
        panels.append(Panel(across, "deviance", tuple(marks), "", 240, around, limits))
    return Chart(tuple(panels), columns=min(2, len(panels)))
