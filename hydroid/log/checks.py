"""Checks of a recording: each function looks for one kind of fault and says where it is and what to do."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from hydroid.log.columns import Recording, Signal
from hydroid.log.finding import LogFinding
from hydroid.log.log import Floats
from hydroid.log.names import column_unit
from hydroid.log.ranges import likely_range
from hydroid.log.repair import GAP, sample_period
from hydroid.settings.log import LogSettings
from hydroid.units import UNITS, likely_time_unit
from hydroid.words import listed

JITTER = 0.25  # in sample periods: a larger variation of the steps is a warning
SLOWEST = 10  # largest ratio of the file's period to log.period_s: held commands would not explain the motion
SHORTEST = 0.5  # [s], of a log that is worth a fit
ROUNDING = 1e-6  # [%], of a scaled command
OFTEN = 0.05  # part of the rows that are outside before the unit is suspected rather than these rows
DEGREE = UNITS["deg"].factor
SHOWN = {"command": "%", "angle": "deg", "pressure": "bar"}
"""units in which values are shown"""


def check_recording(recording: Recording, settings: LogSettings) -> list[LogFinding]:
    """Return every fault of the recording, in the order in which a user should mend them."""
    return [
        *_ragged(recording),
        *_holes(recording, settings.repair_s),
        *_time(recording, settings),
        *_outside(recording),
        *_jumps(recording),
        *_stated_units(recording),
    ]


def _ragged(recording: Recording) -> Iterator[LogFinding]:
    rows = np.flatnonzero(recording.ragged)
    if len(rows):
        yield recording.finding("error", "torn row", rows, cells=str(len(recording.file.names)))


def _holes(recording: Recording, longest: float) -> Iterator[LogFinding]:
    for column, signal in enumerate(recording.signals):
        rows = np.flatnonzero(np.isnan(recording.values[:, column]) & ~recording.ragged)
        if len(rows):
            text = recording.text(rows[0], column)
            empty = "the cell is empty" if recording.file.header else "no value is there"
            what = f"{text[:30]!r} is not a number" if text else empty
            kind = "no time" if signal.kind == "time" else "hole"
            yield recording.finding("error", kind, rows, signal, what=what, longest=longest)


def _time(recording: Recording, settings: LogSettings) -> Iterator[LogFinding]:
    signal, rows = recording.signals[0], np.flatnonzero(~np.isnan(recording.time))
    time, steps = recording.time[rows], np.diff(recording.time[rows])
    if len(back := np.flatnonzero(steps <= 0)):
        pair = {"time": time[back[0] + 1], "before": time[back[0]]}
        yield recording.finding("error", "time order", rows[1:][back], signal, **pair)
        return
    period, duration = sample_period(time), np.ptp(time) if len(time) else 0.0
    unit = likely_time_unit(period / signal.gain)
    spelt = {"min": "minutes", "h": "hours", "day": "days"}.get(unit, unit)
    numbers = {"period": period, "slowest": SLOWEST * settings.period_s, "shortest": SHORTEST}
    remedy = f"if the time is in {spelt}, set log.time.unit: {unit}" if unit else "set log.time.unit"
    if len(time) < 2 or duration < SHORTEST:
        samples = "1 sample" if len(time) == 1 else f"{len(time)} samples"
        numbers |= {"duration": duration, "samples": samples, "remedy": remedy}
        yield recording.finding("error", "too short", (), None, **numbers)
    elif period > SLOWEST * settings.period_s:
        yield recording.finding("error", "too slow", (), signal, remedy=remedy, **numbers)
    else:
        yield from _steps(recording, steps, rows, period, settings.repair_s)


def _steps(
    recording: Recording, steps: Floats, rows: NDArray[np.int64], period: float, longest: float
) -> Iterator[LogFinding]:
    """Gaps, and steps that vary; a row without a time counts as a sample, since it is reported elsewhere."""
    signal, per_row = recording.signals[0], steps / np.diff(rows)
    gaps = np.flatnonzero(steps > (np.diff(rows) - 1 + GAP) * period)
    uneven = np.flatnonzero(np.abs(per_row - period) > JITTER * period)
    if len(gaps):
        kind = "short gap" if steps[gaps].max() <= longest * (1 + 1e-9) + period else "gap"
        numbers = {"gap": steps[gaps[0]], "period": period, "longest": longest}
        yield recording.finding("error", kind, rows[1:][gaps], signal, **numbers)
    elif len(uneven):
        numbers = {"least": per_row.min(), "most": per_row.max(), "period": period}
        yield recording.finding("warning", "jitter", rows[1:][uneven], signal, **numbers)


def _outside(recording: Recording) -> Iterator[LogFinding]:
    """Values outside their limits: a finding for each signal, or one for all that another unit explains."""
    faults: dict[tuple[str, ...], list[tuple[Signal, NDArray[np.int64], Floats, dict[str, str]]]] = {}
    for signal, values in zip(recording.signals, recording.values.T, strict=True):
        rounding = ROUNDING if signal.kind == "command" else 0.0
        rows = np.flatnonzero((values < signal.low - rounding) | (values > signal.high + rounding))
        if len(rows):
            many = len(rows) > OFTEN * (values != 0).sum()
            kind, remedy = _explained(signal, values) if many else ("outside", {})
            key = (kind, *remedy.values(), signal.name if kind == "outside" else "")
            faults.setdefault(key, []).append((signal, rows, values, remedy))
    for (kind, *_), ((signal, rows, values, remedy), *others) in faults.items():
        unit = SHOWN[signal.kind]
        first, low, high = (x / UNITS[unit].factor for x in (values[rows[0]], signal.low, signal.high))
        joints = [str(other.joint) for other, *_ in others]
        more = f", and {signal.kind}s of joint{'s' * (len(joints) > 1)} {listed(joints)} likewise"
        limits = {"value": first, "low": low, "high": high, "unit": unit, "others": more if joints else ""}
        yield recording.finding("error", kind, rows, signal, quantity=signal.kind, **limits, **remedy)


def _explained(signal: Signal, values: Floats) -> tuple[str, dict[str, str]]:
    """Return the kind of fault if another unit explains values outside their limits, and what it names."""
    if signal.kind == "command" and (likely := likely_range(values)) and likely.name != "%":
        return "outside in another range", likely.remedy(signal.gain, signal.offset)
    if signal.kind == "angle":
        degrees = abs(abs(signal.gain) - DEGREE) < 1e-12
        scale = f"{-signal.gain / (DEGREE if abs(signal.gain) < 0.1 else 1):g}"
        unit, other = ("rad", values / DEGREE) if degrees else ("deg", values * DEGREE)
        joint = {"joint": str(signal.joint), "scale": scale}
        choices = [("outside, turned", joint, 2 * signal.offset - values)]
        if degrees or np.nanmax(np.abs(values)) > np.pi:  # degrees read as radians turn far more than this
            choices.insert(0, ("outside in another unit", {"other": unit}, other))
        for kind, remedy, changed in choices:
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
    faults: dict[tuple[str, str], list[Signal]] = {}
    for signal in recording.signals:
        unit = column_unit(signal.name, recording.file.units.get(signal.name, ""))
        if unit is None or signal.name in recording.clocks:
            continue
        plain = abs(signal.gain) == 1 or abs(abs(signal.gain) - DEGREE) < 1e-12
        wrong = {
            "time": signal.gain != unit.factor
            and unit.name == likely_time_unit(sample_period(recording.time) / signal.gain),
            "angle": plain and abs(abs(signal.gain) - unit.factor) > 1e-12,
            "voltage": signal.gain in (1, -1),
            "current": signal.gain in (1, -1),
        }
        said = {"voltage": "command", "current": "command"}.get(unit.quantity, unit.quantity)
        if said == signal.kind and wrong.get(unit.quantity):
            faults.setdefault((said, unit.name), []).append(signal)
    units = {unit.factor: unit.name for unit in UNITS.values() if unit.quantity == "time"}
    for (kind, unit), signals in faults.items():
        setting = units.get(signals[0].gain, "s") if kind == "time" else {"deg": "rad"}.get(unit, "deg")
        names = listed([signal.name for signal in signals])
        verb = "is" if len(signals) == 1 else "are"
        numbers = {"columns": f"{names} {verb}", "unit": unit, "setting": setting}
        yield recording.finding("warning", f"unit of {kind}", (), signals[0], **numbers)
