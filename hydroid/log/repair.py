"""A recording's samples -> one period: repairs that invent no data, then commands held, angles interpolated.

A faster log is thinned by plain interpolation, without a filter before it: the fit compares angles sample by
sample, and white sensor noise stays what it was, while a filter would colour it and delay the angle.
"""

from dataclasses import replace

import numpy as np

from hydroid.log.finding import LogFinding
from hydroid.log.log import Floats
from hydroid.log.table import Recording

GAP = 1.95
"""in sample periods: a longer step is a gap, a shorter one jitter; one dropped sample makes it 2"""


def sample_period(time: Floats) -> float:
    """Return the usual step between samples [s]; NaN where there is none."""
    steps = np.diff(time[~np.isnan(time)])
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else np.nan


def unwrap(recording: Recording) -> tuple[Recording, list[LogFinding]]:
    """Join angles of continuous joints where they jump by one turn, as an encoder's do."""
    values, notes, turn = recording.values.copy(), list[LogFinding](), 2 * np.pi
    for column, signal in enumerate(recording.signals):
        if signal.kind == "angle" and not np.isfinite(signal.high):
            rows = np.flatnonzero(~np.isnan(values[:, column]))
            steps = np.diff(values[rows, column])
            wraps = np.abs(np.abs(steps) - turn) < np.pi / 4  # the motion within one sample
            if wraps.any():
                values[rows[1:], column] -= turn * np.cumsum(np.sign(steps) * wraps)
                notes.append(recording.finding("note", "wrap", rows[1:][wraps], signal))
    return replace(recording, values=values), notes


def fill(recording: Recording, longest: float) -> tuple[Recording, list[LogFinding]]:
    """Fill gaps: interpolate angles, hold commands, insert dropped samples.

    A gap is at most `longest` [s] besides the usual step between samples. Rows without a time are dropped,
    and put back if they leave a gap.
    """
    timed = ~np.isnan(recording.time)
    lost = recording.lines[~timed]
    recording = recording.take(np.flatnonzero(timed))
    period = sample_period(recording.time)
    reach = longest * (1 + 1e-9) + period
    recording, added = _insert(recording, period, reach)
    values, time = recording.values.copy(), recording.time
    for column, signal in enumerate(recording.signals[1:], 1):
        whole = ~np.isnan(values[:, column])
        there, holes = np.flatnonzero(whole), np.flatnonzero(~whole)
        after = np.searchsorted(there, holes)
        inside = (after > 0) & (after < len(there))
        holes, before, after = holes[inside], there[after[inside] - 1], there[after[inside]]
        near = time[after] - time[before] <= reach
        if len(holes):
            known = values[there, column]
            between = np.interp(time[holes], time[there], known)
            filled = values[before, column] if signal.kind == "command" else between
            values[holes[near], column] = filled[near]
    filled = np.isnan(recording.values) & ~np.isnan(values) & ~added[:, None]
    mended = recording.lines[filled.any(axis=1) | added]
    recording, lines = replace(recording, values=values), [*mended[:1], *lost[:1]]
    if not lines:
        return recording, []
    counts = {"missing cell": filled.sum(), "dropped sample": added.sum(), "row": len(lost)}
    cells, samples, rows = (f"{n} {noun}{'' if n == 1 else 's'}" for noun, n in counts.items())
    lost_rows = f", {rows} without a time left out" if len(lost) else ""
    first = replace(recording, lines=np.array([min(lines)]))
    return recording, [first.finding("warning", "repair", [0], cells=cells, samples=samples, lost=lost_rows)]


def _insert(recording: Recording, period: float, reach: float) -> tuple[Recording, np.ndarray]:
    """Put rows of NaN where samples are missing; also returns which rows are new, shape (R,)."""
    steps = np.diff(recording.time)
    gaps = (steps > GAP * period) & (steps <= reach)
    copies = np.ones(len(recording.time), dtype=np.int64)
    copies[:-1][gaps] = np.rint(np.minimum(steps[gaps] / period, 1e9)).astype(np.int64)
    if copies.sum() > 2 * len(copies):  # mostly gaps: no repair
        copies[:] = 1
    origin = np.repeat(np.arange(len(copies)), copies)
    nth = np.arange(len(origin)) - np.repeat(np.cumsum(copies) - copies, copies)
    added = nth > 0
    longer = recording.take(origin)
    longer.values[added] = np.nan
    longer.values[:, 0] = recording.time[origin] + nth * np.append(steps, 0.0)[origin] / copies[origin]
    longer.ragged[added] = False
    return longer, added


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
    return len(time) == len(grid) and bool((np.abs(time - time[0] - grid) <= 0.01 * period).all())


def hold(time: Floats, command: Floats, at: Floats, period: float) -> Floats:
    """Return the last command at or before each time in `at` [s]; 0 before the first, shape (len(at), J)."""
    index = np.searchsorted(time, at + 1e-6 * period, side="right") - 1  # but for rounding
    return np.where(index[:, None] >= 0, command[index], 0.0)


def _grid(time: Floats, period: float) -> Floats:
    return period * np.arange(int((time[-1] - time[0]) / period + 0.01) + 1, dtype=np.float64)
