"""Checks of a recording, as the file holds it: what is wrong, where, and what to do."""

from collections.abc import Iterator

import numpy as np

from hydroid.arrays import Array, Ints
from hydroid.log.clues import CLUES, RAW, column_unit
from hydroid.log.conditions import is_condition
from hydroid.log.likely_units import is_within, likely_unit
from hydroid.log.log import LogFinding
from hydroid.log.repair import FINER, GAP, of_periods, sample_period, shortest
from hydroid.log.sensors import check_sensors
from hydroid.log.signals import (
    CommandRange,
    likely_range,
    of_one_scale,
    resting_range,
)
from hydroid.log.table import Recording, Signal
from hydroid.settings.log import LogSettings
from hydroid.units import UNITS, Unit, is_usual_step, likely_time_unit

MANY = 0.05
"""part of the values other than 0 from which those outside their limits are no strays,
but have a common reason"""
UNEVEN = 0.25
"""part of the period by which steps may differ from it, above which they are uneven"""

MISPLACED = 1.0
"""how far the time may fall back at a line that only stands in the wrong place [s]"""


def check_recording(
    recording: Recording, settings: LogSettings
) -> Iterator[LogFinding]:
    """Yield the faults in the order to mend them."""
    yield from _lacking_numbers(recording, settings)
    yield from _time(recording, settings)
    yield from _values(recording)
    yield from _units(recording)
    yield from check_sensors(recording)


def _lacking_numbers(
    recording: Recording, settings: LogSettings
) -> Iterator[LogFinding]:
    """Yield rows without any number, and cells without one in the others."""
    table = recording.table
    torn = np.isnan(recording.values).all(axis=1)
    if torn.any():
        cells = str(len(table.names))
        rows = np.flatnonzero(torn)
        yield recording.finding("error", "torn row", rows, cells=cells)
    for signal, values in zip(recording.signals, recording.values.T, strict=True):
        rows = np.flatnonzero(np.isnan(values) & ~torn)
        if len(rows):
            cell = table.text(signal.name, int(recording.rows[rows[0]]))
            what = f"{cell[:30]!r} is not a number" if cell else "no value is there"
            kind = "no time" if signal.kind == "time" else "hole"
            if cell and len(rows) == len(values) - torn.sum():
                kind = "text column"
            numbers = {"longest": settings.repair_s, "setting": signal.setting}
            yield recording.finding("error", kind, rows, signal, what=what, **numbers)


def _time(recording: Recording, settings: LogSettings) -> Iterator[LogFinding]:
    """Yield that the time falls, is too short or slow; else what its period is."""
    time = recording.time
    signal = recording.signals[0]
    times = time[~np.isnan(time)]
    if len(time) > len(times) == 0:
        return  # a finding about its cells says why
    # NaN beside a row without time
    steps = np.diff(time)
    falls = 1 + np.flatnonzero(steps <= 0)
    if len(falls):
        yield _out_of_order(recording, falls)
        return
    duration = 0.0
    if len(times):
        duration = np.ptp(times)
    period = sample_period(time)
    # held commands would not explain the motion between samples that are farther apart
    slowest = 10 * settings.period_s
    least = shortest(settings)
    if duration < least or period > slowest:
        kind = "too short" if duration < least else "too slow"
        numbers = {
            "duration": duration,
            "samples": float(len(times)),
            "period": period,
            "slowest": slowest,
            "least": least,
        }
        words = {
            "remedy": _time_remedy(recording, period, duration, least),
            "of_periods": of_periods(settings),
        }
        yield recording.finding("error", kind, (), signal, **words, **numbers)
        return
    # gaps are spoken of where they split the log
    steps = steps[steps <= GAP * period]
    uneven = np.abs(steps - period).max(initial=0.0) > UNEVEN * period
    if uneven or abs(period - settings.period_s) > 0.01 * settings.period_s:
        step = f"{period:.4g}"
        if uneven:
            step = f"{steps.min():.4g} to {steps.max():.4g}"
        is_finer = settings.period_s <= FINER * period
        kind = "resampled finer" if is_finer else "resampled"
        yield recording.finding(
            "note", kind, (), signal, step=step, period=settings.period_s
        )


def _out_of_order(recording: Recording, falls: Ints) -> LogFinding:
    """Return that the time falls, or stands, at some rows."""
    before, after = recording.time[falls[0] - 1 : falls[0] + 1]
    # a line out of order falls by a few periods
    is_new_clock = len(falls) == 1 and before - after > MISPLACED
    kind = "time begins again" if is_new_clock else "time order"
    signal = recording.signals[0]
    return recording.finding("error", kind, falls, signal, time=after, before=before)


