"""Checks of a recording: each function looks for one kind of fault and says where it is and what to do."""

from collections.abc import Iterator

import numpy as np

from hydroid.log.clues import KINDS, column_unit, likely_range
from hydroid.log.finding import LogFinding, together
from hydroid.log.log import Floats
from hydroid.log.repair import GAP, sample_period
from hydroid.log.table import Recording, Signal
from hydroid.settings.log import LogSettings
from hydroid.units import UNITS, likely_time_unit

DEGREE = UNITS["deg"].factor


def check_recording(recording: Recording, settings: LogSettings) -> list[LogFinding]:
    """Return every fault of the recording, in the order in which a user should mend them."""
    return [
        *_holes(recording, settings.repair_s),
        *_time(recording, settings),
        *together(_outside(recording)),
        *_jumps(recording),
        *together(_stated_units(recording)),
    ]


def _holes(recording: Recording, longest: float) -> Iterator[LogFinding]:
    """Rows of too few or too many cells, and cells without a number."""
    torn = np.flatnonzero(recording.ragged)
    if len(torn):
        yield recording.finding("error", "torn row", torn, cells=str(len(recording.table.names)))
    for signal, values in zip(recording.signals, recording.values.T, strict=True):
        rows = np.flatnonzero(np.isnan(values) & ~recording.ragged)
        if len(rows):
            text = recording.table.text(int(recording.lines[rows[0]]), signal.name)
            empty = "the cell is empty" if recording.table.header else "no value is there"
            what = f"{text[:30]!r} is not a number" if text else empty
            kind = "no time" if signal.kind == "time" else "hole"
            yield recording.finding("error", kind, rows, signal, what=what, longest=longest)


def _time(recording: Recording, settings: LogSettings) -> Iterator[LogFinding]:
    """A time that falls, is too short or slow, or has gaps; a row without one is reported elsewhere."""
    signal, rows = recording.signals[0], np.flatnonzero(~np.isnan(recording.time))
    time, steps = recording.time[rows], np.diff(recording.time[rows])
    if len(back := np.flatnonzero(steps <= 0)):
        pair = {"time": time[back[0] + 1], "before": time[back[0]]}
        yield recording.finding("error", "time order", rows[1:][back], signal, **pair)
        return
    period, duration = sample_period(time), np.ptp(time) if len(time) else 0.0
    unit = likely_time_unit(period / signal.gain)
    spelt = {"min": "minutes", "h": "hours", "day": "days"}.get(unit, unit)
    remedy = f"if the time is in {spelt}, set log.time.unit: {unit}" if unit else "set log.time.unit"
    slowest = 10 * settings.period_s  # else held commands would not explain the motion
    if len(time) < 2 or duration < 0.5:
        samples = f"{len(time)} sample{'s' * (len(time) != 1)}"
        yield recording.finding("error", "too short", duration=duration, samples=samples, remedy=remedy)
        return
    if period > slowest:
        yield recording.finding(
            "error", "too slow", (), signal, period=period, slowest=slowest, remedy=remedy
        )
        return
    per_row, longest = steps / np.diff(rows), settings.repair_s
    gaps = np.flatnonzero(steps > (np.diff(rows) - 1 + GAP) * period)
    uneven = np.flatnonzero(np.abs(per_row - period) > 0.25 * period)
    if len(gaps):
        kind = "short gap" if steps[gaps].max() <= longest * (1 + 1e-9) + period else "gap"
        numbers = {"gap": steps[gaps[0]], "period": period, "longest": longest}
        yield recording.finding("error", kind, rows[1:][gaps], signal, **numbers)
    elif len(uneven):
        numbers = {"least": per_row.min(), "most": per_row.max(), "period": period}
        yield recording.finding("warning", "jitter", rows[1:][uneven], signal, **numbers)


def _outside(recording: Recording) -> Iterator[LogFinding]:
    """Values outside their limits; if they are many, another range, unit or sign may explain them."""
    for signal, values in zip(recording.signals, recording.values.T, strict=True):
        rounding = 1e-6 if signal.kind == "command" else 0.0
        rows = np.flatnonzero((values < signal.low - rounding) | (values > signal.high + rounding))
        if len(rows):
            many = len(rows) > 0.05 * (values != 0).sum()
            kind, remedy = _explained(signal, values) if many else ("outside", {})
            unit = {"command": "%", "angle": "deg", "pressure": "bar"}[signal.kind]
            numbers = {"value": values[rows[0]], "low": signal.low, "high": signal.high}
            numbers = {name: number / UNITS[unit].factor for name, number in numbers.items()}
            more = {"quantity": signal.kind, "unit": unit, "column": signal.name}
            yield recording.finding("error", kind, rows, signal, signal.joint, **numbers, **more, **remedy)


def _explained(signal: Signal, values: Floats) -> tuple[str, dict[str, str]]:
    """Return the kind of fault if another unit explains values outside their limits, and what it names."""
    if signal.kind == "command" and (likely := likely_range(values)) and likely.name != "%":
        return "outside in another range", likely.remedy(signal.gain, signal.offset)
    if signal.kind == "angle":
        degrees = abs(abs(signal.gain) - DEGREE) < 1e-12
        scale = f"{-signal.gain / (DEGREE if abs(signal.gain) < 0.1 else 1):g}"
        unit, other = ("rad", values / DEGREE) if degrees else ("deg", values * DEGREE)
        explanations = [
            ("outside in another unit", {"other": unit}, other),
            ("outside, turned", {"scale": scale}, 2 * signal.offset - values),
        ]
        if not degrees and np.nanmax(np.abs(values)) <= np.pi:  # degrees read as radians turn far more
            explanations = explanations[1:]
        for kind, remedy, changed in explanations:
            if np.nanmin(changed) >= signal.low and np.nanmax(changed) <= signal.high:
                return kind, remedy
    return "outside", {}


def _jumps(recording: Recording) -> Iterator[LogFinding]:
    """Check a joint without a range by its speed: no arm turns by 180 deg within one sample."""
    for signal, values in zip(recording.signals, recording.values.T, strict=True):
        if signal.kind == "angle" and not np.isfinite(signal.high):
            rows = np.flatnonzero(~np.isnan(values))
            steps = np.diff(values[rows])
            if len(far := np.flatnonzero(np.abs(steps) > np.pi)):
                step = float(np.rad2deg(steps[far[0]]))
                yield recording.finding("error", "jump", rows[1:][far], signal, step=step)


def _stated_units(recording: Recording) -> Iterator[LogFinding]:
    """Units that the file states and the settings contradict; a time's only where they are plausible."""
    step = sample_period(recording.time)
    for signal in recording.signals:
        unit, gain = column_unit(signal.name, recording.table.units.get(signal.name, "")), abs(signal.gain)
        if unit is None or signal.name in recording.clocks or KINDS.get(unit.quantity) != signal.kind:
            continue
        wrong = {
            "time": gain != unit.factor and unit.name == likely_time_unit(step / gain),
            "angle": gain != unit.factor and gain in (1, DEGREE),
            "command": unit.name != "%" and gain == 1,
        }
        if wrong[signal.kind]:
            yield recording.finding(
                "warning", f"unit of {signal.kind}", (), signal, signal.name, unit=unit.name
            )
