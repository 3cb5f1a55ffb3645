"""What can be wrong with a record: each function looks for one kind of fault, says where and what to do."""

from collections.abc import Iterator, Sequence

import numpy as np

from hydroid.log.channels import Channel, Record
from hydroid.log.finding import Finding
from hydroid.log.log import Floats
from hydroid.settings.log import LogSettings

GAP = 1.5  # a step this many sample periods long lacks a sample
JITTER = 0.25  # of the sample period: steps that vary more are mentioned
SLOWEST = 10  # file's period over the wanted one: above, a held command says nothing about the motion
ROUNDING = 1e-6  # [%], of a scaled command


def check_record(record: Record, settings: LogSettings, outputs: Sequence[int]) -> list[Finding]:
    """Return every fault of the record, in the order in which a user should mend them."""
    return [
        *_ragged(record),
        *_holes(record),
        *_time(record, settings),
        *_outside(record),
        *_jumps(record),
        *_constant(record, outputs),
    ]


def sample_period(time: Floats) -> float:
    """Return the usual step between samples [s]; NaN where there is none."""
    steps = np.diff(time[~np.isnan(time)])
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else np.nan


def _ragged(record: Record) -> Iterator[Finding]:
    rows = np.flatnonzero(record.ragged)
    if len(rows):
        what = f"the row does not have {len(record.table.names)} cells as the header has"
        yield record.finding("error", what, "mend or delete the line, or fill it with --repair", rows)


def _holes(record: Record) -> Iterator[Finding]:
    for column, channel in enumerate(record.channels):
        rows = np.flatnonzero(np.isnan(record.values[:, column]) & ~record.ragged)
        if not len(rows):
            continue
        text = record.text(rows[0], column)
        what = f"{text[:30]!r} is not a number" if text else "the cell is empty"
        hint = "mend the cell, or use --repair, which bridges holes up to log.repair_s"
        if channel.kind == "time":
            hint = "time is a number in log.time.unit (s or ms), not a date or clock time"
        yield record.finding("error", what, hint, rows, channel)


def _time(record: Record, settings: LogSettings) -> Iterator[Finding]:
    channel, rows = record.channels[0], np.flatnonzero(~np.isnan(record.time))
    time, steps = record.time[rows], np.diff(record.time[rows])
    back = rows[1:][steps <= 0]
    if len(back):
        at = np.flatnonzero(steps <= 0)[0]
        what = f"time does not increase: {time[at + 1]:.12g} s follows {time[at]:.12g} s"
        hint = "delete or sort the lines, or log the time with more digits"
        yield record.finding("error", what, hint, back, channel)
        return
    duration = time[-1] - time[0] if len(time) else 0.0
    if len(time) < 2 or duration < settings.shortest_s:
        what = f"holds {len(time)} samples over {duration:.6g} s, fewer than {settings.shortest_s:g} s"
        hint = "give a longer log, set log.time.unit if it is wrong, or lower log.shortest_s"
        yield record.finding("error", what, hint)
        return
    period = sample_period(time)
    if period > SLOWEST * settings.period_s:
        what = f"has a sample every {period:.6g} s, at most {SLOWEST * settings.period_s:g} s can be used"
        yield record.finding("error", what, "log faster, or set log.time.unit if it is wrong", (), channel)
    yield from _steps(record, steps, rows, period, settings.repair_s)


def _steps(
    record: Record, steps: Floats, rows: np.ndarray, period: float, longest: float
) -> Iterator[Finding]:
    """Gaps, and steps that vary; a row without a time counts as a sample here, and is reported for that."""
    channel, per_row = record.channels[0], steps / np.diff(rows)
    gaps = np.flatnonzero(steps > (np.diff(rows) - 1 + GAP) * period)
    if len(gaps):
        worst = steps[gaps].max()
        what = f"{steps[gaps[0]]:.6g} s without a sample, the usual step is {period:.6g} s"
        hint = (
            "fill it with --repair"
            if worst <= longest * (1 + 1e-9) + period
            else (f"cut the log into two files there (--repair bridges up to log.repair_s: {longest:g})")
        )
        yield record.finding("error", what, hint, rows[1:][gaps], channel)
        return
    uneven = np.flatnonzero(np.abs(per_row - period) > JITTER * period)
    if len(uneven):
        what = f"sample period varies from {per_row.min():.4g} to {per_row.max():.4g} s around {period:.4g} s"
        yield record.finding(
            "warning", what, "commands are held and angles interpolated", rows[1:][uneven], channel
        )


def _outside(record: Record) -> Iterator[Finding]:
    for channel, values in zip(record.channels, record.values.T, strict=True):
        rounding = ROUNDING if channel.kind == "command" else 0.0
        rows = np.flatnonzero((values < channel.low - rounding) | (values > channel.high + rounding))
        if not len(rows):
            continue
        to_unit, unit, hint = _presented(channel)
        value, low, high = (to_unit * x for x in (values[rows[0]], channel.low, channel.high))
        what = f"{channel} is {value:.6g} {unit}, allowed are {low:.6g} to {high:.6g} {unit}"
        yield record.finding("error", what, hint, rows, channel)


def _presented(channel: Channel) -> tuple[float, str, str]:
    if channel.kind == "command":
        return 1.0, "%", "correct the cells, or log.command's scale and offset"
    if channel.kind == "pressure":
        return 1e-5, "bar", "correct the cells, or log.pressure's unit, scale and offset"
    hint = "correct the cells, log.angle's unit, scale and offset, or the joint's range"
    return 180 / np.pi, "deg", hint


def _jumps(record: Record) -> Iterator[Finding]:
    """A joint without a range is checked by its speed: no arm turns half a turn within one sample."""
    for channel, values in zip(record.channels, record.values.T, strict=True):
        if channel.kind != "angle" or np.isfinite(channel.high):
            continue
        rows = np.flatnonzero(~np.isnan(values))
        steps = np.diff(values[rows])
        far = rows[1:][np.abs(steps) > np.pi]
        if len(far):
            first = np.rad2deg(steps[np.abs(steps) > np.pi][0])
            what = f"{channel} jumps by {first:.6g} deg from one sample to the next"
            yield record.finding(
                "error", what, "correct the cells, or log.angle's unit and scale", far, channel
            )


def _constant(record: Record, outputs: Sequence[int]) -> Iterator[Finding]:
    command, angle = record.signals(max((c.joint for c in record.channels), default=0))
    names = {(c.kind, c.joint): c for c in reversed(record.channels)}
    for joint in range(1, command.shape[1] + 1):
        u, q = command[:, joint - 1], angle[:, joint - 1]
        driven, still = np.nan_to_num(u).any(), _is_constant(q)
        if ("angle", joint) in names and still and (driven or joint in outputs):
            what = f"angle of joint {joint} never changes" + (" though it is driven" if driven else "")
            hint = "check the sensor and the mapping of log.angle"
            yield record.finding("warning", what, hint, (), names["angle", joint])
        if ("command", joint) in names and joint in outputs and _is_constant(u):
            what = f"command of output joint {joint} is constant at {np.nanmax(u):g} %"
            hint = "one such log alone tells little: fit it together with others"
            yield record.finding("warning", what, hint, (), names["command", joint])


def _is_constant(values: Floats) -> bool:
    there = values[~np.isnan(values)]
    return len(there) > 0 and bool((there == there[0]).all())
