"""What the logs determine: the parameters, the directions of the posterior, and what a reader must know."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hydroid.estimate import Covariance, FitSummary, ParameterEstimate
from hydroid.parameters import Parameter
from hydroid.posterior.uncertainty import Flag, Source
from hydroid.quantity_table import CHOICES
from hydroid.reporting.page import Section
from hydroid.reporting.table import Given, Table
from hydroid.settings.fit import FitSettings
from hydroid.words import number

Intervals = Mapping[str, tuple[float, float]]


def parameter_section(settings: FitSettings, summary: FitSummary) -> Section:
    """Return the section with the table of all parameters."""
    text, free = "", {p.quantity for p in settings.parameters.values() if p.fixed is None}
    if settings.stage == "hyd" and "supply_pressure" not in free and not settings.objective.pressure_weight:
        supply = number(settings.hydraulics.supply_pressure)  # without pressures in the log only p A is known
        text = f"Areas, masses, torques and flows hold for the given supply of {supply} bar."
    return Section("Parameters", text, tables={"parameters": parameter_table(settings, summary)}, folded=True)


def parameter_table(settings: FitSettings, summary: FitSummary, profiles: Intervals | None = None) -> Table:
    """Return one row per parameter: bounds, estimate, intervals, share of the data, effect, flag.

    `profiles` are further intervals by parameter.
    """

    def row(p: Parameter) -> dict[str, Any]:
        one, given = summary.estimate[p.name], settings.parameters[p.name].bounds
        low, high = map(Given, given) if given else (p.lower, p.upper)
        ends = {"": one.interval, "by log ": one.interval_by_log}
        ends["profile "] = (profiles or {}).get(p.name, (None, None))
        return {
            "name": p.name,
            "what": _plain_name(settings, p.name),
            "unit": p.unit,
            "value": one.value,
            **({"lower": low, "upper": high} if low < high else {}),
            **{
                f"{of}{end}": v
                for of, pair in ends.items()
                for end, v in zip(("from", "to"), pair, strict=True)
            },
            "data [%]": None if one.data_share is None else 100 * one.data_share,
            "effect [deg]": one.effect_deg,
            "flag": status(one),
        }

    by_log = ("by log from", "by log to") if summary.left_out_deg else ()
    columns = ["name", "what", "unit", "lower", "upper", "value", "from", "to", *by_log]
    columns += [*(("profile from", "profile to") if profiles else ()), "data [%]", "effect [deg]", "flag"]
    note = (
        "from, to: 95 % interval; empty: no limit. data: share of the information from the logs. effect: rms "
        "change of the angles per 1 % of the parameter. by log: from the differences between logs."
    )
    optional = ("what", *by_log, "effect [deg]", "data [%]", "lower", "upper")
    rows = map(row, settings.parameter_set().parameters)
    return Table.of("Parameters", {name: name for name in columns}, rows, note, optional)


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


def warnings(summary: FitSummary) -> tuple[str, ...]:
    """Return what must be read before any use of the estimate, at most three things."""
    return tuple(str(finding) for finding in summary.findings if finding.level != "note")[:3]


def unknown_sections(summary: FitSummary) -> tuple[Section, ...]:
    """Return the section of all other findings; those after the first six stand with the directions."""
    first, known = warnings(summary), summary.covariance
    points = tuple(text for text in map(str, summary.findings) if text not in first)
    none = "" if points else "The logs determine every free parameter."
    sections = [Section("What is not known", none, points[:6])]
    if known is not None and known.parameters:
        tables = {"directions": direction_table(known)}
        sections.append(Section("Directions", points=points[6:], tables=tables, folded=True))
    return tuple(sections)


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
    header = ("standard deviation [%]", "parameters that change together, in proportion to their values")
    return Table("", header, tuple(rows))
