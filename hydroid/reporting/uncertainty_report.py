"""What logs determine at some parameters: what is to be said about it, and sections of pages."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hydroid.estimate import Covariance, FitSummary
from hydroid.findings import Finding
from hydroid.fitting.summary import account
from hydroid.posterior.directions import Identifiability
from hydroid.posterior.profile import Profile
from hydroid.posterior.uncertainty import Uncertainty
from hydroid.problem.problem import Problem
from hydroid.reporting.page import Section
from hydroid.reporting.table import Table


@dataclass(frozen=True, eq=False)
class UncertaintyStudy:
    """What logs determine at some parameters.

    Attributes:
        problem: the logs and the model.
        source: where the parameters are from, in words.
        uncertainty: intervals there.
        identifiability: directions there.
        profiles: profile likelihoods, as far as they were asked for.
    """

    problem: Problem
    source: str
    uncertainty: Uncertainty
    identifiability: Identifiability
    profiles: tuple[Profile, ...] = ()

    @cached_property
    def summary(self) -> FitSummary:
        """The parameters with their intervals, and the findings about them."""
        known = account(self.problem, self.uncertainty, self.identifiability)
        better = tuple(profile.name for profile in self.profiles if profile.better_optimum)
        found = (*([Finding("better optimum", "warning", better)] if better else []), *known.findings)
        return known.model_copy(update={"findings": found})

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """Of the profiled parameters."""
        return {profile.name: profile.interval for profile in self.profiles}


_MOST = 3
"""warnings that stand at the top of a page and in a terminal; the others stand below"""


def warnings(summary: FitSummary) -> tuple[str, ...]:
    """Return what must be read before any use of the estimate, at most three things."""
    return tuple(str(finding) for finding in summary.findings if finding.level != "note")[:_MOST]


def unknown_section(summary: FitSummary) -> Section:
    """Return the section of all other findings."""
    first, everything = warnings(summary), map(str, summary.findings)
    points = tuple(text for text in everything if text not in first)
    return Section("What is not known", "" if points else "The logs determine every free parameter.", points)


def direction_section(summary: FitSummary) -> tuple[Section, ...]:
    """Return the folded section on directions; none where no parameter is free."""
    if summary.covariance is None or not summary.covariance.parameters:
        return ()
    return (Section("Directions", tables={"directions": direction_table(summary.covariance)}, folded=True),)


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
