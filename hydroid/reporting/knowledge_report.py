"""What a fit knows of the machine, what it does not know, and how sure a prediction can
be."""

import re
from collections.abc import Sequence
from typing import Any

from hydroid.estimate import FitSummary, QuantityEstimate
from hydroid.findings import Finding
from hydroid.joint_verdict import JointVerdict
from hydroid.reporting.page import Cell, Section, Table
from hydroid.reporting.parameters_report import sentence
from hydroid.settings.fit import FitSettings
from hydroid.words import interval_words, listed, three_digits, two_digits

BEST_WITHIN = 0.3
"""half of a 95 % interval, relative to the value, up to which a property counts as
known"""
MOST_KNOWN = 5
"""quantities of a joint that a page shows"""
VARIANT = re.compile(r"_(positive|negative|\d+)(?=_|$)")
"""direction and command in the name of a quantity: without them it is its kind's"""
MOST_UNKNOWN = 6
MOST_WARNINGS = 3
INSIDE = "unseen samples inside the 95 % bands [%]"
"""name of a column"""
ELSEWHERE = ("combination", "error lasts")
"""findings that another section of the page shows better"""


def warnings(summary: FitSummary) -> tuple[Finding, ...]:
    """Return what must be read before any use of the estimate, at most three things."""
    warned = [finding for finding in summary.findings if finding.level != "note"]
    return tuple(warned[:MOST_WARNINGS])


def unknown_section(settings: FitSettings, summary: FitSummary) -> Section:
    """Return the section of the other findings.

    Those after the first six stand with the parameters.
    """
    shown = _others(summary)[:MOST_UNKNOWN]
    points = tuple(sentence(finding, settings) for finding in shown)
    none = "" if points else "The logs determine every free parameter."
    return Section("What is not known", none, points)


def further_findings(summary: FitSummary) -> tuple[str, ...]:
    """Return the findings that `unknown_section` has no room for."""
    return tuple(map(str, _others(summary)[MOST_UNKNOWN:]))


def _others(summary: FitSummary) -> list[Finding]:
    first = warnings(summary)
    others = [finding for finding in summary.findings if finding not in first]
    return [finding for finding in others if finding.kind not in ELSEWHERE]


def quantity_section(settings: FitSettings, summary: FitSummary) -> Section | None:
    """Return the section with a card of the best known quantity of each kind for each
    joint.

    None without any.
    """
    cards = dict[str, Table]()
    for joint in settings.outputs:
        of_joint = [
            (VARIANT.sub("", name), quantity)
            for name, quantity in summary.quantities.items()
            if quantity.joint == joint and quantity.within <= BEST_WITHIN
        ]
        of_joint.sort(key=lambda pair: pair[1].within)
        best = dict[str, QuantityEstimate]()
        for kind, quantity in of_joint:
            best.setdefault(kind, quantity)
        rows = list[tuple[Cell, ...]]()
        for quantity in [*best.values()][:MOST_KNOWN]:
            value = three_digits(quantity.value)
            rows.append((quantity.label, value, quantity.unit, _within(quantity)))
        name = settings.arm.name_of(joint)
        if rows:
            header = ("quantity", "value", "unit", "interval")
            cards[f"known_{name}"] = Table(name, header, tuple(rows))
    text = (
        "The best known quantity of each kind, with its 95 % confidence interval. It holds "
        "only if the model is right: see “Confidence intervals” below. All quantities are listed "
        "further down."
    )
    return Section("What is known", text, cards=cards) if cards else None


def every_quantity_section(
    settings: FitSettings, summary: FitSummary
) -> Section | None:
    """Return the folded section with all quantities of the compared joints.

    None without any.
    """
    rows = list[tuple[Cell, ...]]()
    for joint in settings.outputs:
        name = settings.arm.name_of(joint)
        for quantity in summary.quantities.values():
            if quantity.joint == joint:
                value = quantity.value, quantity.unit, *quantity.interval
                rows.append((name, quantity.label, *value))
    if not rows:
        return None
    header = ("joint", "quantity", "value", "unit", "from", "to")
    note = "from, to: 95 % interval; empty: no limit."
    text = (
        "What follows from the parameters of each joint. Quantities that are parameters "
        "themselves, such as the dead band of a pilot stage, are in the table of parameters."
    )
    tables = {"quantities": Table("", header, tuple(rows), note)}
    answer = f"{len(rows)}, with intervals"
    return Section("All quantities", text, tables=tables, folded=True, answer=answer)


def _within(quantity: QuantityEstimate) -> str:
    """Write an interval: of a percentage its ends, since ± 3 % of 40 % could mean
    either."""
    low, high = quantity.interval
    if quantity.unit == "%" and low is not None and high is not None:
        return f"{interval_words(low, high)} %"
    return f"± {100 * quantity.within:.2g} %"


def error_section(
    settings: FitSettings, summary: FitSummary, verdicts: Sequence[JointVerdict] = ()
) -> Section | None:
    """Return the folded section with the error model of each compared joint, and how
    often the bands held what was measured in unseen logs.

    None where the run has none.
    """
    inside = {verdict.joint: verdict.inside_percent for verdict in verdicts}
    rows = list[dict[str, Any]]()
    after = list[str]()
    held = list[str]()
    for joint in settings.outputs:
        error = summary.errors.get(f"q{joint}")
        if error is None:
            continue
        name = settings.arm.name_of(joint)
        shown = settings.arm.joint(joint).shown
        unit = shown.unit
        factor = shown.of_degrees(1.0)
        ahead = factor * error.after_10_s_deg
        after.append(f"{name} {two_digits(ahead)} {unit}")
        share = inside.get(joint)
        if share is not None:
            held.append(f"{name} {two_digits(share)} %")
        rows.append(
            {
                "joint": name,
                "unit": unit,
                "sensor's noise": factor * error.sensor_deg,
                "uncertain after 10 s": ahead,
                "error persists for [s]": error.lasts_s or None,
                INSIDE: share,
            }
        )
    if not rows:
        return None
    text = (
        "Even with exact parameters a prediction is uncertain, because not only the commands "
        "move the joints. These other influences add up over time."
    )
    note = (
        "Standard deviations. After 10 s: of a joint that moves at the mean speed of the logs. "
        "An error that persists comes from the model, not from the sensor. Empty: none persists."
    )
    columns = {name: name for name in rows[0]}
    answer = f"standard deviation after 10 s: {listed(after)}"
    if held:
        answer += f"; unseen samples inside the 95 % bands: {listed(held)}"
    else:
        del columns[INSIDE]
    table = Table.of("", columns, rows, note)
    return Section(
        "How sure can a prediction be?",
        text,
        tables={"prediction_errors": table},
        folded=True,
        answer=answer,
    )
