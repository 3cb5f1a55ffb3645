"""What the logs determine: parameters, directions of the posterior, quantities; what a reader must know."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hydroid.estimate import CurveEstimate, FitSummary, ParameterEstimate
from hydroid.fitting.speed_curve import measured_speeds
from hydroid.log import Log
from hydroid.log.command_sizes import LEAST_COMMAND
from hydroid.parameters import Parameter
from hydroid.posterior.uncertainty import Flag, Source
from hydroid.quantity_table import CHOICES
from hydroid.reporting.chart import Chart, Mark, Panel
from hydroid.reporting.page import Cell, Given, Plot, Section, Table
from hydroid.run.record import Record
from hydroid.settings.fit import FitSettings
from hydroid.words import listed, number, two_digits

BEST_WITHIN = 0.3  # half of a 95 % interval, relative to the value, up to which a property counts as known
LEAST_WEIGHT = 5.0  # samples at a command from which its mean speed is drawn
ENDS = ("from", "to", "by log from", "by log to", "profile from", "profile to")
SPREAD = ("name", "unit", "median", "lowest", "lower_quartile", "upper_quartile", "highest", "flag")
Intervals = Mapping[str, tuple[float, float]]


def parameter_section(settings: FitSettings, summary: FitSummary) -> Section:
    """Return the section with the table of all parameters."""
    text, free = "", {p.quantity for p in settings.parameters.values() if p.fixed is None}
    if settings.stage == "hyd" and "supply_pressure" not in free and not settings.objective.pressure_weight:
        supply = number(settings.hydraulics.supply_pressure)  # without pressures in the log only p A is known
        text = f"Areas, masses, torques and flows hold for the given supply of {supply} bar."
    return Section("Parameters", text, tables={"parameters": parameter_table(settings, summary)}, folded=True)


def parameter_table(settings: FitSettings, summary: FitSummary, profiles: Intervals | None = None) -> Table:
    """Return one row per parameter: bounds, estimate, intervals, share of the data, flag."""

    def row(p: Parameter) -> dict[str, Any]:
        one, own = summary.estimate[p.name], settings.parameters[p.name]
        low, high = map(Given, own.bounds) if own.bounds else (p.lower, p.upper)
        what = CHOICES[own.quantity].plain
        if own.link is not None:
            what += f" of {own.link}"
        elif len(settings.outputs) > 1 and own.joints and len(own.joints) == 1:  # where it acts
            what += f", {settings.arm.joint_names[own.joints[0] - 1]}"
        ends = *one.interval, *one.interval_by_log, *(profiles or {}).get(p.name, (None, None))
        return {
            "name": p.name,
            "what": what,
            "unit": p.unit,
            "value": one.value,
            **({"lower": low, "upper": high} if low < high else {}),
            **dict(zip(ENDS, ends, strict=True)),
            "data [%]": None if one.data_share is None else 100 * one.data_share,
            "flag": status(one),
        }

    by_log = ENDS[2:4] if summary.left_out_deg else ()
    columns = ["name", "what", "unit", "lower", "upper", "value", *ENDS[:2], *by_log]
    columns += [*(ENDS[4:] if profiles else ()), "data [%]", "flag"]
    note = (
        "from, to: 95 % interval; empty: no limit. data: share of the information from the logs. by log: "
        "from the differences between logs."
    )
    optional = ("what", *by_log, "data [%]", "lower", "upper")
    rows = map(row, settings.parameter_set().parameters)
    return Table.of("Parameters", {name: name for name in columns}, rows, note, optional)


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
        # every direction, best determined first, with its standard deviation and its largest parts
        _, singular, axes = np.linalg.svd(known.root)
        rows: list[tuple[float, str]] = []
        for value, axis in zip(singular.tolist(), axes, strict=True):
            order = np.argsort(-np.abs(axis), kind="stable")
            shares = np.sign(axis[order[0]]) * axis
            parts = (f"{known.parameters[i]} {shares[i]:+.2f}" for i in order if abs(shares[i]) >= 0.1)
            rows.append((100 / value if value > 0 else np.inf, ", ".join(parts).replace("-", "−")))
        header = "standard deviation [%]", "parameters that change together, in proportion to their values"
        tables = {"directions": Table("", header, tuple(rows))}
        sections.append(Section("Directions", points=points[6:], tables=tables, folded=True))
    return tuple(sections)


def quantity_section(settings: FitSettings, summary: FitSummary) -> Section | None:
    """Return the section with a card of the best known quantities of each joint; none without any."""
    cards = dict[str, Table]()
    for joint in settings.outputs:
        known = [q for q in summary.quantities.values() if q.joint == joint and q.within <= BEST_WITHIN]
        rows = tuple(
            (q.label, f"{q.value:.3g} {q.unit} ± {100 * q.within:.2g} %")
            for q in sorted(known, key=lambda q: q.within)[:5]
        )
        name = settings.arm.joint_names[joint - 1]
        if rows:
            cards[f"known_{name}"] = Table(name, ("quantity", "value"), rows)
    text = (
        "With 95 % intervals, which are right only if the model is right. estimate.yaml has all quantities."
    )
    return Section("What is known", text, cards=cards) if cards else None


def error_section(settings: FitSettings, summary: FitSummary) -> Section | None:
    """Return the section with the error model of each compared joint; none where the run has none."""
    arm, rows, after = settings.arm, list[dict[str, Any]](), list[str]()
    for joint in settings.outputs:
        error = summary.errors.get(f"q{joint}")
        if error is None:
            continue
        name, slides = arm.joint_names[joint - 1], arm.joints[joint - 1].slides
        unit, factor = ("mm", 1e3 * float(np.radians(1.0))) if slides else ("deg", 1.0)
        ahead = factor * error.after_10_s_deg
        which = f" ({name})" if len(settings.outputs) > 1 else ""
        after.append(f"{two_digits(ahead)} {unit}{which}")
        rows.append(
            {
                "joint": name,
                "unit": unit,
                "sensor's noise": factor * error.sensor_deg,
                "uncertain after 10 s": ahead,
                "what is left lasts [s]": error.lasts_s or None,
            }
        )
    if not rows:
        return None
    text = (
        f"After 10 s of motion the prediction is uncertain by {listed(after)}, whatever the parameters: what "
        "moves a joint between the samples and beside the commands adds up."
    )
    note = (
        "Standard deviations; after 10 s at the mean speed of the logs. What is left and lasts is the error "
        "of the model, not the sensor's; empty: nothing lasts."
    )
    table = Table.of("", {name: name for name in rows[0]}, rows, note)
    return Section("How sure a prediction can be", text, tables={"prediction_errors": table})


def speed_section(settings: FitSettings, summary: FitSummary, logs: Sequence[Log]) -> Section | None:
    """Return the section with each joint's speed against command, with its band, where there is one."""
    curves, names = summary.curves.values(), settings.arm.joint_names

    def draw() -> Chart:
        panels: list[Panel] = []
        for curve in curves:
            rows = np.column_stack([curve.at, curve.value, np.array(curve.interval, dtype=float)])
            commands = np.concatenate([log.command[:, curve.joint - 1] for log in logs])
            low, high = [-105.0, commands.max(initial=0.0)], [commands.min(initial=0.0), 105.0]
            marks = [Mark("spans", np.array(low), end=np.array(high), color="pale", alpha=0.4)]
            marks += _measured(logs, curve)
            for sign, color in (1, "blue"), (-1, "orange"):  # with the dead band between them
                x, y, low, high = rows[sign * rows[:, 0] > 0].T
                marks += [
                    Mark("band", x, low, high, color=color, alpha=0.25),
                    Mark("line", x, y, color=color),
                    Mark("points", x, y, color=color, width=5),
                ]
            title = f"{names[curve.joint - 1]}: {curve.label}"
            panels.append(Panel(curve.along, f"speed [{curve.unit}]", tuple(marks), title, 250))
        return Chart(tuple(panels))

    text = (
        "Speeds of a settled motion through mid travel against command, with 95 % intervals. Grey: commands "
        "beyond the logs. Grey points: mean speeds in the logs, which other poses and joints slow or hasten."
    )
    return Section("Speeds", plots=(Plot("speed", text, draw),), folded=True) if curves else None


