"""Checks of the motion in a log: what it says against the settings."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from hydroid.arrays import Array, record
from hydroid.log.likely_units import larger_unit
from hydroid.log.log import LEAST_COMMAND, Log, LogFinding, log_finding
from hydroid.log.mapping import angle_margin
from hydroid.log.motion import END, LEAST_PATH, JointMotion, driven_joints, motion_of
from hydroid.log.signals import CommandRange, likely_range
from hydroid.log.table import Signal
from hydroid.settings.arm import Arm, Joint

SMALL = ("±1", "±10 V")
"""ranges of commands whose numbers are possible commands in %, too"""
UNASKED = 0.2
"""part of its travel that a joint moves without a command, above which commands are
missing"""
FULL = 50.0
"""[%], which most joints' commands reach where single ones of 10 are in another
range"""
MOVES_WELL = 3.0
"""travel [deg] that no command of a few per cent would give"""
BOTH_WAYS = 0.2
"""part of its way under commands that a joint moves each way at least, above which
commands of one sign lack their direction"""
HARDLY_MOVES = 2.0
"""travel [deg] that is too little after commands of MUCH_PUSH"""
MUCH_PUSH = 300.0
"""time integral of strong commands [% s]"""
LEAST_REST = 0.2
"""before the first command [s], so that the log begins at rest"""
LEAST_SINKING = 1.0
"""slow way without a command [deg] that is no error of a sensor"""
SLOWEST_SINKING = 0.05
"""slow speed without a command [deg/s] that is no drift of a sensor"""
LEAST_STAND = 1.0
"""how long a joint must stand though it is driven [s]"""

Columns = Mapping[tuple[str, int], Signal]
"""the column of each kind and joint (number, from 1); of two the first"""
CONSTANT = {"angle": "angle is constant", "command": "command is constant"}
"""findings about a signal that does not change, by its kind"""


@record
class _Joint:
    """A joint that is driven and measured, with its columns."""

    motion: JointMotion
    command: Signal
    angle: Signal

    def warning(self, kind: str, signal: Signal, **numbers: Any) -> LogFinding:
        return _warning(self.motion.log, kind, signal, **numbers)


def _warning(log: Log, kind: str, signal: Signal, **numbers: Any) -> LogFinding:
    return log_finding(
        "warning",
        kind,
        log.source,
        signal.owner,
        column=signal.name,
        setting=signal.setting,
        **numbers,
    )


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
    columns = {
        (signal.kind, signal.joint): signal for signal in signals if not signal.part
    }
    yield from _constant(log, columns, outputs)
    motions = driven_joints(log)
    common = _common_small_range(log, motions)
    usual = _usual_command(log, motions)
    for number, motion in motions.items():
        joint = _Joint(motion, columns["command", number], columns["angle", number])
        yield from _range(joint, common, usual)
        yield from _direction(joint, backward=number in backward)
        yield from _not_told(joint)
        yield from _still(joint)
        yield from _sinks(joint)
        if motion.ahead:
            yield joint.warning(
                "late", joint.command, lag=motion.ahead, delay=delay - motion.ahead
            )


def _constant(
    log: Log, columns: Columns, outputs: Collection[int]
) -> Iterator[LogFinding]:
    """Yield commands and angles that do not change though they should."""
    has_commands = any(kind == "command" for kind, _ in columns)
    undriven = has_commands and not log.driven.any()
    if undriven:
        yield log_finding("warning", "undriven", log.source)
    for (kind, joint), signal in columns.items():
        if kind == "angle":
            values = log.angle
            shall_change = joint in outputs or log.drives(joint)
        elif kind == "command":
            values = log.command
            # that nothing is driven is said already
            shall_change = joint in outputs and not undriven
        else:
            continue
        if shall_change and np.ptp(values[:, joint - 1]) == 0:
            yield _warning(log, CONSTANT[kind], signal)


def _common_small_range(
    log: Log, motions: Mapping[int, JointMotion]
) -> CommandRange | None:
    """Return a range that all commands of a log are in, if these are within 10 %.

    If joints move well by them. Else they may be small commands in %.
    """
    common = likely_range(log.command.ravel())
    moves = any(motion.travel > MOVES_WELL for motion in motions.values())
    if common and common.name in SMALL and moves:
        return common
    return None


def _usual_command(log: Log, motions: Mapping[int, JointMotion]) -> float:
    """Return the largest command that a joint in the middle of all gets [%]."""
    if not motions:
        return 0.0
    largest = np.abs(log.command).max(axis=0)
    joints = [joint - 1 for joint in motions]
    return float(np.median(largest[joints]))


def _range(
    joint: _Joint, common: CommandRange | None, usual: float
) -> Iterator[LogFinding]:
    """Yield that a command is rather in another range than in %.

    Args:
        common: the range of all commands of the log, if that is another one.
        usual: largest command that joints get [%].
    """
    motion = joint.motion
    command = joint.command
    # one range for all is likelier than one for each
    if common:
        remedy = common.remedy(command.setting, command.gain, command.offset)
        yield joint.warning("range", command, **remedy)
        return
    likely = likely_range(motion.log.command_of(motion.joint))
    if likely is None:
        return
    # a command in two columns has no middle
    if likely.offset and command.low < 0:
        remedy = likely.remedy(command.setting, command.gain, command.offset)
        yield joint.warning("range", command, **remedy)
    elif likely.name in SMALL and usual > FULL and motion.travel > MOVES_WELL:
        own = f"log.joints.{command.owner}.command"
        remedy = likely.remedy(own, command.gain, command.offset)
        yield joint.warning("range of one", command, **remedy)


def _direction(joint: _Joint, *, backward: bool) -> Iterator[LogFinding]:
    """Yield that a joint moves against the direction of its commands."""
    if not joint.motion.contradicts(backward=backward):
        return
    path, against = joint.motion.directed
    kind = "straight" if backward else "turned"
    numbers = {
        "path": joint.angle.shown.way(path),
        "part": 1 - against if backward else against,
        "scale": f"{-joint.command.gain:g}",
    }
    yield joint.warning(kind, joint.command, **numbers)


def _not_told(joint: _Joint) -> Iterator[LogFinding]:
    """Yield what the log does not tell of a joint's commands: one direction, or any
    valve's opening."""
    motion = joint.motion
    # a coil at rest shows noise
    command = motion.log.command_of(motion.joint)
    given = command[np.abs(command) >= LEAST_COMMAND]
    one_way = (given > 0).all() or (given < 0).all()
    upwards, downwards = motion.unasked
    unasked = max(upwards, downwards)
    if unasked > max(LEAST_PATH, UNASKED * motion.travel):
        kind = "half a command" if one_way else "unasked"
        path = "positive" if upwards > downwards else "negative"
        by = joint.angle.shown.way(unasked)
        yield joint.warning(kind, joint.command, by=by, path=path)
    elif one_way and _moves_both_ways(motion):
        yield joint.warning("one sign", joint.command)
    if motion.is_target:
        yield joint.warning("target", joint.command)


