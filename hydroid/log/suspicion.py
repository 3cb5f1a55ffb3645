"""Numbers that are allowed but look as if they had another unit: volts for percent, radians for degrees.

The file itself may say so, in a row of units or in a name. Otherwise the arm's motion must contradict the
settings; nothing is said where another explanation is possible.
"""

from collections.abc import Iterator

import numpy as np

from hydroid.log.clock import likely_unit
from hydroid.log.column_words import unit_of
from hydroid.log.command_range import CommandRange, likely_range
from hydroid.log.log import Finding, Floats, numbered
from hydroid.log.signals import Recording, Signal
from hydroid.settings.log import SECONDS

MOVES = 3.0  # [deg], of the mean over WINDOW: more than noise and settling
WINDOW = 0.5  # [s]
HALF_TURN = 3.2  # just above pi: few joints turn further, in rad
STRONG = 30.0  # [%], past the dead band of a valve
LEAST = 300.0  # [% s] of strong commands before their effect is judged
SLUGGISH = 0.015  # [deg/(% s)]: 1.5 deg/s at full command; the rig's slowest joint turns 16 times as fast
SMALL = ("±1", "±10 V")  # ranges that a motion must contradict: they may be small commands in %
OFTEN = 0.05  # part of the rows that are outside before the unit is suspected rather than these rows
DEGREE = np.pi / 180


def unit_findings(recording: Recording) -> list[Finding]:
    """Return what speaks against the units of the settings."""
    findings = list(_stated(recording))
    if np.isnan(recording.values).any() or len(recording.time) < 2 or (np.diff(recording.time) <= 0).any():
        return findings  # has faults to be mended first
    said = {finding.kind for finding in findings}
    command, angle = recording.motions()
    driven = np.flatnonzero(command.any(axis=0) & ~np.isnan(angle[0]))
    if len(driven):
        means, push = _window_means(recording.time, np.rad2deg(angle[:, driven])), np.abs(command[:, driven])
        suspected = list(_ranges(recording, driven, means)) if "unit of command" not in said else []
        largest = np.rad2deg(np.nanmax(np.abs(angle)))
        if not suspected and "unit of angle" not in said and largest <= HALF_TURN:
            suspected += _radians(recording, driven, means, push)
        findings += suspected
    return findings


def outside_hint(recording: Recording, signal: Signal, values: Floats) -> str:
    """Return what to do about values outside their limits where these are many; "" where they are few."""
    outside = (values < signal.low) | (values > signal.high)
    if outside.sum() <= OFTEN * (values != 0).sum():
        return ""
    if signal.kind == "command":
        likely = likely_range(values)
        return _range_hint(likely, signal) if likely and likely.name != "%" else ""
    if signal.kind == "angle":
        alternatives = {
            "if angles are in deg, set log.angle.unit: deg": values * DEGREE,
            "if angles are in rad, set log.angle.unit: rad": values / DEGREE,
            f"if joint {signal.joint} counts the other way, set log.joints.{signal.joint}.angle.scale: "
            f"{-signal.gain / (DEGREE if abs(signal.gain) < 0.1 else 1):g}": 2 * signal.offset - values,
        }
        degrees = abs(abs(signal.gain) - DEGREE) < 1e-12
        for hint, other in alternatives.items():
            if hint.endswith("unit: deg") and np.nanmax(np.abs(values)) <= np.pi:
                continue  # degrees that are read as radians turn far more than this
            fits = np.nanmin(other) >= signal.low and np.nanmax(other) <= signal.high
            if fits and not hint.endswith("unit: deg" if degrees else "unit: rad"):
                return hint
    return ""


def time_hint(recording: Recording, period: float) -> str:
    """Return the setting that makes a sample period [s] plausible; "" where there is none."""
    unit = likely_unit(period / recording.signals[0].gain)
    spelt = {"min": "minutes", "h": "hours", "day": "days"}.get(unit, unit)
    return f"if the time is in {spelt}, set log.time.unit: {unit}" if unit else ""


