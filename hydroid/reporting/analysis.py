"""The page of an analysis: what logs determine of the parameters at an estimate."""

from collections.abc import Mapping
from functools import partial

import numpy as np

from hydroid.estimate import FitSummary
from hydroid.files import Plain
from hydroid.posterior.identifiability import THRESHOLD, Profile
from hydroid.reporting.chart import Chart, Mark, Panel
from hydroid.reporting.correlation_report import correlation_section, correlation_table
from hydroid.reporting.knowledge_report import unknown_section, warnings
from hydroid.reporting.page import Page, Plot, Section
from hydroid.reporting.parameters_report import (
    known_of_free,
    parameter_section,
    prior_section,
    sentence,
)
from hydroid.settings.fit import FitSettings
from hydroid.settings.naming import named

_PROFILES = (
    "Each point holds the parameter and fits all others. The deviance says how much worse the fit is then; "
    "the 95 % interval is where it stays below the line. The intervals of the table assume a parabola."
)


def analysis_page(
    settings: FitSettings, summary: FitSummary, profiles: Mapping[str, Profile]
) -> Page:
    """Return the page; its tables are `parameters` and `correlations`."""
    sections = [
        unknown_section(settings, summary),
        profile_section(settings, profiles),
        prior_section(settings, summary),
        correlation_section(settings, summary),
        parameter_section(settings, summary),
    ]
    lead = f"Logs and priors together: {known_of_free(summary)}."
    warned = [sentence(finding, settings) for finding in warnings(summary)]
    matrix = correlation_table(summary)
    files = {} if matrix is None else {"correlations": matrix}
    return Page(
        "analysis",
        "Analysis",
        lead,
        sections=tuple(filter(None, sections)),
        warnings=tuple(warned),
        files=files,
    )


def profile_section(
    settings: FitSettings, profiles: Mapping[str, Profile]
) -> Section | None:
    """Return the section of profiles as curves, a tab for each; None without any."""
    tabs = list[Plot]()
    parameters = settings.parameter_set().parameters
    units = {parameter.name: parameter.unit for parameter in parameters}
    for name, profile in profiles.items():
        unit = units[name]
        label = f"{name} [{unit}]" if unit else name
        draw = partial(profile_chart, label, profile)
        caption = named(settings, name)
        tabs.append(Plot(f"profile_{len(tabs) + 1}", caption, draw, button=name))
    return Section("Profiles", _PROFILES, tabs=tuple(tabs)) if tabs else None


def profile_chart(label: str, profile: Profile) -> Chart:
    """Draw the deviance against the values of a parameter, and the line that ends its
    interval."""
    values, deviances = profile.points.T
    threshold = np.array([THRESHOLD])
    look: Plain = {"color": "blue", "label": "deviance"}
    marks = (
        Mark("rule", y=threshold, color="grey", label="end of the 95 % interval"),
        Mark("line", values, deviances, **look),
        Mark("points", values, deviances, width=6, **look),
    )
    # the ends of a profile may rise so far that the interval would not be seen
    highest = max(3.0 * THRESHOLD, 1.1 * float(np.median(deviances)))
    lowest = min(-0.5, float(deviances.min()))
    limits = (lowest, highest)
    panel = Panel(label, "deviance [-]", marks, height=260, y_limits=limits)
    return Chart((panel,))
