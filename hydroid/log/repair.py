"""What can be mended without inventing data: wrapped angles, and holes no longer than `log.repair_s`."""

from dataclasses import replace

import numpy as np

from hydroid.log.checks import GAP, sample_period
from hydroid.log.finding import Finding
from hydroid.log.log import Floats
from hydroid.log.signals import Recording

TURN = 2 * np.pi
MOST_ADDED = 2  # times the rows there are: a record with more holes than samples is not repaired
NEAR_TURN = np.pi / 4  # a wrap differs from a whole turn by what the joint moves within one sample


def unwrap(record: Recording) -> tuple[Recording, list[Finding]]:
    """Join angles of continuous joints where they jump by one turn, as an encoder's do."""
    values, notes = record.values.copy(), list[Finding]()
    for column, signal in enumerate(record.signals):
        if signal.kind != "angle" or np.isfinite(signal.high):
            continue
        rows = np.flatnonzero(~np.isnan(values[:, column]))
        steps = np.diff(values[rows, column])
        wraps = np.abs(np.abs(steps) - TURN) < NEAR_TURN
        if wraps.any():
            values[rows[1:], column] -= TURN * np.cumsum(np.sign(steps) * wraps)
            what = f"{signal} wraps by 360 deg; its turns are counted on"
            notes.append(record.finding("note", what, "", rows[1:][wraps], signal))
    return replace(record, values=values), notes


def fill(record: Recording, longest: float) -> tuple[Recording, list[Finding]]:
    """Fill holes: angles interpolated, commands held, dropped samples put back.

    Args:
        record: rows without a time are dropped, and put back if they leave a gap.
        longest: hole [s] that is still bridged; the usual step between samples is not counted.
    """
    timed = ~np.isnan(record.time)
    lost = int((~timed).sum())
    first = record.lines[~timed][:1]
    record = replace(
        record, values=record.values[timed], lines=record.lines[timed], ragged=record.ragged[timed]
    )
    period = sample_period(record.time)
    reach = longest * (1 + 1e-9) + period
    record, added = _insert(record, period, reach)
    values = record.values.copy()
    for column, signal in enumerate(record.signals[1:], 1):
        _bridge(record.time, values[:, column], reach, held=signal.kind == "command")
    filled = np.isnan(record.values) & ~np.isnan(values) & ~added[:, None]
    record = replace(record, values=values)
    cells, samples = int(filled.sum()), int(added.sum())
    if not (cells or samples or lost):
        return record, []
    lines = [*record.lines[filled.any(axis=1) | added][:1], *first]
    what = f"repaired: {_count(cells, 'missing cell')} filled, {_count(samples, 'dropped sample')} put back"
    what += f", {_count(lost, 'row')} without a time left out" if lost else ""
    note = Finding("warning", what, record.file.source, "angles interpolated, commands held", int(min(lines)))
    return record, [note]


def _insert(record: Recording, period: float, reach: float) -> tuple[Recording, np.ndarray]:
    """Put rows of NaN where samples are missing; also returns which rows are new, shape (R,)."""
    steps = np.diff(record.time)
    gaps = (steps > GAP * period) & (steps <= reach)
    copies = np.ones(len(record.time), dtype=np.int64)
    copies[:-1][gaps] = np.rint(np.minimum(steps[gaps] / period, 1e9)).astype(np.int64)
    if copies.sum() > MOST_ADDED * len(copies):
        copies[:] = 1
    origin = np.repeat(np.arange(len(copies)), copies)
    nth = np.arange(len(origin)) - np.repeat(np.cumsum(copies) - copies, copies)
    added = nth > 0
    values = np.where(added[:, None], np.nan, record.values[origin])
    step = np.append(steps, 0.0)[origin]
    values[:, 0] = record.time[origin] + nth * step / copies[origin]
    return replace(
        record, values=values, lines=record.lines[origin], ragged=record.ragged[origin] & ~added
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
