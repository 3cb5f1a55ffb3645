"""Stretches of a log in which an arm works against the world, as a bucket that digs:
they are left out, and what is left is split there as at a gap."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hydroid.errors import LogError
from hydroid.log.log import LogFinding
from hydroid.log.table import Recording, Signal, Table
from hydroid.settings.log import Work

WORK = "work"
"""kind of the signal of a column that says so"""


def with_work(table: Table, signals: Sequence[Signal], work: Work) -> list[Signal]:
    """Return signals with that of the column of work, where the table has it."""
    if work.column is None or work.column not in table.names:
        return [*signals]
    return [*signals, Signal(work.column, WORK)]


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
