"""Stretches of a log in which an arm works against the world, as a bucket that digs:
they are left out, and what is left is split there as at a gap."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hydroid.errors import LogError
from hydroid.log.log import LogFinding, by_level, log_finding
from hydroid.log.table import Recording, Signal, Table
from hydroid.settings.log import Work
from hydroid.words import listed

WORK = "work"
"""kind of the signal of a column that says so"""


NO_WORK = "no work"
"""kind of the finding that a log lacks this column"""


def with_work(
    table: Table, signals: Sequence[Signal], work: Work, findings: list[LogFinding]
) -> list[Signal]:
    """Return signals with that of the column of work; a finding says that the table
    lacks it, and which columns have no use."""
    if work.column is None:
        return [*signals]
    if work.column in table.names:
        return [*signals, Signal(work.column, WORK)]
    used = {signal.name for signal in signals}
    spare = [name for name in table.names if name and name not in used]
    findings.append(
        log_finding(
            "note",
            NO_WORK,
            table.source,
            work.column,
            spare=listed(spare or ["none"], 3),
        )
    )
    return [*signals]


def lacked_by_all(
    files: Sequence[Sequence[LogFinding]],
) -> list[list[LogFinding]]:
    """Return the findings of files that are read together, by file; if each lacks the
    column of work, its name is wrong, and that is an error."""
    lacking = [any(one.kind == NO_WORK for one in findings) for findings in files]
    if not files or not all(lacking):
        return [[*findings] for findings in files]
    return [by_level(map(_as_error, findings)) for findings in files]


def _as_error(finding: LogFinding) -> LogFinding:
    """Return a finding about the column of work as an error, and any other as it is."""
    if finding.kind != NO_WORK:
        return finding
    return replace(finding, kind="no work anywhere", level="error")


def without_work(
    recording: Recording, work: Work, findings: list[LogFinding]
) -> Recording:
    """Return a recording without the rows of work, and without their signal; a finding
    says which share they are.

    A cell of the column that holds no number is no work. Raises LogError: no cell holds
    one, or nothing else is left.
    """
    time = recording.time - np.nanmin(recording.time, initial=np.inf)
    works = np.zeros(len(time), dtype=bool)
    for begin, end in work.spans_of(recording.table.source):
        works |= (time >= begin) & (time <= end)
    kinds = [signal.kind for signal in recording.signals]
    if WORK in kinds:
        column = kinds.index(WORK)
        cells = recording.values[:, column]
        if np.isnan(cells).all():
            where = f"{recording.table.source}, column {recording.signals[column].name}"
            raise LogError(
                "holds no numbers (log.work)", where, "write 0, or 1 for work"
            )
        works |= np.nan_to_num(cells) != 0
        signals = tuple(one for one in recording.signals if one.kind != WORK)
        values = np.delete(recording.values, column, axis=1)
        recording = replace(recording, signals=signals, values=values)
    if not works.any():
        return recording
    if works.all():
        what = "is all work against the world (log.work): nothing is left to be read"
        raise LogError(what, recording.table.source, "correct log.work")
    share = 100.0 * float(works.mean())
    rows = np.flatnonzero(works)
    findings.append(recording.finding("note", "work", rows, share=share))
    return recording.kept(np.flatnonzero(~works))
