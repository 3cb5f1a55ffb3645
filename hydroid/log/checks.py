"""Checks of a recording: each function looks for one kind of fault and says where it is and what to do."""

from collections.abc import Iterator

import numpy as np

from hydroid.log.clues import KINDS, column_unit, likely_range
from hydroid.log.finding import LogFinding
from hydroid.log.log import Floats
from hydroid.log.repair import GAP, sample_period
from hydroid.log.table import Recording, Signal
from hydroid.settings.log import LogSettings
from hydroid.units import UNITS, likely_time_unit

DEGREE = UNITS["deg"].factor


def check_recording(recording: Recording, settings: LogSettings, *, repaired: bool) -> list[LogFinding]:
    """Return every fault of the recording, in the order in which a user should mend them.

    `repaired`: gaps up to `settings.repair_s` are no faults.
    """
    return [
        *_holes(recording, settings.repair_s),
        *_time(recording, settings, repaired),
        *_values(recording),
        *_stated_units(recording),
    ]


def _holes(recording: Recording, longest: float) -> Iterator[LogFinding]:
    """Rows of too few or too many cells, and cells without a number."""
    if recording.torn.any():
        cells = str(len(recording.table.names))
        yield recording.finding("error", "torn row", np.flatnonzero(recording.torn), cells=cells)
    for signal, values in zip(recording.signals, recording.values.T, strict=True):
        rows = np.flatnonzero(np.isnan(values) & ~recording.torn)
        if len(rows):
            text = recording.text(int(rows[0]), signal)
            what = f"{text[:30]!r} is not a number" if text else "no value is there"
            kind = "no time" if signal.kind == "time" else "hole"
            yield recording.finding("error", kind, rows, signal, what=what, longest=longest)


def _time(recording: Recording, settings: LogSettings, repaired: bool) -> Iterator[LogFinding]:
    """A time that falls, is too short or slow, or has gaps; a row without one is reported elsewhere."""
    signal, rows = recording.signals[0], np.flatnonzero(~np.isnan(recording.time))
    time = recording.time[rows]
    steps, apart = np.diff(time), np.diff(rows)
    if len(back := np.flatnonzero(steps <= 0)):
        pair = {"time": time[back[0] + 1], "before": time[back[0]]}
        yield recording.finding("error", "time order", rows[1:][back], signal, **pair)
        return
    period, duration = sample_period(time), np.ptp(time) if len(time) else 0.0
    unit = likely_time_unit(period / signal.gain)
    remedy = f"if its unit is {unit}, set log.time.unit: {unit}" if unit else "set log.time.unit"
    slowest = 10 * settings.period_s  # else held commands would not explain the motion
    if len(time) < 2 or duration < 0.5:
        count = float(len(time))
        yield recording.finding("error", "too short", duration=duration, samples=count, remedy=remedy)
        return
    if period > slowest:
        numbers = {"period": period, "slowest": slowest, "remedy": remedy}
        yield recording.finding("error", "too slow", (), signal, **numbers)
        return
    longest, per_row = settings.repair_s, steps / apart
    short = steps <= longest * (1 + 1e-9) + period
    gaps = np.flatnonzero((steps > (apart - 1 + GAP) * period) & ~(repaired & short))
    bridged = per_row > GAP * period
    uneven = np.flatnonzero((np.abs(per_row - period) > 0.25 * period) & ~bridged)
    if len(gaps):
        numbers = {"gap": steps[gaps[0]], "period": period, "longest": longest}
        yield recording.finding("error", "gap", rows[1:][gaps], signal, **numbers)
    elif len(uneven):
        numbers = {"least": per_row.min(), "most": per_row[~bridged].max(), "period": period}
        yield recording.finding("warning", "jitter", rows[1:][uneven], signal, **numbers)


def _values(recording: Recording) -> Iterator[LogFinding]:
    """Values outside their limits, which another range, unit or sign may explain if they are many.

    A joint without limits is checked by its speed: none turns by 180 deg within one sample.
    """
    for signal, values in zip(recording.signals, recording.values.T, strict=True):
        rows = np.flatnonzero((values < signal.low - 1e-6) | (values > signal.high + 1e-6))
        if len(rows):
            many = len(rows) > 0.05 * (values != 0).sum()
            kind, remedy = _explained(signal, values) if many else ("outside", {})
            numbers = {"value": values[rows[0]], "low": signal.low, "high": signal.high}
            shown = {name: number / UNITS[signal.unit].factor for name, number in numbers.items()}
            names = {"quantity": signal.kind, "unit": signal.unit, "column": signal.name}
            yield recording.finding("error", kind, rows, signal, signal.joint, **names, **shown, **remedy)
        if signal.unit == "deg" and not np.isfinite(signal.high):
            there = np.flatnonzero(~np.isnan(values))
            steps = np.rad2deg(np.diff(values[there]))
            if len(far := np.flatnonzero(np.abs(steps) > 180)):
                yield recording.finding("error", "jump", there[1:][far], signal, step=steps[far[0]])


def _explained(signal: Signal, values: Floats) -> tuple[str, dict[str, str]]:
    """Return the kind of fault if another unit explains values outside their limits, and what it names."""
    if signal.kind == "command" and (likely := likely_range(values)) and likely.name != "%":
        return "outside in another range", likely.remedy(signal.gain, signal.offset)
    if signal.unit == "deg":
        degrees = abs(signal.gain) < 0.1
        unit, other = ("rad", values / DEGREE) if degrees else ("deg", values * DEGREE)
        scale = f"{-signal.gain / (DEGREE if degrees else 1):g}"
        explanations = [("outside, turned", {"scale": scale}, 2 * signal.offset - values)]
        if degrees or np.nanmax(np.abs(values)) > np.pi:  # degrees read as radians turn far more
            explanations.insert(0, ("outside in another unit", {"other": unit}, other))
        for kind, remedy, changed in explanations:
            if np.nanmin(changed) >= signal.low and np.nanmax(changed) <= signal.high:
                return kind, remedy
    return "outside", {}


def _stated_units(recording: Recording) -> Iterator[LogFinding]:
    """Units that the file states and the settings contradict; a time's only where they are plausible."""
    step = sample_period(recording.time)
    for signal in recording.signals:
        unit, gain = column_unit(signal.name, recording.table.units.get(signal.name, "")), abs(signal.gain)
        if unit is None or signal.name in recording.clocks or KINDS.get(unit.quantity) != signal.kind:
            continue
        wrong = {
            "time": gain != unit.factor and unit.name == likely_time_unit(step / gain),
            "angle": unit.quantity == "angle" and gain != unit.factor and gain in (1, DEGREE),
            "command": unit.name != "%" and gain == 1,
        }
        if wrong[signal.kind]:
            kind = f"unit of {signal.kind}"
            yield recording.finding("warning", kind, (), signal, signal.name, unit=unit.name)
