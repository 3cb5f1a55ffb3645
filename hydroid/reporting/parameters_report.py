"""The parameters of a fit: their table, in words, and what the logs made of their
priors."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from hydroid.arrays import Array
from hydroid.estimate import FitSummary, ParameterEstimate
from hydroid.findings import Finding
from hydroid.parameters import Parameter, Prior
from hydroid.posterior.uncertainty import Flag, Source
from hydroid.reporting.chart import Chart, Mark, Panel
from hydroid.reporting.page import Cell, Given, Plot, Section, Table
from hydroid.settings.fit import FitSettings
from hydroid.settings.naming import named, place, quantity_and_side
from hydroid.words import interval_words, listed, number

ENDS = ("from", "to", "by log from", "by log to", "profile from", "profile to")
FARTHEST = 5.0
"""standard deviations of the prior up to which a posterior is drawn"""
MOST_ALIKE = 3
"""parameters of the same words that a sentence names"""
ROW = 16
"""height of a parameter's row in a chart [px]"""
Intervals = Mapping[str, tuple[float, float]]

_NOTE = (
    "from, to: 95 % interval; empty: no limit. data: share of the information from the logs. by log: from "
    "the differences between logs."
)
_PRIORS = (
    "What was known before the logs, and what they made of it: bars are 95 % intervals, points the "
    "estimates. A bar as wide as the grey band has learnt nothing."
)


def parameter_section(
    settings: FitSettings, summary: FitSummary, *points: str
) -> Section:
    """Return the section of all parameters. `points` are said first.

    It stands on paper even where it is folded.
    """
    text = ""
    free = {p.quantity for p in settings.parameters.values() if p.fixed is None}
    supplied = "supply_pressure" in free or settings.objective.pressure_weight
    if settings.stage == "hyd" and not supplied:
        # without pressures in the log only p A is known
        supply = number(settings.hydraulics.supply_pressure)
        text = f"Areas, masses, torques and flows hold for the given supply of {supply} bar."
    tables = {"parameters": short_table(settings, summary)}
    answer = known_of_free(summary)
    return Section(
        "Parameters", text, points, tables, folded=True, answer=answer, printed=True
    )


def known_of_free(summary: FitSummary) -> str:
    """Say how many of the free parameters have an interval."""
    free = [one for one in summary.estimate.values() if one.flag != Flag.FIXED]
    known = sum(one.sd is not None for one in free)
    return f"{known} of {len(free)} free parameters have an interval"


def prior_section(settings: FitSettings, summary: FitSummary) -> Section | None:
    """Return the section of what the logs made of the priors.

    None where no parameter has an interval.
    """
    known = [one for one in summary.estimate.values() if one.sd is not None]
    if not known:
        return None
    by_data = sum(one.source == Source.DATA for one in known)
    plot = Plot("priors", _PRIORS, partial(prior_chart, settings, summary))
    answer = f"{by_data} of {len(known)} known from the logs"
    return Section("Prior and posterior", plots=(plot,), folded=True, answer=answer)


def short_table(settings: FitSettings, summary: FitSummary) -> Table:
    """Return one line per parameter for a reader: `parameter_table` has bounds and more
    digits."""
    by_log = ("by log",) if summary.left_out_deg else ()
    header = (
        "joint",
        "side",
        "quantity",
        "symbol",
        "value",
        "unit",
        "interval",
        *by_log,
        "source",
    )
    rows = list[tuple[Cell, ...]]()
    for name, one in summary.estimate.items():
        what, side = quantity_and_side(settings, name)
        said = place(settings, name), side, what, name
        logs = (interval_words(*one.interval_by_log),) if by_log else ()
        share = ""
        if one.source == Source.BOTH and one.data_share:
            share = f" ({100 * one.data_share:.0f} %)"
        rows.append(
            (
                *said,
                one.value,
                one.unit,
                interval_words(*one.interval),
                *logs,
                origin(one) + share,
            )
        )
    note = "interval: of 95 %; by log: the same, from the differences between logs."
    return Table("Parameters", header, tuple(rows), note)


def parameter_table(
    settings: FitSettings, summary: FitSummary, profiles: Intervals | None = None
) -> Table:
    """Return one row per parameter: what it is, estimate, intervals, bounds, and what
    it is known from.
    """

    def row(p: Parameter) -> dict[str, Any]:
        one = summary.estimate[p.name]
        own = settings.parameters[p.name]
        low, high = map(Given, own.bounds) if own.bounds else (p.lower, p.upper)
        ends = (
            *one.interval,
            *one.interval_by_log,
            *(profiles or {}).get(p.name, (None, None)),
        )
        what, side = quantity_and_side(settings, p.name)
        return {
            "joint": place(settings, p.name),
            "side": side,
            "quantity": what,
            "symbol": p.name,
            "value": one.value,
            "unit": p.unit,
            **({"lower": low, "upper": high} if low < high else {}),
            **dict(zip(ENDS, ends, strict=True)),
            "data [%]": None if one.data_share is None else 100 * one.data_share,
            "source": origin(one),
        }

    by_log = ENDS[2:4] if summary.left_out_deg else ()
    columns = [
        "joint",
        "side",
        "quantity",
        "symbol",
        "value",
        "unit",
        *ENDS[:2],
        *by_log,
    ]
    columns += [*(ENDS[4:] if profiles else ()), "lower", "upper", "data [%]", "source"]
    optional = ("quantity", "side", "joint", *by_log, "data [%]", "lower", "upper")
    rows = map(row, settings.parameter_set().parameters)
    return Table.of(
        "Parameters", {name: name for name in columns}, rows, _NOTE, optional
    )


