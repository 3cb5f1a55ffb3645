"""Parameters between their bounds, as bars and as a table."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from hydroid.estimate import FitSummary, ParameterEstimate
from hydroid.parameters import Parameter
from hydroid.posterior.flags import Flag, Source
from hydroid.reporting.names import plain_name
from hydroid.reporting.page import Bar, Section
from hydroid.reporting.phrases import estimate_meanings
from hydroid.reporting.table import Cell, Given, Table
from hydroid.settings.fit import FitSettings
from hydroid.words import number, plain

_STATES = {
    Flag.IDENTIFIABLE: "known",
    Flag.WEAK: "weak",
    Flag.UNIDENTIFIABLE: "unknown",
    Flag.NO_EFFECT: "unknown",
}
_PRIOR_REACH = 1.96
"""standard deviations of a prior that its interval reaches"""
_TEXT = (
    "Bar: from the lower to the upper bound. Orange: the estimate with its 95 % interval. Grey: its prior. "
    "Blue: other estimates of the search. Intervals are right only if the model is right."
)


def parameter_section(
    settings: FitSettings, summary: FitSummary, extra: Mapping[str, tuple[float, float]]
) -> Section:
    """Return the section with all parameters; `extra` are further intervals by parameter (profiles)."""
    text = f"{given_supply(settings)} {_TEXT}".strip()
    bars = tuple(
        parameter_bar(settings, p, summary.estimate[p.name], others(summary, p.name))
        for p in settings.parameter_set().parameters
    )
    table = parameter_table(settings, summary, extra)
    return Section("Parameters", text, bars=bars, more={"parameters": table})


def others(summary: FitSummary, name: str) -> list[float]:
    """Return the values of a parameter in the estimates that are not the final one and did not diverge."""
    estimates = summary.estimates.items()
    return [e.values[name] for key, e in estimates if key != summary.final and e.rms_deg is not None]


def given_supply(settings: FitSettings) -> str:
    """Say what rests on a supply pressure that is given: without pressures in the log only p A is known."""
    free = {p.quantity for p in settings.parameters.values() if p.fixed is None}
    if settings.stage != "hyd" or "supply_pressure" in free or settings.objective.pressure_weight > 0:
        return ""
    supply = number(settings.hydraulics.supply_pressure)
    return f"Areas, masses, torques and flows hold for the given supply of {supply} bar."


def parameter_bar(
    settings: FitSettings,
    parameter: Parameter,
    estimate: ParameterEstimate,
    dots: Sequence[float] = (),
    bounds: tuple[float, float] | None = None,
) -> Bar:
    """Return the bar of one parameter between its own or other bounds, with dots at other values."""
    low, high = bounds or (parameter.lower, parameter.upper)
    value = f"{number(estimate.value)} {parameter.unit}".rstrip()
    name = plain_name(settings, parameter.name)
    if estimate.flag == Flag.FIXED or not low < high:
        return Bar(parameter.name, name, value, state="fixed")

    def place(value: float) -> float:
        if parameter.log and low > 0:
            return float(np.clip(math.log(max(value, low) / low) / math.log(high / low), 0.0, 1.0))
        return float(np.clip((value - low) / (high - low), 0.0, 1.0))

    ends = [end for end in estimate.interval if end is not None]
    prior = parameter.prior
    return Bar(
        parameter.name,
        name,
        value,
        f"{number(ends[0])} to {number(ends[1])}" if len(ends) == 2 else "",
        (plain(float(f"{low:.3g}")), plain(float(f"{high:.3g}"))),
        status(estimate),
        _STATES.get(Flag(estimate.flag or Flag.IDENTIFIABLE), "known"),
        place(estimate.value),
        (place(ends[0]), place(ends[1])) if len(ends) == 2 else None,
        None if prior is None else (place(prior.value(-_PRIOR_REACH)), place(prior.value(_PRIOR_REACH))),
        tuple(place(dot) for dot in dots),
    )


def status(estimate: ParameterEstimate) -> str:
    """Say how well a parameter is known, in a few words; empty where its interval says it all."""
    flag, source = estimate.flag, estimate.source
    words = [
        flag or ""
        if flag != Flag.IDENTIFIABLE and (source != Source.PRIOR or flag == Flag.NO_EFFECT)
        else "",
        source or "" if source in (Source.BOTH, Source.PRIOR) else "",
        f"at {estimate.at_bound} bound" if estimate.at_bound else "",
    ]
    return ", ".join(filter(None, words))


def parameter_table(
    settings: FitSettings, summary: FitSummary, extra: Mapping[str, tuple[float, float]] | None = None
) -> Table:
    """Return one row per parameter: bounds, every estimate, intervals, share of the data, effect, flag."""
    names, rows = list(summary.estimates) or ["value"], list[tuple[Cell, ...]]()
    several = bool(summary.left_out_deg)
    for p in settings.parameter_set().parameters:
        one = summary.estimate[p.name]
        bounds: tuple[Cell, Cell] = (p.lower, p.upper) if p.lower < p.upper else (None, None)
        if given := settings.parameters[p.name].bounds:
            bounds = (Given(given[0]), Given(given[1]))
        values = [e.values[p.name] for e in summary.estimates.values()] or [one.value]
        logs = one.interval_by_log if several else ()
        profile = () if not extra else extra.get(p.name, (None, None))
        share = None if one.data_share is None else 100 * one.data_share
        judged = (one.sd, *one.interval, *logs, *profile, share, one.effect_deg)
        rows.append((p.name, p.unit, *bounds, *values, *judged, status(one)))
    by_log = ("by log from", "by log to") if several else ()
    profiles = ("profile from", "profile to") if extra else ()
    header = ("name", "unit", "lower", "upper", *names, "sd", "from", "to", *by_log, *profiles)
    header += ("data [%]", "effect [deg]", "flag")
    note = (
        f"{estimate_meanings(summary)} from, to: 95 % interval; empty: no limit, at a bound or held. data: "
        "share of the information that the logs gave. effect: rms change of the angles per "
        f"1 % of the parameter.{' by log: interval from the differences between logs.' if several else ''}"
    )
    optional = (*(n for n in names[1:] if n != summary.final), "sd", *by_log, "effect [deg]", "data [%]")
    optional += (*(names[:1] if names[0] != summary.final else ()), "lower", "upper")
    return Table("Parameters", header, tuple(rows), note, optional)
