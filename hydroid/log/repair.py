"""Repairs that invent no data: wrapped angles, and gaps no longer than `log.repair_s`."""

from dataclasses import replace

import numpy as np

from hydroid.log.checks import GAP, sample_period
from hydroid.log.finding import Finding
from hydroid.log.log import Floats
from hydroid.log.signals import Recording

TURN = 2 * np.pi
MAX_GROWTH = 2  # largest ratio of rows after and before: mostly gaps cannot be repaired
NEAR_TURN = np.pi / 4  # largest difference of a wrap from a whole turn: the motion within one sample


def unwrap(recording: Recording) -> tuple[Recording, list[Finding]]:
    """Join angles of continuous joints where they jump by one turn, as an encoder's do."""
    values, notes = recording.values.copy(), list[Finding]()
    for column, signal in enumerate(recording.signals):
        if signal.kind != "angle" or np.isfinite(signal.high):
            continue
        rows = np.flatnonzero(~np.isnan(values[:, column]))
        steps = np.diff(values[rows, column])
        wraps = np.abs(np.abs(steps) - TURN) < NEAR_TURN
        if wraps.any():
            values[rows[1:], column] -= TURN * np.cumsum(np.sign(steps) * wraps)
            what = f"{signal} wraps by 360 deg and was joined"
            notes.append(recording.finding("note", what, "", rows[1:][wraps], signal))
    return replace(recording, values=values), notes


def fill(recording: Recording, longest: float) -> tuple[Recording, list[Finding]]:
    """Fill gaps: interpolate angles, hold commands, insert dropped samples.

    Args:
        recording: rows without a time are dropped, and put back if they leave a gap.
        longest: longest gap [s] that is filled, without the usual step between samples.
    """
    timed = ~np.isnan(recording.time)
    lost = int((~timed).sum())
    first = recording.lines[~timed][:1]
    recording = replace(
        recording,
        values=recording.values[timed],
        lines=recording.lines[timed],
        ragged=recording.ragged[timed],
    )
    period = sample_period(recording.time)
    reach = longest * (1 + 1e-9) + period
    recording, added = _insert(recording, period, reach)
    values = recording.values.copy()
    for column, signal in enumerate(recording.signals[1:], 1):
        _bridge(recording.time, values[:, column], reach, held=signal.kind == "command")
    filled = np.isnan(recording.values) & ~np.isnan(values) & ~added[:, None]
    recording = replace(recording, values=values)
    cells, samples = int(filled.sum()), int(added.sum())
    if not (cells or samples or lost):
        return recording, []
    lines = [*recording.lines[filled.any(axis=1) | added][:1], *first]
    what = f"repaired: {_count(cells, 'missing cell')} filled, {_count(samples, 'dropped sample')} inserted"
    what += f", {_count(lost, 'row')} without a time left out" if lost else ""
    note = Finding(
        "warning", what, recording.file.source, "angles interpolated, commands held", int(min(lines))
    )
    return recording, [note]


def _insert(recording: Recording, period: float, reach: float) -> tuple[Recording, np.ndarray]:
    """Put rows of NaN where samples are missing; also returns which rows are new, shape (R,)."""
    steps = np.diff(recording.time)
    gaps = (steps > GAP * period) & (steps <= reach)
    copies = np.ones(len(recording.time), dtype=np.int64)
    copies[:-1][gaps] = np.rint(np.minimum(steps[gaps] / period, 1e9)).astype(np.int64)
    if copies.sum() > MAX_GROWTH * len(copies):
        copies[:] = 1
    origin = np.repeat(np.arange(len(copies)), copies)
    nth = np.arange(len(origin)) - np.repeat(np.cumsum(copies) - copies, copies)
    added = nth > 0
    values = np.where(added[:, None], np.nan, recording.values[origin])
    step = np.append(steps, 0.0)[origin]
    values[:, 0] = recording.time[origin] + nth * step / copies[origin]
    return replace(
        recording, values=values, lines=recording.lines[origin], ragged=recording.ragged[origin] & ~added
    ), added


def _bridge(time: Floats, values: Floats, reach: float, held: bool) -> None:
    """Fill, in place, the holes between two samples no more than `reach` [s] apart."""
    there = ~np.isnan(values)
    if there.all() or not there.any():
        return
    rows = np.arange(len(values))
    before = np.maximum.accumulate(np.where(there, rows, -1))
    after = np.minimum.accumulate(np.where(there, rows, len(rows))[::-1])[::-1]
    inside = ~there & (before >= 0) & (after < len(rows))
    inside[inside] = time[after[inside]] - time[before[inside]] <= reach
    filled = values[before] if held else np.interp(time, time[there], values[there])
    values[inside] = filled[inside]


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"