def _moves_both_ways(motion: JointMotion) -> bool:
    """Return whether a joint moves well to either side under its strong commands."""
    path, against = motion.directed
    least = BOTH_WAYS * path
    return path > motion.travel and least < against * path < path - least


def _still(joint: _Joint) -> Iterator[LogFinding]:
    """Yield that an angle stands, for a while or nearly always, though it is driven."""
    motion = joint.motion
    if motion.frozen:
        begin, end = motion.frozen
        when = f"from {begin:.4g} to {end:.4g} s"
        if end > motion.log.duration - 1.5 * motion.log.period:
            when = f"from {begin:.4g} s on"
        yield joint.warning("frozen", joint.angle, when=when)
    if motion.push > MUCH_PUSH and 0 < motion.travel < HARDLY_MOVES:
        most = joint.angle.shown.way(motion.travel)
        yield joint.warning("no motion", joint.angle, most=most, unit=_in_unit(joint))


def _sinks(joint: _Joint) -> Iterator[LogFinding]:
    """Yield that a joint moves slowly while no joint is driven: its oil leaks."""
    way, seconds = joint.motion.sinking
    if abs(way) < max(LEAST_SINKING, SLOWEST_SINKING * seconds):
        return
    yield log_finding(
        "note",
        "sinks",
        joint.motion.log.source,
        joint.angle.owner,
        column=joint.angle.name,
        by=joint.angle.shown.way(abs(way)),
        path="positive" if way > 0 else "negative",
        seconds=seconds,
    )


def _in_unit(joint: _Joint) -> str:
    """Say in which larger unit an angle that hardly moves may be; "" where in none."""
    signal = joint.angle
    unit = larger_unit(signal, joint.motion.log.angle_of(signal.joint))
    if unit is None:
        return ""
    setting = f"{signal.setting}.unit: {unit.name}"
    return f", and if {signal.shown.word}s are in {unit.name}, set {setting}"


def motion_findings(logs: Sequence[Log], arm: Arm) -> Iterator[LogFinding]:
    """Yield where joints stand although they are driven, and which logs do not begin at
    rest.

    Where no log passes the angle, it is an end of the joint's travel.
    """
    for number, joint in enumerate(arm.joints, 1):
        motions = [motion_of(log, number) for log in logs if log.measures(number)]
        ends = np.array([motion.reach for motion in motions])
        for motion in motions:
            yield from _stands(motion, joint, ends)
    for log in logs:
        rest = log.first_command * log.period
        if log.driven.any() and rest < LEAST_REST:
            after = f" after {rest:.2g} s" if rest else ""
            yield log_finding("note", "no rest", log.source, after=after)


def _stands(motion: JointMotion, joint: Joint, ends: Array) -> Iterator[LogFinding]:
    """Yield where a joint stands in a log although it is driven up or down.

    `ends`: of its travel in all logs [rad].
    """
    for side, sign in (("upper", 1), ("lower", -1)):
        held = motion.held(sign)
        seconds = motion.log.period * held.shape[1]
        # a joint also stands for a moment where it turns round
        if seconds < LEAST_STAND:
            continue
        angle, command = np.median(held, axis=1)
        left = (sign * ends).max() - sign * angle
        kind = "stall"
        if left <= END * np.ptp(ends):
            end = joint.limits[sign > 0]
            is_end = abs(angle - end) < angle_margin(*joint.limits)
            kind = "at the end of its range" if is_end else "at a stop"
        at = joint.shown.way(np.rad2deg(angle))
        numbers = {"angle": at, "command": command, "seconds": seconds}
        yield log_finding("note", kind, motion.log.source, joint.name, side, **numbers)
