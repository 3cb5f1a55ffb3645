"""A recording's samples -> one period: repairs that invent no data, then commands held, angles interpolated.

A faster log is thinned by plain interpolation, without a filter before it: the fit compares angles sample by
sample, and white sensor noise stays what it was, while a filter would colour it and delay the angle.
"""

from dataclasses import replace

import numpy as np

from hydroid.log.checks import GAP, sample_period
from hydroid.log.log import Finding, Floats
from hydroid.log.signals import Recording

TURN = 2 * np.pi
MAX_GROWTH = 2  # largest ratio of rows after and before: mostly gaps cannot be repaired
NEAR_TURN = np.pi / 4  # largest difference of a wrap from a whole turn: the motion within one sample
ON_GRID = 0.01  # of a period: where all samples are this near to the first one's grid, values pass unchanged
_ROUNDING = 1e-6  # of a period


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
            notes.append(recording.finding("note", what, "", rows[1:][wraps], signal, "wrap"))
    return replace(recording, values=values), notes


def fill(recording: Recording, longest: float) -> tuple[Recording, list[Finding]]:
    """Fill gaps: interpolate angles, hold commands, insert dropped samples.

    A gap is at most `longest` [s] besides the usual step between samples. Rows without a time are dropped,
    and put back if they leave a gap.
    """
    timed = ~np.isnan(recording.time)
    lost, first = int((~timed).sum()), recording.lines[~timed][:1]
    recording = recording.take(np.flatnonzero(timed))
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
    what = f"repaired: {_count(cells, 'missing cell')} filled, {_count(samples, 'dropped sample')} inserted"
    what += f", {_count(lost, 'row')} without a time left out" if lost else ""
    line = min([*recording.lines[filled.any(axis=1) | added][:1], *first])
    hint = "angles interpolated, commands held"
    return recording, [replace(recording.finding("warning", what, hint, kind="repair"), line=int(line))]


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
    longer = recording.take(origin)
    longer.values[added] = np.nan
    longer.values[:, 0] = recording.time[origin] + nth * np.append(steps, 0.0)[origin] / copies[origin]
    longer.ragged[added] = False
    return longer, added


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


def resample(
    time: Floats, command: Floats, angle: Floats, period: float, delay: float = 0.0
) -> tuple[Floats, Floats, Floats]:
    """Bring a recording to the grid k · period [s], from its first sample to its last.

    Commands, shape (R, J), act `delay` [s] later than logged, and are 0 % before the first one acts. Angles
    and other signals that are interpolated have the shape (R, M); times [s] increase strictly.

    Returns:
        Grid [s] from 0, shape (T,); command and angle, shapes (T, J) and (T, M).
    """
    time, grid = time - time[0], _grid(time, period)
    if is_on_grid(time, period):
        time = grid
    else:
        angle = np.stack([np.interp(grid, time, column) for column in angle.T], axis=1)
    return grid, hold(time, command, grid - delay, period), angle


def is_on_grid(time: Floats, period: float) -> bool:
    """Return whether the samples already stand on the grid, so that their values pass unchanged."""
    grid = _grid(time, period)
    return len(time) == len(grid) and bool((np.abs(time - time[0] - grid) <= ON_GRID * period).all())


def hold(time: Floats, command: Floats, at: Floats, period: float) -> Floats:
    """Return the last command at or before each time in `at` [s]; 0 before the first, shape (len(at), J)."""
    index = np.searchsorted(time, at + _ROUNDING * period, side="right") - 1
    return np.where(index[:, None] >= 0, command[index], 0.0)


def _grid(time: Floats, period: float) -> Floats:
    return period * np.arange(int((time[-1] - time[0]) / period + ON_GRID) + 1, dtype=np.float64)