def _time_remedy(
    recording: Recording, period: float, duration: float, least: float
) -> str:
    """Return what to do about a period and a duration [s] that no log has.

    Another unit may explain them if the log then has the least duration; it is the last
    thing to think of where the file states the unit.
    """
    signal = recording.signals[0]
    unit = likely_time_unit(period / signal.gain)
    in_unit = UNITS[unit].factor / signal.gain if unit else 1.0
    if in_unit == 1 or duration * in_unit < least:
        return "take more samples, or check log.time.unit and log.period_s"
    hint = f"if its unit is {unit}, set log.time.unit: {unit}"
    stated = _stated_unit(recording, signal)
    if stated is not None and stated.factor == signal.gain:
        return f"take more samples, or {hint}"
    return hint


def _stated_unit(recording: Recording, signal: Signal) -> Unit | None:
    """Return the unit that the file states for a column; None: it states none."""
    return column_unit(signal.name, recording.table.units.get(signal.name, ""))


def _values(recording: Recording) -> Iterator[LogFinding]:
    """Yield values outside their limits, which another range, unit or sign may explain
    if they are many."""
    outside = list[tuple[Signal, Array, Ints]]()
    for signal, values in zip(recording.signals, recording.values.T, strict=True):
        too_low = values < signal.low - 1e-6
        too_high = values > signal.high + 1e-6
        rows = np.flatnonzero(too_low | too_high)
        if len(rows):
            outside.append((signal, values, rows))
    commands = [values for signal, values, _ in outside if signal.kind == "command"]
    ranges = iter(of_one_scale([*map(likely_range, commands)]))
    for signal, values, rows in outside:
        likely = next(ranges) if signal.kind == "command" else None
        kind = "outside"
        remedy = dict[str, str]()
        if len(rows) > MANY * (values != 0).sum():
            kind, remedy = _explained(recording, signal, values, likely)
        if is_condition(signal):
            kind = "condition outside"
        factor = UNITS[signal.unit.lower()].factor
        numbers = {
            "value": values[rows[0]] / factor,
            "low": signal.low / factor,
            "high": signal.high / factor,
        }
        names = {
            "quantity": signal.kind,
            "unit": signal.unit,
            "name": signal.name,
            "setting": signal.setting,
        }
        yield recording.finding(
            "error", kind, rows, signal, signal.owner, **names, **numbers, **remedy
        )


def _explained(
    recording: Recording, signal: Signal, values: Array, likely: CommandRange | None
) -> tuple[str, dict[str, str]]:
    """Return the kind of fault that values outside their limits are, and what mends it;
    commands are `likely` in a range."""
    if likely and likely.name != "%":
        at_rest = resting_range(values, likely, None)
        if at_rest is not None:
            rest, around = at_rest
            name = f"{likely.name}, at rest at {rest:.6g}"
            likely = around.with_overshoot(values)._replace(name=name)
        remedy = likely.remedy(signal.setting, signal.gain, signal.offset)
        return "outside in another range", remedy
    if signal.kind != "angle":
        return "outside", {}
    other = likely_unit(signal, values, _stated_unit(recording, signal))
    if other is not None:
        return "outside in another unit", {
            "word": f"{signal.shown.word}s",
            "other": other.name,
        }
    if is_within(signal, 2 * signal.offset - values):
        return "outside, turned", {"scale": f"{-signal.scale:g}"}
    return "outside", {}


def _units(recording: Recording) -> Iterator[LogFinding]:
    """Yield units that the file states and the settings contradict."""
    period = sample_period(recording.time)
    for signal in recording.signals:
        unit = _stated_unit(recording, signal)
        if unit is None:
            continue
        # a pressure is called as what its unit measures
        kind = CLUES["units"].get(unit.quantity, unit.quantity)
        if kind == signal.kind and _contradicts(unit, signal, period):
            remedy = f"unit: {unit.name}"
            if unit.quantity in RAW:
                remedy = "scale (command [%] = scale · cell + offset)"
            setting = signal.setting or f"log.{signal.kind}"
            names = {"setting": setting, "unit": unit.name, "remedy": remedy}
            yield recording.finding("warning", "unit", (), signal, signal.name, **names)


def _contradicts(unit: Unit, signal: Signal, period: float) -> bool:
    """Return whether the unit in a file is another than the settings give a signal.

    The unit of a time counts only where the period [s] is plausible in it.
    """
    if unit.quantity not in RAW and unit.factor == abs(signal.gain):
        return False
    if signal.kind == "time":
        return is_usual_step(period / signal.gain * unit.factor)
    # another scale may hold the unit
    return abs(signal.scale) == 1