def _measured(logs: Sequence[Log], curve: CurveEstimate) -> list[Mark]:
    """Return the speeds that the logs show at commands that they hold for long enough, as points."""
    shown = measured_speeds(logs, curve.joint)
    if shown is None or not curve.along.startswith("command"):
        return []
    factor = shown.direction * (1e3 if curve.unit.startswith("mm") else float(np.degrees(1.0)))
    held = (shown.weight > LEAST_WEIGHT) & (np.abs(shown.command) > LEAST_COMMAND)
    return [Mark("points", shown.command[held], factor * shown.speed[held], color="grey", alpha=0.5, width=3)]


def merged_tables(runs: Sequence[Record]) -> dict[str, Table]:
    """Return the tables `spread` and `runs` of runs that differ in their seeds only, the best run first.

    A seed may lead to further terms, and so to parameters that others lack; their cells are empty, as are
    errors of joints that diverged. The spread is over the runs that have a value.
    """
    runs = sorted(runs, key=lambda run: run.rms_deg)
    units, flags = dict[str, str](), dict[str, str]()
    for run in runs:
        units |= {f"error of {one.name}": "mm" if one.slides else "deg" for one in run.summary.verdict}
    for run in runs:
        units |= {name: one.unit for name, one in run.summary.estimate.items()}
        flags = {name: status(one) for name, one in run.summary.estimate.items()} | flags
    values = [_errors(run) | run.summary.values for run in runs]
    each = [(run.folder, run.seed, *map(one.get, units)) for run, one in zip(runs, values, strict=True)]
    spread: list[tuple[Cell, ...]] = []
    for name, unit in units.items():
        known = [value for one in values if (value := one.get(name)) is not None]
        quantiles = np.quantile(known, [0.5, 0, 0.25, 0.75, 1]).tolist() if known else [None] * 5
        spread.append((name, unit, *quantiles, flags.get(name, "")))
    header = "run", "seed", *(f"{name} [{unit}]" for name, unit in units.items())
    return {
        "spread": Table(f"{len(runs)} runs", SPREAD, tuple(spread), optional=SPREAD[4:6]),
        "runs": Table("Runs, smallest error first", header, tuple(each), optional=header[:1:-1]),
    }


def _errors(run: Record) -> dict[str, float | None]:
    """Return each joint's error on the fitted logs [deg], of one that slides [mm]; None: there is none."""
    errors = dict[str, float | None]()
    for one in run.summary.verdict:
        factor = 1e3 * float(np.radians(1.0)) if one.slides else 1.0
        errors[f"error of {one.name}"] = None if one.fitted_deg is None else factor * one.fitted_deg
    return errors
