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
    found = list[LogFinding]()
    of = {log.source: log for log in logs}
    for one in agreements:
        if one.odd is None:
            continue
        row, number = one.odd
        source = one.sources[row]
        name = settings.arm.joint_names[one.joint - 1]
        value = one.numbers[row, number]
        by = 2 * one.sd[row, number]
        about = _conditions(of[source], settings)
        found.append(
            log_finding(
                "warning", KINDS[number], source, name, value=value, by=by, about=about
            )
        )
    return found


def _conditions(log: Log, settings: FitSettings) -> str:
    """Return what is known of a log in brackets: its time of day, load and group."""
    known = [log.clock] if log.clock else []
    if load := settings.payload_of(log.source):
        known.append(f"load {load:g} kg")
    if (group := settings.log.group_of(log.source)) != OTHER:
        known.append(f"group {group}")
    return f" ({', '.join(known)})" if known else ""


def tables(
    agreements: "Sequence[Agreement]", names: Sequence[str], *, every: bool
) -> "list[Table]":
    """Return a table of the joints in which a log stands out, or of `every` joint; none
    if there is none."""
    from hydroid.reporting.page import Table

    rows = list[tuple[str, ...]]()
    for one in agreements:
        if one.odd is None and not every:
            continue
        for k, source in enumerate(one.sources):
            mark = "stands out" if one.odd and one.odd[0] == k else ""
            pairs = zip(FORMS, one.numbers[k], 2 * one.sd[k], strict=True)
            cells = [form.format(value, by) for form, value, by in pairs]
            rows.append((names[one.joint - 1], Path(source).name, *cells, mark))
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
    for one in agreements:
        for k, source in enumerate(one.sources):
            row: dict[str, object] = {"joint": names[one.joint - 1], "log": source}
            for name, value, sd in zip(KEYS, one.numbers[k], one.sd[k], strict=True):
                row[name] = float(value)
                row[f"{name}_sd"] = float(sd)
            row["stands_out"] = (
                KEYS[one.odd[1]] if one.odd and one.odd[0] == k else None
            )
            rows.append(row)
    return rows
