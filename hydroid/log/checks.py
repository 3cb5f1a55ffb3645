"""Checks of a recording and of the motion in it: what is wrong, where, and what to
do."""

from collections.abc import Callable, Collection, Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np

from hydroid.arrays import Array
from hydroid.log.clues import CLUES, column_unit
from hydroid.log.log import Log, LogFinding, log_finding
from hydroid.log.motion import END, LEAST_PATH, JointMotion, driven_joints, motion_of
from hydroid.log.repair import GAP, SHORTEST, sample_period
from hydroid.log.sensors import check_sensors
from hydroid.log.signals import likely_range
from hydroid.log.table import Recording, Signal
from hydroid.settings.arm import Arm
from hydroid.settings.log import LogSettings
from hydroid.units import UNITS, likely_time_unit, way

SMALL = ("±1", "±10 V")
"""ranges of commands whose numbers are possible commands in %, too"""
DEGREE = UNITS["deg"].factor
UNASKED = 0.2
"""part of its travel that a joint moves without a command, above which commands are
missing"""
# [%], which most joints' commands reach where single ones of 10 are in another range
FULL = 50.0


def check_recording(
    recording: Recording, settings: LogSettings
) -> Iterator[LogFinding]:
    """Yield the faults in the order to mend them."""
    table, longest = recording.table, settings.repair_s
    torn = np.isnan(recording.values).all(axis=1)
    if torn.any():
        yield recording.finding(
            "error", "torn row", np.flatnonzero(torn), cells=str(len(table.names))
        )
    for signal, values in zip(recording.signals, recording.values.T, strict=True):
        rows = np.flatnonzero(np.isnan(values) & ~torn)
        if len(rows):
            cell = table.text(signal.name, int(recording.rows[rows[0]]))
            what = f"{cell[:30]!r} is not a number" if cell else "no value is there"
            kind = "no time" if signal.kind == "time" else "hole"
            yield recording.finding(
                "error", kind, rows, signal, what=what, longest=longest
            )
    yield from _time(recording, settings)
    yield from _values(recording)
    yield from _units(recording)
    yield from check_sensors(recording)


def _time(recording: Recording, settings: LogSettings) -> Iterator[LogFinding]:
    """A time that falls, is too short or slow; else its period."""
    signal, known = recording.signals[0], recording.time[~np.isnan(recording.time)]
    if len(recording.time) > len(known) == 0:
        return  # a finding about its cells says why
    # NaN beside a row without time
    steps, period = np.diff(recording.time), sample_period(recording.time)
    falls = 1 + np.flatnonzero(steps <= 0)
    duration = np.ptp(known) if len(known) else 0.0
    slowest = 10 * settings.period_s  # else held commands would not explain the motion
    if len(falls):
        before, after = recording.time[falls[0] - 1 : falls[0] + 1]
        yield recording.finding(
            "error", "time order", falls, signal, time=after, before=before
        )
    elif duration < SHORTEST or period > slowest:
        kind = "too short" if duration < SHORTEST else "too slow"
        unit, remedy = (
            likely_time_unit(period / signal.gain),
            "check log.time.unit and log.period_s",
        )
        if unit and UNITS[unit].factor != signal.gain:
            remedy = f"if its unit is {unit}, set log.time.unit: {unit}"
        numbers = {
            "duration": duration,
            "samples": float(len(known)),
            "period": period,
            "slowest": slowest,
        }
        yield recording.finding("error", kind, (), signal, remedy=remedy, **numbers)
    else:
        # gaps are spoken of where they split the log
        steps = steps[steps <= GAP * period]
        uneven = np.abs(steps - period).max(initial=0.0) > 0.25 * period
        if uneven or abs(period - settings.period_s) > 0.01 * settings.period_s:
            step = (
                f"{steps.min():.4g} to {steps.max():.4g}" if uneven else f"{period:.4g}"
            )
            yield recording.finding(
                "note", "resampled", (), signal, step=step, period=settings.period_s
            )


