"""Faults of a sensor or a logger that the readings of one angle show: leaps, and steps
that are too coarse.

A spike, a drop-out to zero, a zero point that shifts, and seconds that were cut out and
renumbered all make an angle leap within one sample, as no joint moves: faster than it
ever does elsewhere, and in between samples in which it hardly moves.
"""

from collections.abc import Iterator

import numpy as np

from hydroid.arrays import Array, Index
from hydroid.log.log import LogFinding
from hydroid.log.repair import GAP, sample_period
from hydroid.log.table import Recording

LEAST_LEAP = np.radians(1.0)
"""of an angle within one sample [rad]; positions [m] take the same number, about 17
mm"""
LEAST_SPEED = np.radians(100.0)
"""of a leap [rad/s, m/s]"""
ABOVE_USUAL = 3.0
"""how many times larger a leap is than nearly all steps of the log"""
ABOVE_NEAR = 5.0
"""how many times larger a leap is than the steps around it"""
NEARLY_ALL = 99.5
"""[%]"""
LEAST_STEPS = 10
"""in a log, below which none is unusual"""
COARSE = np.radians(0.5)
"""steps of a sensor [rad] that hide how a joint starts and stops"""
FEW_STEPS = 3
"""that a joint must pass before their size counts"""


def check_sensors(recording: Recording) -> Iterator[LogFinding]:
    """Yield where angles leap, and which have coarse steps."""
    time = recording.time
    for signal, values in zip(recording.signals, recording.values.T, strict=True):
        if signal.kind != "angle":
            continue
        rows = leaps(time, values)
        if len(rows):
            first = rows[0]
            size = abs(values[first] - values[first - 1])
            by = signal.shown.way(np.rad2deg(size))
            yield recording.finding(
                "warning", "leap", rows, signal, signal.owner, by=by
            )
        step = resolution(values)
        if step < COARSE:
            continue
        travel = np.nanmax(values) - np.nanmin(values)
        if travel > FEW_STEPS * step:
            by = signal.shown.way(np.rad2deg(step))
            yield recording.finding("note", "coarse", (), signal, signal.owner, by=by)


def leaps(time: Array, angle: Array) -> Index:
    """Return the rows after leaps of an angle [rad], (R,), but for gaps in the time
    [s], (R,)."""
    period = sample_period(time)
    steps = np.abs(np.diff(angle))
    whole = np.diff(time) <= GAP * period
    steps = np.where(whole & np.isfinite(steps), steps, 0.0)
    if len(steps) < LEAST_STEPS:
        return np.zeros(0, np.intp)
    usual = np.percentile(steps, NEARLY_ALL)
    least = max(LEAST_LEAP, LEAST_SPEED * period, ABOVE_USUAL * usual)
    large = np.flatnonzero(steps > least)
    # a leap and the one back may be up to three samples apart: the largest step nearby
    # does not count
    around = large[:, None] + [-4, -3, -2, 2, 3, 4]
    around = around.clip(0, len(steps) - 1)
    near = np.sort(steps[around], axis=1)[:, -2]
    return 1 + large[steps[large] > ABOVE_NEAR * near]


def resolution(angle: Array) -> float:
    """Return the smallest difference between readings [rad]; 0 where all are alike."""
    readings = np.unique(angle[np.isfinite(angle)])
    differences = np.diff(readings)
    # smaller ones are rounding
    differences = differences[differences > 1e-9]
    if not len(differences):
        return 0.0
    return float(differences.min())
