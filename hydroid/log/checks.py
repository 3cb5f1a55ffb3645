"""Checks of a recording: each function looks for one kind of fault and says where it is and what to do."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from hydroid.log.log import Finding, Floats, numbered
from hydroid.log.signals import Recording, Signal
from hydroid.log.suspicion import outside_hint, time_hint, unit_findings
from hydroid.settings.log import LogSettings

GAP = 1.95  # in sample periods: a longer step is a gap, a shorter one jitter; one dropped sample makes it 2
JITTER = 0.25  # in sample periods: a larger variation of the steps is a warning
SLOWEST = 10  # largest ratio of the file's period to log.period_s: held commands would not explain the motion
ROUNDING = 1e-6  # [%], of a scaled command
PRESENTED = {
    "command": (1.0, "%", "correct the cells, or log.command's scale and offset"),
    "angle": (
        180 / np.pi,
        "deg",
        "correct the cells, log.angle's unit, scale and offset, or the joint's range",
    ),
    "pressure": (1e-5, "bar", "correct the cells, or log.pressure's unit, scale and offset"),
}
"""of values outside their limits: factor to the unit they are shown in, this unit, and the hint"""


def check_recording(
    recording: Recording, settings: LogSettings, outputs: Sequence[int], *, repaired: bool = False
) -> list[Finding]:
    """Return every fault of the recording, in the order in which a user should mend them."""
    return [
        *_ragged(recording),
        *_holes(recording, settings.repair_s, repaired),
        *_time(recording, settings),
        *_outside(recording),
        *_jumps(recording),
        *_constant(recording, outputs),
        *unit_findings(recording),
    ]


def sample_period(time: Floats) -> float:
    """Return the usual step between samples [s]; NaN where there is none."""
    steps = np.diff(time[~np.isnan(time)])
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else np.nan


def _ragged(recording: Recording) -> Iterator[Finding]:
    rows = np.flatnonzero(recording.ragged)
    if len(rows):
        what = f"the row should have {len(recording.file.names)} cells, as the header has"
        yield recording.finding(
            "error", what, "correct or delete the line, or use --repair", rows, None, "row"
        )


def _holes(recording: Recording, longest: float, repaired: bool) -> Iterator[Finding]:
    for column, signal in enumerate(recording.signals):
        rows = np.flatnonzero(np.isnan(recording.values[:, column]) & ~recording.ragged)
        if not len(rows):
            continue
        text = recording.text(rows[0], column)
        empty = "the cell is empty" if recording.file.header else "no value is there"
        what = f"{text[:30]!r} is not a number" if text else empty
        hint = (
            f"correct the cell, or use --repair, which fills bad cells of up to {longest:g} s (log.repair_s)"
        )
        if repaired:
            hint = (
                f"correct the cell; --repair fills only between good cells, up to {longest:g} s "
                "(log.repair_s)"
            )
        if signal.kind == "time":
            hint = "time is a number in log.time.unit, or a time of day (12:30:05.25), with or without date"
        yield recording.finding("error", what, hint, rows, signal, "hole")


def _time(recording: Recording, settings: LogSettings) -> Iterator[Finding]:
    signal, rows = recording.signals[0], np.flatnonzero(~np.isnan(recording.time))
    time, steps = recording.time[rows], np.diff(recording.time[rows])
    back = rows[1:][steps <= 0]
    if len(back):
        at = np.flatnonzero(steps <= 0)[0]
        what = f"time does not increase: {time[at + 1]:.12g} s follows {time[at]:.12g} s"
        hint = "delete or sort the lines, or log the time with more digits"
        yield recording.finding("error", what, hint, back, signal, "time order")
        return
    duration = time[-1] - time[0] if len(time) else 0.0
    if len(time) < 2 or duration < settings.shortest_s:
        samples = "1 sample" if len(time) == 1 else f"{len(time)} samples"
        what = f"lasts {duration:.6g} s ({samples}); at least {settings.shortest_s:g} s is needed"
        hint = "give a longer log, set log.time.unit if it is wrong, or lower log.shortest_s"
        hint = time_hint(recording, sample_period(time)) or hint
        yield recording.finding("error", what, hint, kind="duration")
        return
    period = sample_period(time)
    if period > SLOWEST * settings.period_s:
        what = f"has a sample every {period:.6g} s, at most {SLOWEST * settings.period_s:g} s can be used"
        hint = time_hint(recording, period) or "log faster, or set log.time.unit if it is wrong"
        yield recording.finding("error", what, hint, (), signal, "period")
    yield from _steps(recording, steps, rows, period, settings.repair_s)


def _steps(
    recording: Recording, steps: Floats, rows: np.ndarray, period: float, longest: float
) -> Iterator[Finding]:
    """Gaps, and steps that vary; a row without a time counts as a sample, since it is reported elsewhere."""
    signal, per_row = recording.signals[0], steps / np.diff(rows)
    gaps = np.flatnonzero(steps > (np.diff(rows) - 1 + GAP) * period)
    uneven = np.flatnonzero(np.abs(per_row - period) > JITTER * period)
    if len(gaps):
        what = f"{steps[gaps[0]]:.6g} s without a sample, the usual step is {period:.6g} s"
        hint = f"cut the log into two files there (--repair fills gaps up to log.repair_s: {longest:g} s)"
        if steps[gaps].max() <= longest * (1 + 1e-9) + period:
            hint = "fill it with --repair"
        yield recording.finding("error", what, hint, rows[1:][gaps], signal, "gap")
    elif len(uneven):
        what = f"sample period varies from {per_row.min():.4g} to {per_row.max():.4g} s around {period:.4g} s"
        hint = "commands are held and angles interpolated"
        yield recording.finding("warning", what, hint, rows[1:][uneven], signal, "jitter")


def _outside(recording: Recording) -> Iterator[Finding]:
    """Values outside their limits: a finding for each signal, or one for all that another unit explains."""
    faults: dict[str, list[tuple[Signal, NDArray[np.int64], float]]] = {}
    for signal, values in zip(recording.signals, recording.values.T, strict=True):
        rounding = ROUNDING if signal.kind == "command" else 0.0
        rows = np.flatnonzero((values < signal.low - rounding) | (values > signal.high + rounding))
        if len(rows):
            hint = outside_hint(recording, signal, values) or f"{PRESENTED[signal.kind][2]} of {signal}"
            faults.setdefault(hint, []).append((signal, rows, values[rows[0]]))
    for hint, ((signal, rows, first), *others) in faults.items():
        to_unit, unit, usual = PRESENTED[signal.kind]
        value, low, high = (to_unit * x for x in (first, signal.low, signal.high))
        what = f"{signal} is {value:.6g} {unit}, allowed are {low:.6g} to {high:.6g} {unit}"
        if others:
            what += f", and {signal.kind}s of {numbered([other.joint for other, *_ in others])} likewise"
        hint = usual if hint.startswith(usual) else hint
        yield recording.finding("error", what, hint, rows, signal, "outside")


def _jumps(recording: Recording) -> Iterator[Finding]:
    """Check a joint without a range by its speed: no arm turns by 180 deg within one sample."""
    for signal, values in zip(recording.signals, recording.values.T, strict=True):
        if signal.kind != "angle" or np.isfinite(signal.high):
            continue
        rows = np.flatnonzero(~np.isnan(values))
        steps = np.diff(values[rows])
        far = rows[1:][np.abs(steps) > np.pi]
        if len(far):
            first = np.rad2deg(steps[np.abs(steps) > np.pi][0])
            what = f"{signal} jumps by {first:.6g} deg from one sample to the next"
            hint = "correct the cells, or log.angle's unit and scale"
            yield recording.finding("error", what, hint, far, signal, "jump")


def _constant(recording: Recording, outputs: Sequence[int]) -> Iterator[Finding]:
    command, angle = recording.motions()
    names = {(c.kind, c.joint): c for c in reversed(recording.signals)}
    joints = range(1, command.shape[1] + 1)
    driven = {j for j in joints if np.nan_to_num(command[:, j - 1]).any()}
    still = [j for j in joints if ("angle", j) in names and _is_constant(angle[:, j - 1])]
    still = [j for j in still if j in driven or j in outputs]
    if still:
        what = f"angle of {numbered(still)} never changes"
        what += " though it is driven" if len(still) == 1 and still[0] in driven else ""
        hint = "check the sensor and log.angle"
        yield recording.finding("warning", what, hint, (), names["angle", still[0]], "angle is constant")
    held = [j for j in joints if j in outputs and ("command", j) in names and _is_constant(command[:, j - 1])]
    if held:
        what = f"command of {numbered(held)}, whose angle is compared, is constant"
        hint = "such a log alone says little: fit it together with others"
        yield recording.finding("warning", what, hint, (), names["command", held[0]], "command is constant")


def _is_constant(values: Floats) -> bool:
    there = values[~np.isnan(values)]
    return len(there) > 0 and bool((there == there[0]).all())
