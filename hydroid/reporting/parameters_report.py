"""Parameters between their bounds, as bars and as a table."""

from collections.abc import Mapping

import numpy as np

from hydroid.estimate import FitSummary, ParameterEstimate
from hydroid.parameters import Parameter
from hydroid.posterior.flags import Flag, Source
from hydroid.posterior.posterior import NORMAL
from hydroid.quantity_table import CHOICES
from hydroid.reporting.page import Bar, Section
from hydroid.reporting.table import Cell, Given, Table
from hydroid.settings.fit import FitSettings
from hydroid.words import number, plain

Intervals = Mapping[str, tuple[float, float]]


def parameter_section(
    settings: FitSettings, summary: FitSummary, profiles: Intervals | None = None
) -> Section:
    """Return the section with all parameters that the fit estimates as bars, and with all in its table.

    `profiles` are further intervals by parameter.
    """
    text = "Bar: from bound to bound. Orange: the estimate and its 95 % interval. Grey: its prior."
    free = {p.quantity for p in settings.parameters.values() if p.fixed is None}
    if settings.stage == "hyd" and "supply_pressure" not in free and not settings.objective.pressure_weight:
        supply = number(settings.hydraulics.supply_pressure)  # without pressures in the log only p A is known
        text = f"Areas, masses, torques and flows hold for the given supply of {supply} bar. {text}"
    bars = tuple(
        _bar(settings, p, summary.estimate[p.name])
        for p in settings.parameter_set().parameters
        if p.lower < p.upper and summary.estimate[p.name].flag != Flag.FIXED
    )
    tables = {"parameters": parameter_table(settings, summary, profiles)}
    return Section("Parameters", text, bars=bars, more=tables)


def _bar(settings: FitSettings, parameter: Parameter, estimate: ParameterEstimate) -> Bar:
    low, high, prior = parameter.lower, parameter.upper, parameter.prior

    def place(value: float) -> float:
        return float(parameter.position(np.clip(value, low, high)))

    ends = [end for end in estimate.interval if end is not None]
    known = len(ends) == 2
    return Bar(
        parameter.name,
        _plain_name(settings, parameter.name),
        f"{number(estimate.value)} {parameter.unit}".rstrip(),
        " to ".join(map(number, ends)) if known else "",
        (plain(float(f"{low:.3g}")), plain(float(f"{high:.3g}"))),
        status(estimate),
        place(estimate.value),
        (place(ends[0]), place(ends[1])) if known else None,
        None if prior is None else (place(prior.value(-NORMAL)), place(prior.value(NORMAL))),
    )


def _plain_name(settings: FitSettings, parameter: str) -> str:
    """Say in plain words what a parameter is, and where it acts if several joints are compared."""
    own = settings.parameters[parameter]
    plain = CHOICES[own.quantity].plain
    if own.link is not None:
        return f"{plain} of {own.link}"
    joints = [] if len(settings.outputs) == 1 else own.joints or []
    return f"{plain}, {settings.arm.joint_names[joints[0] - 1]}" if len(joints) == 1 else plain


def status(estimate: ParameterEstimate) -> str:
    """Say how well a parameter is known, in a few words; empty where its interval says it all."""
    flag, source = estimate.flag, estimate.source
    words = (
        "" if flag == Flag.IDENTIFIABLE or (source == Source.PRIOR and flag != Flag.NO_EFFECT) else flag,
        source if source in (Source.BOTH, Source.PRIOR) else "",
        f"at {estimate.at_bound} bound" if estimate.at_bound else "",
    )
    return ", ".join(filter(None, words))


def parameter_table(settings: FitSettings, summary: FitSummary, profiles: Intervals | None = None) -> Table:
    """Return one row per parameter: bounds, estimate, intervals, share of the data, effect, flag."""
    several = bool(summary.left_out_deg)

    def row(p: Parameter) -> dict[str, Cell]:
        one, given = summary.estimate[p.name], settings.parameters[p.name].bounds
        bounds = (Given(given[0]), Given(given[1])) if given else (p.lower, p.upper)
        low, high = bounds if bounds[0] < bounds[1] else (None, None)
        cells: dict[str, Cell] = {
            "name": p.name,
            "unit": p.unit,
            "lower": low,
            "upper": high,
            "value": one.value,
        }
        intervals = {"": one.interval} | ({"by log ": one.interval_by_log} if several else {})
        intervals |= {"profile ": profiles.get(p.name, (None, None))} if profiles else {}
        for of, (start, end) in intervals.items():
            cells |= {f"{of}from": start, f"{of}to": end}
        share = None if one.data_share is None else 100 * one.data_share
        return cells | {"data [%]": share, "effect [deg]": one.effect_deg, "flag": status(one)}

    note = (
        "from, to: 95 % interval; empty: no limit. data: share of the information from the logs. effect: rms "
        "change of the angles per 1 % of the parameter."
        f"{' by log: interval from the differences between logs.' if several else ''}"
    )
    by_log = ("by log from", "by log to") if several else ()
    optional = (*by_log, "effect [deg]", "data [%]", "lower", "upper")
    return Table.of("Parameters", map(row, settings.parameter_set().parameters), note, optional)
