"""What a fit knows of the machine, what it does not know, and how sure a prediction can
be."""

import math
import re
from collections.abc import Iterator, Sequence
from typing import Any

from hydroid.estimate import AngleError, FitSummary, QuantityEstimate
from hydroid.findings import Finding
from hydroid.fitting.validation import HORIZONS
from hydroid.fitting.verdict import THE_FIT
from hydroid.joint_verdict import JointVerdict
from hydroid.posterior.uncertainty import source_of
from hydroid.reporting.page import Cell, Section, Table
from hydroid.reporting.parameters_report import held_masses, sentence, shares_in_words
from hydroid.reporting.stated_values import is_mostly_prior
from hydroid.settings.fit import FitSettings
from hydroid.units import Display
from hydroid.words import interval_words, listed, significant, two_digits, value_words

BEST_WITHIN = 0.3
"""half of a 95 % interval, relative to the value, up to which a property counts as
known"""
MOST_KNOWN = 4
"""quantities of a joint that a page shows, beside its speeds and how it swings"""
ANY_WIDTH = ("natural_frequency", "damping_ratio")
"""ends of the names of quantities that are stated however wide their intervals are:
whether an arm swings for long, a wide one tells, too"""
COMMAND = re.compile(r"_\d+(?=_|$)")
"""command in the name of a quantity"""
VARIANT = re.compile(r"_(positive|negative|\d+)(?=_|$)")
"""direction and command in the name of a quantity: without them it is its kind's"""
MOST_UNKNOWN = 6
MOST_WARNINGS = 3
AHEAD = 10.0
"""time of a prediction whose error is expected [s]"""
EXPECTED = f"expected after {AHEAD:g} s"
MEASURED = f"measured after {AHEAD:g} s"
INSIDE = "unseen samples inside the 95 % bands [%]"
"""names of columns"""
_SURE = (
    "Even with exact parameters a prediction is uncertain, because not only the commands "
    "move the joints. These other influences add up over time."
)
_ERRORS = (
    "Expected: rms error of how far a joint moves in this time, if parameters and model were "
    "exact. It contains the sensor's noise, at the start and at the end of this time, and the other "
    "influences that the fitted logs show at the joint's mean speed. A new error is what the past of a log "
    "does not foretell: the angle drifts by it and stays off. One that persists comes from the "
    "model, not from the sensor. Empty: none persists."
)
_MEASURED_ERRORS = (
    " Measured: the same on the unseen logs, as in the table of verdicts. It is larger "
    "than expected where parameters or the model err, or where something differs in these logs. "
    "The bands allow for inexact parameters."
)
ELSEWHERE = ("combination", "error lasts")
"""findings that another section of the page shows better"""


def warnings(summary: FitSummary) -> tuple[Finding, ...]:
    """Return what must be read before any use of the estimate, at most three things."""
    warned = [finding for finding in summary.findings if finding.level != "note"]
    return tuple(warned[:MOST_WARNINGS])


def unknown_section(settings: FitSettings, summary: FitSummary) -> Section:
    """Return the section of the other findings, and of masses that are held.

    Findings after the first six stand with the parameters.
    """
    shown = _others(summary)[:MOST_UNKNOWN]
    points = [sentence(finding, settings) for finding in shown]
    none = "" if points else "The logs determine every free parameter."
    return Section("What is not known", none, (*points, *held_masses(settings)))


def further_findings(summary: FitSummary) -> tuple[str, ...]:
    """Return the findings that `unknown_section` has no room for."""
    return tuple(map(str, _others(summary)[MOST_UNKNOWN:]))


def _others(summary: FitSummary) -> list[Finding]:
    first = warnings(summary)
    others = [finding for finding in summary.findings if finding not in first]
    return [finding for finding in others if finding.kind not in ELSEWHERE]


def quantity_section(settings: FitSettings, summary: FitSummary) -> Section | None:
    """Return the section with a card of the best known quantity of each kind for each
    joint, of the speed in both directions.

    None without any.
    """
    cards = dict[str, Table]()
    for joint in settings.outputs:
        rows = list[tuple[Cell, ...]]()
        for quantity in _best_known(summary, joint):
            value = value_words(quantity.value, *quantity.interval)
            rows.append((quantity.said, value, quantity.unit, _within(quantity)))
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


def _best_known(summary: FitSummary, joint: int) -> list[QuantityEstimate]:
    """Return the best known quantity of each kind of a joint: speeds, then the others,
    the most precise first, then how the arm swings on its oil."""
    best = dict[str, QuantityEstimate]()
    for name, quantity in summary.quantities.items():
        kind = VARIANT.sub("", name)
        if quantity.joint != joint or not _is_known(kind, quantity):
            continue
        # both directions: whether they differ is the first that is asked
        if kind.endswith("_speed"):
            kind = COMMAND.sub("", name)
        known = best.setdefault(kind, quantity)
        best[kind] = min(known, quantity, key=_doubt)
    speeds = [one for kind, one in best.items() if "_speed_" in kind]
    swings = [one for kind, one in best.items() if kind.endswith(ANY_WIDTH)]
    others = [one for one in best.values() if one not in (*speeds, *swings)]
    others.sort(key=_doubt)
    return [*speeds, *others[:MOST_KNOWN], *swings]


def _is_known(kind: str, quantity: QuantityEstimate) -> bool:
    """Return whether a page states a quantity as known."""
    if kind.endswith(ANY_WIDTH):
        return quantity.within < math.inf
    return quantity.within <= BEST_WITHIN


def _doubt(quantity: QuantityEstimate) -> tuple[bool, float]:
    """Return what orders quantities: extrapolated ones last, and the most precise
    first."""
    return quantity.reach is not None, quantity.within


