"""A recording's samples -> one period: repairs that invent no data, then commands held,
angles interpolated.

Each command holds until the next one. Where samples are not the new ones, by jitter or
another rate, commands are averaged over each new sample: the arm has felt all of them,
each for as long as it held.

A faster log is thinned by plain interpolation of its angles, without a filter before
it: the fit compares angles sample by sample, and white sensor noise stays what it was,
while a filter would colour it and delay the angle.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from hydroid.arrays import Array
from hydroid.errors import LogError
from hydroid.log.log import Log, LogFinding
from hydroid.log.table import Recording
from hydroid.settings.log import LogSettings

# in sample periods: a longer step is a gap, a shorter one jitter; one dropped sample
# makes it 2
GAP = 1.95
# in periods of the samples or of the settings: a gap that is no longer is bridged
BRIDGED = 3.05
SHORTEST = 0.5  # of a log [s]
MOST_LEFT_OUT = 0.05
"""part of the rows that may hold no numbers"""
MOST_AGAIN = 0.005
"""part of the rows that may stand at a time which has been: more are a clock that was
set back"""


def sample_period(time: Array) -> float:
    """Return the usual step between samples [s]; NaN where there is none."""
    steps = np.diff(time[~np.isnan(time)])
    return np.median(steps[steps > 0]) if (steps > 0).any() else np.nan


def unwrap(recording: Recording, findings: list[LogFinding]) -> Recording:
    """Join angles of continuous joints where they jump by one turn, as an encoder's do.

    None turns by 180 deg within one sample: other jumps are errors.
    """
    values, turn = recording.values, 2 * np.pi
    if all(
        np.isfinite(signal.high) for signal in recording.signals if signal.unit == "deg"
    ):
        return recording
    values = values.copy()
    for signal, column in zip(recording.signals, values.T, strict=True):
        if signal.unit == "deg" and not np.isfinite(signal.high):
            rows = np.flatnonzero(~np.isnan(column))
            steps = np.diff(column[rows])
            # the motion within one sample
            wraps = np.abs(np.abs(steps) - turn) < np.pi / 4
            jumps = (np.abs(steps) > np.pi) & ~wraps
            if wraps.any():
                column[rows[1:]] -= turn * np.cumsum(np.sign(steps) * wraps)
                findings.append(
                    recording.finding("note", "wrap", rows[1:][wraps], signal)
                )
            if jumps.any():
                step = np.rad2deg(steps[jumps][0])
                findings.append(
                    recording.finding(
                        "error", "jump", rows[1:][jumps], signal, step=step
                    )
                )
    return replace(recording, values=values)


def fill(recording: Recording, longest: float, findings: list[LogFinding]) -> Recording:
    """Interpolate angles and hold commands in holes of at most `longest` [s] besides
    the usual step.

    Rows without a time are dropped. Samples that were never recorded are counted:
    `resample` bridges them.
    """
    timed = ~np.isnan(recording.time)
    values, rows = recording.values[timed], recording.rows[timed]
    time, empty = values[:, 0], np.isnan(values)
    period = sample_period(time)
    reach = longest * (1 + 1e-9) + period
    for signal, column in zip(recording.signals[1:], values.T[1:], strict=True):
        there = ~np.isnan(column)
        before = np.maximum.accumulate(np.where(there, time, -np.inf))
        after = np.minimum.accumulate(np.where(there, time, np.inf)[::-1])[::-1]
        holes = ~there & (after - before <= reach)
        if signal.kind == "command":
            last = np.maximum.accumulate(there * np.arange(len(time)))
            column[holes] = column[last[holes]]
        elif holes.any():
            column[holes] = np.interp(time[holes], time[there], column[there])
    steps = np.diff(time)
    added = np.rint(steps[(steps > GAP * period) & (steps <= reach)] / period - 1).sum()
    cells, lost = float((empty & ~np.isnan(values)).sum()), float((~timed).sum())
    if cells or added or lost:
        findings.append(
            recording.finding(
                "warning", "repair", cells=cells, samples=added, lost=lost
            )
        )
    return replace(recording, values=values, rows=rows)


def without_bad_rows(
    recording: Recording,
    settings: LogSettings,
    findings: list[LogFinding],
    *,
    repair: bool,
) -> Recording:
    """Return the rows that can be used, with angles unwrapped and, on request, holes
    filled.

    A row is left out if a cell in it holds no number, or if its time does not follow
    that of the rows before. Where many rows are such, none is left out: the file holds
    something else than the settings say.
    """
    if repair:
        recording = fill(unwrap(recording, findings), settings.repair_s, findings)
    else:
        recording = unwrap(without_cut_end(recording, findings), findings)
    values = recording.values
    bad = np.isnan(values).any(axis=1)
    if 0 < bad.sum() <= max(MOST_LEFT_OUT * len(values), 1):
        rows = np.flatnonzero(bad)
        column = int(np.isnan(values[rows[0]]).argmax())
        torn = np.isnan(values[rows[0]]).all()
        signal = None if torn else recording.signals[column]
        text = (
            ""
            if signal is None
            else recording.table.text(signal.name, int(recording.rows[rows[0]]))
        )
        what = f"{text[:30]!r} is not a number" if text else "no value is there"
        what = (
            f"does not hold {len(recording.table.names)} cells with numbers"
            if torn
            else what
        )
        findings.append(
            recording.finding("warning", "row left out", rows, signal, what=what)
        )
        recording = recording.kept(np.flatnonzero(~bad))
    elif bad.any():
        return recording
    time = recording.time
    again = time[1:] <= np.maximum.accumulate(time)[:-1]
    if 0 < again.sum() <= max(MOST_AGAIN * len(time), 1):
        rows = 1 + np.flatnonzero(again)
        what = f"time does not increase: {time[rows[0]]:.6g} s follows {time[rows[0] - 1]:.6g} s"
        findings.append(
            recording.finding(
                "warning", "row left out", rows, recording.signals[0], what=what
            )
        )
        recording = recording.kept(np.delete(np.arange(len(time)), rows))
    return recording


def without_cut_end(recording: Recording, findings: list[LogFinding]) -> Recording:
    """Leave out the last row if it is cut off, as when a logger is killed: its last
    cell holds no number."""
    table, values = recording.table, recording.values
    if table.header is None or len(values) < 2:
        return recording
    ends = [
        column
        for column, signal in enumerate(recording.signals)
        if signal.name == table.names[-1]
    ]
    cut = np.isnan(values[-1]).all() or any(
        np.isnan(values[-1, column]) for column in ends
    )
    if not cut or np.isnan(values[-2]).all():
        return recording
    findings.append(recording.finding("warning", "cut end", [len(values) - 1]))
    return recording.kept(slice(None, -1))


def between_gaps(
    recording: Recording,
    settings: LogSettings,
    findings: list[LogFinding],
    *,
    repair: bool,
) -> list[Recording]:
    """Return the parts of a recording between gaps, without those shorter than
    SHORTEST.

    Gaps of up to two samples, or with `repair` of up to `settings.repair_s` besides the
    usual step, are none: `resample` bridges them. Raises LogError: no part is long
    enough.
    """
    time, signal = recording.time, recording.signals[0]
    steps, period = np.diff(time), sample_period(time)
    bridged = BRIDGED * max(period, settings.period_s)
    if repair:
        bridged = max(bridged, settings.repair_s * (1 + 1e-9) + period)
    lost = 1 + np.flatnonzero((steps > GAP * period) & (steps <= bridged))
    if len(lost) and not repair:
        samples = float(np.rint(steps[lost - 1] / period - 1).sum())
        findings.append(
            recording.finding("warning", "lost", lost, signal, samples=samples)
        )
    gaps = 1 + np.flatnonzero(steps > bridged)
    ends = [0, *gaps.tolist(), len(time)]
    every = [slice(first, end) for first, end in pairwise(ends)]
    kept = [
        rows for rows in every if time[rows.stop - 1] - time[rows.start] >= SHORTEST
    ]
    if not kept:
        hint = "log at a higher rate, or use --repair"
        raise LogError(
            f"has no part of {SHORTEST} s without a gap", recording.table.source, hint
        )
    if len(gaps):
        first, left = gaps[0], len(every) - len(kept)
        numbers = {
            "gap": time[first] - time[first - 1],
            "period": period,
            "parts": float(len(kept)),
        }
        more = f", {left} shorter than {SHORTEST:g} s left out" if left else ""
        findings.append(
            recording.finding("warning", "gap", gaps, signal, **numbers, left=more)
        )
    return [recording.kept(at) for at in kept]


def resample(recording: Recording, settings: LogSettings, joints: int) -> Log:
    """Bring a recording without holes to the period of the settings, from its first
    sample to its last.

    Commands act `settings.delay_s` later than logged, and are 0 % before the first one
    acts. On a finer grid they change on a line from sample to sample: when between them
    is not known.
    """
    period, time = settings.period_s, recording.time - recording.time[0]
    grid = period * np.arange(int(time[-1] / period + 0.01) + 1, dtype=np.float64)
    exact = on_grid(time, period)
    time = time if exact is None else exact  # on the grid values pass unchanged
    shape = len(grid), joints
    command, angle, pressure = np.zeros(shape), np.full(shape, np.nan), None
    given = dict[int, Array]()
    for signal, values in zip(
        recording.signals[1:], recording.values.T[1:], strict=True
    ):
        joint = signal.joint - 1
        if signal.kind == "command":
            given[joint] = given.get(joint, 0.0) + (-values if signal.part else values)
        elif signal.kind == "angle":
            angle[:, joint] = np.interp(grid, time, values)
        else:
            pressure = np.full((*shape, 2), np.nan) if pressure is None else pressure
            pressure[:, joint, signal.part] = np.interp(grid, time, values)
    at, slower = grid - settings.delay_s, period <= 0.8 * sample_period(time)
    for joint, own in given.items():
        values = own.clip(-100, 100)
        if slower:
            command[:, joint] = np.interp(at + 0.5 * period, time, values, left=0.0)
        else:
            command[:, joint] = hold(time, values[:, None], at, period)[:, 0]
    recorded = np.zeros(len(grid), dtype=bool)
    recorded[np.minimum(np.rint(time / period).astype(np.int64), len(grid) - 1)] = True
    return Log(
        recording.table.source,
        grid,
        command.clip(-100, 100, out=command),
        angle,
        period,
        pressure,
        recorded=None if recorded.all() else recorded,
    )


def on_grid(time: Array, period: float) -> Array | None:
    """Return times as multiples of a period; None if any is off by more than 1 % of the
    period."""
    steps = np.rint(time / period)
    return period * steps if (np.abs(time / period - steps) <= 0.01).all() else None


def hold(time: Array, command: Array, at: Array, period: float) -> Array:
    """Return the command for a period from each time in `at` [s]; 0 before the first,
    shape (len(at), J).

    Each sample holds until the next one. Of samples on the periods' own grid it is the
    last one at or before that time; of others, of a faster log or one with jitter, the
    mean over the period: the last one would be too old by up to a period.
    """
    exact = on_grid(time, period)
    if exact is None:
        steps = np.diff(time, prepend=time[0])[:, None]
        areas = np.cumsum(steps * np.roll(command, 1, axis=0), axis=0)

        def area(end: Array) -> Array:
            """Return the integral of the command until some times [% s]."""
            index = np.searchsorted(time, end, side="right") - 1
            since = (end - time[index])[:, None]
            return np.where(
                index[:, None] >= 0, areas[index] + since * command[index], 0.0
            )

        return (area(at + period) - area(at)) / period
    # but for rounding
    index = np.searchsorted(exact, at + 1e-6 * period, side="right") - 1
    return np.where(index[:, None] >= 0, command[index], 0.0)
