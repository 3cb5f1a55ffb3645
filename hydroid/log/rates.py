"""A table of signals at several rates -> one with a value of each in every row.

Programs that join channels leave cells empty where a channel has no sample. Such a
channel is read as one of a bag is: angles interpolated, commands held.
"""

from dataclasses import replace

import numpy as np

from hydroid.arrays import Array, Mask
from hydroid.log.log import LogFinding
from hydroid.log.table import Recording

LEAST_EMPTY = 0.2
"""part of the rows in which a slower channel has no sample; fewer are faults"""
FEWEST = 10
"""samples of a channel, below which it tells no rate"""
MOST_HOLES = 0.05
"""part of a slower channel's steps that are longer than three usual ones"""
LONGEST = 0.1
"""between two samples of a slower channel [s], or three of its usual steps; a longer
hole is one"""


def join_rates(recording: Recording, findings: list[LogFinding]) -> Recording:
    """Return a recording whose slower channels have values between their samples, and
    say which they are.

    Rows before the first and after the last sample of any of them are left out.
    """
    time = recording.time
    if np.isnan(time).any() or len(time) < FEWEST:
        return recording
    values = recording.values
    within = np.ones(len(time), dtype=bool)
    for place, signal in enumerate(recording.signals[1:], 1):
        there = ~np.isnan(values[:, place])
        if not _is_slower(time, there):
            continue
        if values is recording.values:
            values = values.copy()
        rows = np.flatnonzero(there)
        values[:, place] = _filled(
            time, values[:, place], held=signal.kind == "command"
        )
        within[: rows[0]] = False
        within[rows[-1] + 1 :] = False
        every = float(np.median(np.diff(time[rows])))
        findings.append(
            recording.finding("note", "slower channel", (), signal, every=every)
        )
    if values is recording.values:
        return recording
    return replace(recording, values=values).kept(np.flatnonzero(within))


def _is_slower(time: Array, there: Mask) -> bool:
    """Return whether a channel with samples in some rows, (R,), is one of a slower rate,
    and has no fault instead."""
    if there.sum() < FEWEST or there.mean() > 1 - LEAST_EMPTY:
        return False
    # samples of a rate do not follow each other directly, then fail for long
    rows = np.diff(np.flatnonzero(there))
    return bool(np.mean(rows > 3 * np.median(rows)) < MOST_HOLES)


def _filled(time: Array, values: Array, *, held: bool) -> Array:
    """Return the values of a channel, (R,), with those between its samples, but for its
    holes."""
    there = ~np.isnan(values)
    rows = np.flatnonzero(there)
    samples = time[rows]
    # the number of the last sample at or before each row, and of the next one
    last = np.searchsorted(samples, time, side="right") - 1
    before = last.clip(0)
    after = (last + 1).clip(max=len(rows) - 1)
    longest = max(LONGEST, 3 * float(np.median(np.diff(samples))))
    is_near = samples[after] - samples[before] <= longest * (1 + 1e-9)
    filled = values[rows][before] if held else np.interp(time, samples, values[rows])
    return np.where(there | is_near, filled, np.nan)