def _values(recording: Recording) -> Iterator[LogFinding]:
    """Values outside their limits, which another range, unit or sign may explain if
    they are many."""
    for signal, values in zip(recording.signals, recording.values.T, strict=True):
        rows = np.flatnonzero(
            (values < signal.low - 1e-6) | (values > signal.high + 1e-6)
        )
        if len(rows):
            many = len(rows) > 0.05 * (values != 0).sum()
            kind, remedy = _explained(signal, values) if many else ("outside", {})
            numbers = {"value": values[rows[0]], "low": signal.low, "high": signal.high}
            shown = {
                name: value / UNITS[signal.unit].factor
                for name, value in numbers.items()
            }
            names = {"quantity": signal.kind, "unit": signal.unit, "name": signal.name}
            yield recording.finding(
                "error", kind, rows, signal, signal.owner, **names, **shown, **remedy
            )


def _explained(signal: Signal, values: Array) -> tuple[str, dict[str, str]]:
    """Return the kind of fault if another unit explains values outside their limits,
    and what it names."""
    if (
        signal.kind == "command"
        and (likely := likely_range(values))
        and likely.name != "%"
    ):
        return "outside in another range", likely.remedy(signal.gain, signal.offset)
    if signal.unit == "deg":
        degrees = abs(signal.gain) < 0.1
        unit, other = ("rad", values / DEGREE) if degrees else ("deg", values * DEGREE)
        scale = f"{-signal.gain / (DEGREE if degrees else 1):g}"
        explanations = [
            ("outside, turned", {"scale": scale}, 2 * signal.offset - values)
        ]
        # degrees read as radians turn far more
        if degrees or np.nanmax(np.abs(values)) > np.pi:
            explanations.insert(0, ("outside in another unit", {"other": unit}, other))
        for kind, remedy, changed in explanations:
            if np.nanmin(changed) >= signal.low and np.nanmax(changed) <= signal.high:
                return kind, remedy
    return "outside", {}


def _units(recording: Recording) -> Iterator[LogFinding]:
    """Units that the file states and the settings contradict; a time's only where they
    are plausible."""
    for signal in recording.signals:
        unit, gain = (
            column_unit(signal.name, recording.table.units.get(signal.name, "")),
            abs(signal.gain),
        )
        if unit is None or CLUES["units"].get(unit.quantity) != signal.kind:
            continue
        wrong, remedy = unit.factor != gain, f"unit: {unit.name}"
        if signal.kind == "time":
            wrong &= unit.name == likely_time_unit(sample_period(recording.time) / gain)
        elif signal.kind == "angle":
            wrong &= gain in (1, DEGREE)  # other scales may hold the unit
        else:
            wrong, remedy = (
                unit.name != "%" and gain == 1,
                "scale (command [%] = scale · cell + offset)",
            )
        if wrong:
            names = {"quantity": signal.kind, "unit": unit.name, "remedy": remedy}
            yield recording.finding("warning", "unit", (), signal, signal.name, **names)


