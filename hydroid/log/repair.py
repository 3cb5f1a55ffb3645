"""A recording's samples -> one period: repairs that invent no data, then commands held, angles interpolated.

A faster log is thinned by plain interpolation of its angles, without a filter before it: the fit compares
angles sample by sample, and white sensor noise stays what it was, while a filter would colour it and delay
the angle. Its commands are averaged over each new sample: the arm has felt all of them.
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


def unwrap(recording: Recording, findings: list[LogFinding]) -> Recording:
    """Join angles of continuous joints where they jump by one turn, as an encoder's do."""
    values, turn = recording.values.copy(), 2 * np.pi
    for column, signal in enumerate(recording.signals):
        if signal.unit == "deg" and not np.isfinite(signal.high):
            rows = np.flatnonzero(~np.isnan(values[:, column]))
            steps = np.diff(values[rows, column])
            wraps = np.abs(np.abs(steps) - turn) < np.pi / 4  # the motion within one sample
            if wraps.any():
                values[rows[1:], column] -= turn * np.cumsum(np.sign(steps) * wraps)
                findings.append(recording.finding("note", "wrap", rows[1:][wraps], signal))
    return replace(recording, values=values)


def fill(recording: Recording, longest: float, findings: list[LogFinding]) -> Recording:
    """Interpolate angles and hold commands in holes of at most `longest` [s] besides the usual step.

    Rows without a time are dropped. Samples that were never recorded are counted: `resample` bridges them.
    """
    timed = ~np.isnan(recording.time)
    lost = recording.lines[~timed]
    recording = recording.take(np.flatnonzero(timed))
    time, period, values = recording.time, sample_period(recording.time), recording.values.copy()
    reach = longest * (1 + 1e-9) + period
    for signal, column in zip(recording.signals[1:], values.T[1:], strict=True):
        there, holes = np.flatnonzero(~np.isnan(column)), np.flatnonzero(np.isnan(column))
        after = np.searchsorted(there, holes)
        inside = (after > 0) & (after < len(there))
        holes, before, after = holes[inside], there[after[inside] - 1], there[after[inside]]
        near = time[after] - time[before] <= reach
        holes, before = holes[near], before[near]
        if signal.kind == "command":
            column[holes] = column[before]
        elif len(holes):
            column[holes] = np.interp(time[holes], time[there], column[there])
    filled = np.isnan(recording.values) & ~np.isnan(values)
    steps = np.diff(time, append=time[-1:])
    short = (steps > GAP * period) & (steps <= reach)
    mended = [*recording.lines[filled.any(axis=1) | short], *lost]
    if mended:
        first = replace(recording, lines=np.array([min(mended)]))
        added = np.rint(steps[short] / period - 1).sum()
        count = {"cells": float(filled.sum()), "samples": float(added), "lost": float(len(lost))}
        findings.append(first.finding("warning", "repair", [0], None, None, **count))
    return replace(recording, values=values)


def resample(
    time: Floats, command: Floats, angle: Floats, period: float, delay: float = 0.0
) -> tuple[Floats, Floats, Floats]:
    """Bring a recording to the grid k · period [s], from its first sample to its last.

    Commands, shape (R, J), act `delay` [s] later than logged, and are 0 % before the first one acts. On a
    finer grid they change on a line from sample to sample: when between them is not known. Angles
    and other signals that are interpolated have the shape (R, M); times [s] increase strictly.

    Returns:
        Grid [s] from 0, shape (T,); command and angle, shapes (T, J) and (T, M).
    """
    time = time - time[0]
    grid = period * np.arange(int(time[-1] / period + 0.01) + 1, dtype=np.float64)
    if is_on_grid(time, period):
        time = period * np.rint(time / period)  # whose values then pass unchanged
    angle = np.stack([np.interp(grid, time, column) for column in angle.T], axis=1)
    at = grid - delay
    if period > 0.8 * sample_period(time):
        return grid, hold(time, command, at, period), angle
    middle = at + 0.5 * period
    lines = np.stack([np.interp(middle, time, column, left=0.0) for column in command.T], axis=1)
    return grid, lines, angle


def is_on_grid(time: Floats, period: float) -> bool:
    """Return whether all samples stand on multiples of the period after the first."""
    steps = (time - time[0]) / period
    return bool((np.abs(steps - np.rint(steps)) <= 0.01).all())


def hold(time: Floats, command: Floats, at: Floats, period: float) -> Floats:
    """Return the command for a period from each time in `at` [s]; 0 before the first, shape (len(at), J).

    It is the last one at or before that time, or where several fit into a period their mean over it.
    """
    if period > 1.2 * sample_period(time):  # jitter alone does not make a log a faster one
        steps = np.diff(time, prepend=time[0])[:, None]
        areas = np.cumsum(steps * np.roll(command, 1, axis=0), axis=0)

        def area(end: Floats) -> Floats:
            """Return the integral of the command until some times [% s]."""
            index = np.searchsorted(time, end, side="right") - 1
            since = (end - time[index])[:, None]
            return np.where(index[:, None] >= 0, areas[index] + since * command[index], 0.0)

        return (area(at + period) - area(at)) / period
    index = np.searchsorted(time, at + 1e-6 * period, side="right") - 1  # but for rounding
    return np.where(index[:, None] >= 0, command[index], 0.0)