def in_words(finding: Finding, settings: FitSettings) -> Finding:
    """Return a finding that names parameters in words.

    Those of the same words are named together.
    """
    groups = dict[str, list[str]]()
    details = dict(finding.details)
    for name in finding.subjects:
        key = (
            quantity_and_side(settings, name)[0]
            if name in settings.parameters
            else name
        )
        groups.setdefault(key, []).append(name)
    subjects = list[str]()
    for what, names in groups.items():
        if names == [what]:  # no parameter
            subjects.append(what)
        elif len(names) == 1:
            subjects.append(named(settings, names[0], details.pop(names[0], "")))
        else:
            said = [
                f"{name}: {details.pop(name)}" if name in details else name
                for name in names
            ]
            subjects.append(f"{what} ({listed(said, MOST_ALIKE)})")
    return replace(finding, subjects=tuple(subjects), details=details)


def status(estimate: ParameterEstimate) -> str:
    """Say how well a parameter is known, in a few words; empty where its interval says
    it all."""
    flag = estimate.flag
    source = estimate.source
    plain = flag == Flag.IDENTIFIABLE or (
        source == Source.PRIOR and flag != Flag.NO_EFFECT
    )
    words = (
        "" if plain else flag,
        source if source in (Source.BOTH, Source.PRIOR) else "",
        f"at {estimate.at_bound} bound" if estimate.at_bound else "",
    )
    return ", ".join(filter(None, words))


def origin(estimate: ParameterEstimate) -> str:
    """Say what a parameter is known from, and how well: data, for one that the logs
    determine."""
    said = status(estimate)
    return said or estimate.source or ""


def prior_chart(settings: FitSettings, summary: FitSummary) -> Chart:
    """Draw the posterior of each parameter in standard deviations of its prior.

    Those without a prior are drawn between their bounds.
    """
    with_prior = list[Parameter]()
    without = list[Parameter]()
    for parameter in settings.parameter_set().parameters:
        if summary.estimate[parameter.name].sd is not None:
            (without if parameter.prior is None else with_prior).append(parameter)
    panels = list[Panel]()
    if with_prior:
        scores = [
            _score(summary.estimate[p.name], p.prior)
            for p in with_prior
            if p.prior is not None
        ]
        x = "standard deviations from the prior's value"
        expected = Mark(
            "spans",
            np.array([-1.96]),
            end=np.array([1.96]),
            color="pale",
            label="prior, 95 %",
        )
        panels.append(
            _bars(
                "Beside their priors",
                x,
                with_prior,
                np.array(scores),
                replace(expected, alpha=0.6),
            )
        )
    if without:
        places = [_position(summary.estimate[p.name], p) for p in without]
        x = "lower bound: 0; upper bound: 1"
        panels.append(
            _bars("Without a prior: between their bounds", x, without, np.array(places))
        )
    return Chart(tuple(panels))


def _score(one: ParameterEstimate, prior: Prior) -> list[float]:
    """Return estimate and ends of the interval in standard deviations from the prior's
    value."""
    least = 1e-12 * abs(prior.nominal)  # a logarithm needs more than 0
    low, high = one.interval
    values = [
        prior.score(np.array(max(value, least) if prior.log else value))
        if value is not None
        else end
        for value, end in ((one.value, 0.0), (low, -FARTHEST), (high, FARTHEST))
    ]
    return [float(np.clip(value, -FARTHEST, FARTHEST)) for value in values]


def _position(one: ParameterEstimate, parameter: Parameter) -> list[float]:
    """Return estimate and ends of the interval on the parameter's scale between its
    bounds."""
    low, high = one.interval
    ends = [
        parameter.lower if low is None else low,
        parameter.upper if high is None else high,
    ]
    values = np.clip([one.value, *ends], parameter.lower, parameter.upper)
    return parameter.position(values).tolist()


def _bars(
    title: str, x: str, parameters: list[Parameter], rows: Array, *behind: Mark
) -> Panel:
    """Draw estimates and the ends of their intervals, shape (n, 3), each in a row."""
    at = np.arange(float(len(rows)))
    marks = (
        *behind,
        Mark(
            "bars",
            rows[:, 1],
            at,
            rows[:, 2],
            color="blue",
            label="posterior, 95 %",
            alpha=0.5,
        ),
        Mark("points", rows[:, 0], at, color="blue", width=5, label="estimate"),
    )
    height = 70 + ROW * len(rows)
    return Panel(x, "", marks, title, height, rows=tuple(p.name for p in parameters))