def _stated(recording: Recording) -> Iterator[Finding]:
    """Units that the file states and the settings contradict."""
    faults: dict[tuple[str, str, str, str], list[Signal]] = {}
    for signal in recording.signals:
        unit = unit_of(signal.name, recording.file.units.get(signal.name, ""))
        if signal.kind == "time" and unit == _time_unit(recording) and SECONDS[unit] != signal.gain:
            used = next((name for name, seconds in SECONDS.items() if seconds == signal.gain), "s")
            key = ("time", unit, f"log.time.unit is {used}", f"set log.time.unit: {unit}")
        elif signal.kind == "angle" and unit in ("deg", "degree", "degrees", "°") and abs(signal.gain) == 1:
            key = ("angle", "deg", "log.angle.unit is rad", "set log.angle.unit: deg")
        elif signal.kind == "angle" and unit == "rad" and abs(abs(signal.gain) - DEGREE) < 1e-12:
            key = ("angle", "rad", "log.angle.unit is deg", "set log.angle.unit: rad")
        elif signal.kind == "command" and unit in ("v", "volt", "volts", "ma") and abs(signal.gain) == 1:
            hint = "command [%] = scale · cell + offset: for ±10 V set log.command.scale: 10"
            key = ("command", "mA" if unit == "ma" else "V", "log.command.scale is 1", hint)
        else:
            continue
        faults.setdefault(key, []).append(signal)
    for (kind, unit, setting, hint), signals in faults.items():
        if kind == "time" and signals[0].name in recording.clocks:
            continue
        names = ", ".join(signal.name for signal in signals)
        what = f"the file says that {names} {'is' if len(signals) == 1 else 'are'} in {unit}, but {setting}"
        yield recording.finding("warning", what, hint, (), signals[0], f"unit of {kind}")


def _time_unit(recording: Recording) -> str:
    """Return the unit that makes the sample period plausible."""
    steps = np.diff(recording.time[~np.isnan(recording.time)])
    return likely_unit(float(np.median(steps)) / recording.signals[0].gain) if len(steps) else ""


def _ranges(recording: Recording, driven: np.ndarray, means: Floats) -> Iterator[Finding]:
    """Commands that look like another range than percent."""
    pairs = zip(recording.signals, recording.values.T, strict=True)
    signed = {s.joint: (s, values) for s, values in pairs if s.kind == "command" and s.low < 0}
    signals = {joint: signal for joint, (signal, _) in signed.items()}
    likely = {joint: likely_range(values) for joint, (_, values) in signed.items()}
    raised = {j: found for j, found in likely.items() if found and found.offset}
    for name in dict.fromkeys(found.name for found in raised.values()):
        joints = [j for j, found in raised.items() if found.name == name]
        what = f"command of {numbered(joints)} rests at the middle of {name}"
        hint = _range_hint(raised[joints[0]], signals[joints[0]])
        yield recording.finding("warning", what, hint, (), signals[joints[0]], "range of command")
    if raised:
        return
    command = recording.motions()[0]
    overall = likely_range(command.ravel())
    moved = np.ptp(means, axis=0)
    joint = int(driven[moved.argmax()]) + 1
    if overall and overall.name in SMALL and moved.max() > MOVES:
        largest = {"±1": 1, "±10 V": 10}[overall.name]
        what = f"no command exceeds {largest} %, yet joint {joint} turns by {moved.max():.3g} deg"
        signal = recording.signal("command", joint)
        yield recording.finding("warning", what, _range_hint(overall, signal), (), signal, "range of command")


def _range_hint(found: CommandRange, signal: Signal) -> str:
    """The settings that bring a range to percent, given those that the cells were read with."""
    hint = f"if commands are in {found.name}, set log.command.scale: {found.scale * signal.gain:g}"
    offset = found.offset + found.scale * signal.offset
    return hint + (f" and log.command.offset: {offset:g}" if offset else "")


def _radians(recording: Recording, driven: np.ndarray, means: Floats, command: Floats) -> Iterator[Finding]:
    strong = np.where(command[:-1] > STRONG, command[:-1], 0.0)
    push, path = np.diff(recording.time) @ strong, np.abs(np.diff(means, axis=0)).sum(axis=0)
    judged = push > LEAST
    if judged.any() and ((path > 0) & (path < SLUGGISH * push))[judged].all():
        joint = int(driven[judged][0]) + 1
        what = f"no angle exceeds {HALF_TURN:g} deg, and joint {joint} hardly follows strong commands"
        hint = "if angles are in rad, set log.angle.unit: rad"
        signal = recording.signal("angle", joint)
        yield recording.finding("warning", what, hint, (), signal, "unit of angle")


def _window_means(time: Floats, values: Floats) -> Floats:
    """Return means over windows of half a second, the last of which may be shorter, shape (windows, M)."""
    starts = np.flatnonzero(np.diff(np.floor((time - time[0]) / WINDOW), prepend=-1.0))
    return np.add.reduceat(values, starts, axis=0) / np.diff(starts, append=len(values))[:, None]