def check_motion(
    log: Log,
    signals: Sequence[Signal],
    outputs: Collection[int],
    backward: Collection[int],
    delay: float,
) -> Iterator[LogFinding]:
    """Yield what the motion says against the settings, in which commands are delayed
    [s].

    A positive command turns the joints `backward` to negative angles.
    """
    of = {(signal.kind, signal.joint): signal for signal in signals if not signal.part}
    motions, common = driven_joints(log), likely_range(log.command.ravel())

    def warning(kind: str, signal: Signal, **numbers: Any) -> LogFinding:
        return log_finding(
            "warning", kind, log.source, signal.owner, column=signal.name, **numbers
        )

    undriven = not log.driven.any() and any(kind == "command" for kind, _ in of)
    if undriven:
        yield log_finding("warning", "undriven", log.source)
    for (kind, joint), signal in of.items():
        command, angle = (
            np.ptp(log.command[:, joint - 1]),
            np.ptp(log.angle[:, joint - 1]),
        )
        if (
            kind == "angle"
            and angle == 0
            and (joint in outputs or log.driven[joint - 1])
        ):
            yield warning("angle is constant", signal)
        if kind == "command" and command == 0 and joint in outputs and not undriven:
            yield warning("command is constant", signal)
    # of commands within 10 %, although joints move well; else they may be small
    # commands in %
    small = (
        common and common.name in SMALL and any(m.travel > 3 for m in motions.values())
    )
    usual = (
        np.median([np.abs(log.command[:, joint - 1]).max() for joint in motions])
        if motions
        else 0.0
    )
    for joint, motion in motions.items():
        command, angle = of["command", joint], of["angle", joint]
        likely = common if small else likely_range(log.command[:, joint - 1])
        if likely and (small or (likely.offset and command.low < 0)):
            yield warning(
                "range", command, **likely.remedy(command.gain, command.offset)
            )
        elif likely and likely.name in SMALL and usual > FULL and motion.travel > 3:
            yield warning(
                "range of one", command, **likely.remedy(command.gain, command.offset)
            )
        (path, against), slides = motion.directed, angle.unit != "deg"
        if motion.contradicts(backward=joint in backward):
            kind, part = (
                ("straight", 1 - against) if joint in backward else ("turned", against)
            )
            scale = f"{-command.gain:g}"
            yield warning(
                kind, command, path=way(path, slides=slides), part=part, scale=scale
            )
        yield from _half_told(motion, command, warning, slides=slides)
        if span := motion.frozen:
            over = span[1] > log.duration - 1.5 * log.period
            when = (
                f"from {span[0]:.4g} s on"
                if over
                else f"from {span[0]:.4g} to {span[1]:.4g} s"
            )
            yield warning("frozen", angle, when=when)
        if motion.push > 300 and 0 < motion.travel < 2:
            yield warning("no motion", angle, most=way(motion.travel, slides=slides))
        if ahead := motion.ahead:
            yield warning("late", command, lag=ahead, delay=delay - ahead)


def _half_told(
    motion: JointMotion,
    command: Signal,
    warning: Callable[..., LogFinding],
    *,
    slides: bool,
) -> Iterator[LogFinding]:
    """Yield what the log does not tell of a joint's commands: one direction, or any
    valve's opening."""
    given = motion.log.command[:, motion.joint - 1]
    by_degrees = max(motion.unasked)
    if by_degrees > max(LEAST_PATH, UNASKED * motion.travel):
        upwards = motion.unasked[0] > motion.unasked[1]
        one_way = (given >= 0).all() or (given <= 0).all()
        kind = "half a command" if one_way else "unasked"
        by = way(by_degrees, slides=slides)
        yield warning(kind, command, by=by, path="positive" if upwards else "negative")
    if motion.is_target:
        yield warning("target", command)


def motion_findings(logs: Sequence[Log], arm: Arm) -> Iterator[LogFinding]:
    """Yield where joints stand although they are driven, and which logs do not begin at
    rest.

    Where no log passes the angle, it is an end of the joint's travel.
    """
    for joint, name in enumerate(arm.joint_names, 1):
        motions = [motion_of(log, joint) for log in logs if log.measured[joint - 1]]
        reach = [angle for motion in motions for angle in motion.reach]
        for motion, (side, sign) in product(motions, (("upper", 1), ("lower", -1))):
            held = motion.held(sign)
            if (seconds := motion.log.period * held.shape[1]) >= 1:
                angle, command = np.median(held, axis=1)
                left = max(sign * other for other in reach) - sign * angle
                kind = "stall" if left > END * np.ptp(reach) else "at a stop"
                at = way(np.rad2deg(angle), slides=joint in arm.slides)
                numbers = {"angle": at, "command": command, "seconds": seconds}
                yield log_finding(
                    "note", kind, motion.log.source, name, side, **numbers
                )
    for log in logs:
        rest = log.first_command * log.period
        if log.driven.any() and rest < 0.2:
            after = f" after {rest:.2g} s" if rest else ""
            yield log_finding("note", "no rest", log.source, after=after)
