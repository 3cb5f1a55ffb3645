"""Whether logs agree, as `check` shows it: a table of the joints in which one stands
out, and which one."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from hydroid.log import Log, LogFinding, log_finding
from hydroid.settings.fit import FitSettings
from hydroid.settings.log import OTHER

if TYPE_CHECKING:
    from hydroid.fitting.agreement import Agreement
    from hydroid.reporting.page import Table

KINDS = ("log differs in speed", "log differs in dead band", "log differs in delay")
"""of findings, by the numbers of an `Agreement`"""
KEYS = ("speed", "dead_band_pct", "delay_s")
"""names of these numbers in JSON"""
FORMS = ("{:.2f} ± {:.2f}", "{:+.1f} ± {:.1f}", "{:+.2f} ± {:.2f}")
"""of these numbers and their intervals"""


def odd_logs(
    agreements: "Sequence[Agreement]", logs: Sequence[Log], settings: FitSettings
) -> list[LogFinding]:
    """Return which logs stand out, and in what."""
    findings = list[LogFinding]()
    by_source = {log.source: log for log in logs}
    for agreement in agreements:
        if agreement.odd is None:
            continue
        row, number = agreement.odd
        source = agreement.sources[row]
        finding = log_finding(
            "warning",
            KINDS[number],
            source,
            settings.arm.name_of(agreement.joint),
            value=agreement.numbers[row, number],
            by=2 * agreement.sd[row, number],
            about=_conditions(by_source[source], settings),
        )
        findings.append(finding)
    return findings


def _conditions(log: Log, settings: FitSettings) -> str:
    """Return what is known of a log in brackets: its time of day, load and group."""
    conditions = list[str]()
    if log.clock:
        conditions.append(log.clock)
    if load := settings.payload_of(log.source):
        conditions.append(f"load {load:g} kg")
    group = settings.log.group_of(log.source)
    if group != OTHER:
        conditions.append(f"group {group}")
    return f" ({', '.join(conditions)})" if conditions else ""


def tables(
    agreements: "Sequence[Agreement]", names: Sequence[str], *, every: bool
) -> "list[Table]":
    """Return a table of the joints in which a log stands out, or of `every` joint; none
    if there is none."""
    from hydroid.reporting.page import Table

    rows = list[tuple[str, ...]]()
    for agreement in agreements:
        if agreement.odd is None and not every:
            continue
        joint = names[agreement.joint - 1]
        intervals = 2 * agreement.sd
        for k, source in enumerate(agreement.sources):
            pairs = zip(FORMS, agreement.numbers[k], intervals[k], strict=True)
            cells = [form.format(value, by) for form, value, by in pairs]
            mark = "stands out" if _odd_number(agreement, k) is not None else ""
            rows.append((joint, Path(source).name, *cells, mark))
    if not rows:
        return []
    header = ("joint", "log", "speed", "dead bands wider by [%]", "later by [s]", "")
    note = (
        "Each log against the others, and each number alone, as if the others were the "
        "same; 95 % intervals."
    )
    return [Table("Do the logs agree?", header, tuple(rows), note)]


def plain(
    agreements: "Sequence[Agreement]", names: Sequence[str]
) -> list[Mapping[str, object]]:
    """Return agreements as JSON holds them."""
    rows = list[Mapping[str, object]]()
    for agreement in agreements:
        joint = names[agreement.joint - 1]
        for k, source in enumerate(agreement.sources):
            row: dict[str, object] = {"joint": joint, "log": source}
            of_log = zip(KEYS, agreement.numbers[k], agreement.sd[k], strict=True)
            for name, value, sd in of_log:
                row[name] = float(value)
                row[f"{name}_sd"] = float(sd)
            odd = _odd_number(agreement, k)
            row["stands_out"] = None if odd is None else KEYS[odd]
            rows.append(row)
    return rows


def _odd_number(agreement: "Agreement", log: int) -> int | None:
    """Return in which of its numbers a log stands out, if it does; both are counted
    from 0."""
    if agreement.odd is None or agreement.odd[0] != log:
        return None
    return agreement.odd[1]