def every_quantity_section(
    settings: FitSettings, summary: FitSummary
) -> Section | None:
    """Return the folded section with all quantities of the compared joints.

    None without any. `quantity_table` has more digits.
    """
    rows = list[tuple[Cell, ...]]()
    for name, quantity in _by_joint(settings, summary):
        value = value_words(quantity.value, *quantity.interval)
        between = interval_words(*quantity.interval)
        source = quantity_source(quantity)
        rows.append((name, quantity.said, value, quantity.unit, between, source))
    if not rows:
        return None
    header = ("joint", "quantity", "value", "unit", "95 %", "source")
    note = (
        "95 %: confidence interval; empty: no limit. source: what the interval comes from, the logs "
        "(data) or the priors of the settings; empty: not determined."
    )
    text = (
        "What follows from the parameters of each joint. Quantities that are parameters "
        "themselves, such as the dead band of a pilot stage, are in the table of parameters. Flow: "
        "what the growing chamber could take in. It exceeds the pump's where a load pulls the joint."
    )
    tables = {"quantities": Table("", header, tuple(rows), note)}
    answer = f"{len(rows)}, with intervals"
    return Section("All quantities", text, tables=tables, folded=True, answer=answer)


def quantity_table(settings: FitSettings, summary: FitSummary) -> Table:
    """Return all quantities of the compared joints with every digit, for a file."""
    rows = list[tuple[Cell, ...]]()
    for name, quantity in _by_joint(settings, summary):
        value = quantity.value, quantity.unit, *quantity.interval
        rows.append((name, quantity.said, *value, quantity_source(quantity)))
    header = ("joint", "quantity", "value", "unit", "from", "to", "source")
    return Table("", header, tuple(rows))


def _by_joint(
    settings: FitSettings, summary: FitSummary
) -> Iterator[tuple[str, QuantityEstimate]]:
    """Yield the names of the compared joints with each of their quantities."""
    for joint in settings.outputs:
        for quantity in summary.quantities.values():
            if quantity.joint == joint:
                yield settings.arm.name_of(joint), quantity


def quantity_source(quantity: QuantityEstimate) -> str:
    """Say whether a quantity is known from the logs or from the priors, in the words of
    the parameters; nothing of one that is not determined."""
    share = quantity.data_share
    if share is None:
        return ""
    source = source_of(share)
    return shares_in_words(source, share)


def _within(quantity: QuantityEstimate) -> str:
    """Write an interval, and how much of it is the prior's where most is: it is then no
    news from the logs."""
    share = quantity.data_share
    if share is None or not is_mostly_prior(quantity):
        return _ends(quantity)
    return f"{_ends(quantity)} ({100 * (1 - share):.0f} % prior)"


def _ends(quantity: QuantityEstimate) -> str:
    """Write an interval: of a percentage, or one that is wide, its ends, since ± 3 % of
    40 % could mean either."""
    low, high = quantity.interval
    has_ends = low is not None and high is not None
    if has_ends and quantity.unit == "%":
        return f"{interval_words(low, high)} %"
    if has_ends and quantity.within > BEST_WITHIN:
        return interval_words(low, high)
    return f"± {100 * quantity.within:.2g} %"


def error_section(
    settings: FitSettings, summary: FitSummary, verdicts: Sequence[JointVerdict] = ()
) -> Section | None:
    """Return the folded section with the error model of each compared joint, beside what
    unseen logs show of it.

    None where the run has none.
    """
    by_joint = {verdict.joint: verdict for verdict in verdicts}
    rows = list[dict[str, Any]]()
    after = list[str]()
    held = list[str]()
    for joint in settings.outputs:
        error = summary.errors.get(f"q{joint}")
        if error is None:
            continue
        name = settings.arm.name_of(joint)
        shown = settings.arm.joint(joint).shown
        row = _error_row(error, by_joint.get(joint), shown)
        rows.append({"joint": name, "unit": shown.unit, **row})
        said = f"{name} {significant(row[EXPECTED], 2)} {shown.unit}"
        if row[MEASURED] is not None:
            said += f" (measured {significant(row[MEASURED], 2)})"
        after.append(said)
        if row[INSIDE] is not None:
            held.append(f"{name} {two_digits(row[INSIDE])} %")
    if not rows:
        return None
    columns = {name: name for name in rows[0]}
    answer = f"{EXPECTED}: {listed(after)}"
    note = _ERRORS
    if held:
        answer += f"; unseen samples inside the 95 % bands: {listed(held)}"
        note += _MEASURED_ERRORS
    else:
        for name in (MEASURED, INSIDE):
            del columns[name]
    table = Table.of("", columns, rows, note)
    return Section(
        "How sure can a prediction be?",
        _SURE,
        tables={"prediction_errors": table},
        folded=True,
        answer=answer,
    )


def _error_row(
    error: AngleError, verdict: JointVerdict | None, shown: Display
) -> dict[str, Any]:
    """Return the error model of a joint, and what unseen logs show of it, as the joint is
    shown."""
    measured = None
    inside = None
    if verdict is not None:
        inside = verdict.inside_percent
        ahead = verdict.horizons_deg.get(THE_FIT, ())
        by_time = dict(zip(HORIZONS, ahead, strict=False))
        measured = by_time.get(AHEAD)
    factor = shown.of_degrees(1.0)
    return {
        "sensor's noise": factor * error.sensor_deg,
        EXPECTED: factor * error.change_deg(AHEAD),
        MEASURED: None if measured is None else factor * measured,
        "a new error persists for [s]": error.lasts_s or None,
        INSIDE: inside,
    }
