"""Where a fit holds: the commands, angles and speeds of its logs; and what to log next.

What a log should add follows from what the logs lack. What it would bring for single
parameters, `hydroid suggest` computes.
"""

import math
import shlex
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from hydroid.arrays import Array, record
from hydroid.fitting.comparison import LEAST_BLOCKS
from hydroid.log import Log
from hydroid.log.command_sizes import (
    HELD,
    largest_commands,
    only_command,
    smallest_commands,
)
from hydroid.log.log import LEAST_COMMAND
from hydroid.reporting.actuator_report import OVER
from hydroid.reporting.page import Cell, Section, Table
from hydroid.run.record import FinishedRun
from hydroid.settings.fit import FitSettings
from hydroid.units import Display
from hydroid.words import listed

LARGE = 90.0
"""largest command from which a direction counts as driven to its end [%]"""
SMALL = 25.0
"""smallest command up to which a direction counts as driven slowly [%]"""
MOST_TRAVEL = 0.7
"""part of a joint's range that logs should cover"""
TOGETHER = 0.1
"""part of the driven time in which several joints should move"""
SIGNS = (1.0, -1.0)
HEADER = (
    "joint",
    "unit",
    "commands [%]",
    "positions",
    "part of the range",
    "speeds [per s]",
    "driven [s]",
)
_TEXT = (
    "What the fitted logs, resampled every {period:g} s, cover of each joint. Beyond it the model "
    "extrapolates. Positions are "
    f"angles, or the way of a joint that slides. Commands are those that the logs give for at least "
    f"{HELD:g} s in total. Speeds are means over {OVER:g} s. Driven: time with positive and with "
    "negative commands."
)


@record
class Covered:
    """What some logs cover of a joint.

    Attributes:
        joint: its name.
        shown: how it is shown.
        ends: largest negative and positive commands [%], smallest and largest angles
            [rad] or positions [m], and speeds, shape (3, 2).
        smallest: smallest command that is none of a lever's noise [%], by its sign;
            none of a direction without commands.
        switched: signs of the commands that are on or off.
        seconds: with positive and with negative commands [s].
        range: of the joint [rad], [m]; infinite where it has no end.
    """

    joint: str
    shown: Display
    ends: Array
    smallest: dict[float, float]
    switched: tuple[float, ...]
    seconds: tuple[float, float]
    range: tuple[float, float]

    @property
    def share(self) -> float | None:
        """Part of the range that the logs cover; None: it has no end."""
        low, high = self.range
        if math.isinf(high - low):
            return None
        return float(np.ptp(self.ends[1]) / (high - low))


class Lack(NamedTuple):
    """What logs lack in a word, where they lack it, and why it matters."""

    what: str
    where: str
    why: str


def covered(settings: FitSettings, logs: Sequence[Log], joint: int) -> Covered:
    """Return what logs cover of a joint, numbered from 1."""
    arm = settings.arm
    return Covered(
        joint=arm.name_of(joint),
        shown=arm.joint(joint).shown,
        ends=_ends(logs, joint),
        smallest=smallest_commands(logs, joint),
        switched=tuple(s for s in SIGNS if only_command(logs, joint, s) is not None),
        seconds=(_driven(logs, joint, 1.0), _driven(logs, joint, -1.0)),
        range=arm.stops(joint),
    )


def _ends(logs: Sequence[Log], joint: int) -> Array:
    """Return the ends of a joint's commands, angles and speeds as `Covered` has them,
    (3, 2); NaN of what no log measures."""
    ends = np.full((3, 2), np.nan)
    ends[0] = largest_commands(logs, joint)
    measured = [log for log in logs if log.measures(joint)]
    if measured:
        angles = np.concatenate([log.angle_of(joint) for log in measured])
        speeds = np.concatenate([_speeds(log, joint) for log in measured])
        ends[1] = angles.min(), angles.max()
        ends[2] = speeds.min(), speeds.max()
    return ends


def _driven(logs: Sequence[Log], joint: int, sign: float) -> float:
    """Return how long logs command a joint with a sign [s]."""
    seconds = 0.0
    for log in logs:
        is_driven = sign * log.command_of(joint) >= LEAST_COMMAND
        seconds += log.period * float(np.sum(is_driven))
    return seconds


def _speeds(log: Log, joint: int) -> Array:
    """Return the mean speeds of a joint over OVER, at every sample, (n,)."""
    angle = log.angle_of(joint)
    steps = min(max(round(OVER / log.period), 1), len(angle) - 1)
    return (angle[steps:] - angle[:-steps]) / (steps * log.period)


def validity_section(run: FinishedRun) -> Section:
    """Return the folded section of what a fit's logs cover."""
    settings = run.settings
    joints = _all_covered(run)
    reached = [f"{one.joint} {_commands(one, 'and')}" for one in joints]
    return Section(
        "Range of validity",
        _TEXT.format(period=settings.log.period_s),
        points=tuple(_limits(settings)),
        tables={"covered": Table("", HEADER, tuple(map(_row, joints)))},
        folded=True,
        answer=f"free motion, commands [%] up to: {', '.join(reached)}{_none_below(joints)}",
    )


def log_next(run: FinishedRun) -> tuple[str, ...]:
    """Return what the next logs of a machine should have, as the fitted ones lack it."""
    logs = [prediction.log for prediction in run.result.fitted]
    lacks = [*_lacks_of_joints(_all_covered(run)), *_lacks_of_logs(run, logs)]
    points = [f"Log {one.what}{one.where}. {one.why}" for one in lacks]
    points.append(
        f"hydroid suggest --fit {shlex.quote(run.folder)} says what an experiment, or weighing, would "
        "narrow. hydroid design plans the experiment."
    )
    return tuple(points)


def _all_covered(run: FinishedRun) -> list[Covered]:
    """Return what the fitted logs of a run cover of each compared joint."""
    logs = [prediction.log for prediction in run.result.fitted]
    return [covered(run.settings, logs, joint) for joint in run.settings.outputs]


def _limits(settings: FitSettings) -> Iterator[str]:
    """Yield what the model leaves out, whatever the logs cover."""
    yield (
        "Limit: free motion of stiff links. The model has no contact, such as a bucket that digs, no "
        "play, and no hysteresis of valves."
    )
    missing = list[str]()
    if settings.log.oil_temperature is None:
        missing.append("oil temperature")
    if settings.log.engine_speed is None:
        missing.append("engine speed")
    if missing:
        yield (
            f"Limit: {listed(missing)} as in the fitted logs, which have no column of "
            f"{'them' if len(missing) > 1 else 'it'}. Where they differ, speeds do, too: hydroid "
            "adapt refits a few parameters to a log of that day."
        )


def _lacks_of_joints(joints: Sequence[Covered]) -> Iterator[Lack]:
    """Yield what logs lack of single joints."""
    never = [one.joint for one in joints if len(one.smallest) < len(SIGNS)]
    weak = [one.joint for one in joints if _is_weak(one)]
    fast = [one.joint for one in joints if _is_fast(one)]
    lacks = (
        ("both directions", never, "The logs command one of them only."),
        ("larger commands", weak, "Beyond, speeds are extrapolated."),
        ("smaller commands", fast, "They show where the dead band ends."),
        (
            "other poses",
            _narrow(joints),
            "Gravity, inertia and the cylinder's lever change with the pose.",
        ),
    )
    for what, where, why in lacks:
        if where:
            yield Lack(what, f" of {listed(where)}", why)


def _narrow(joints: Sequence[Covered]) -> list[str]:
    """Return the joints of whose range the logs cover little."""
    narrow = list[str]()
    for one in joints:
        if one.share is not None and one.share < MOST_TRAVEL:
            narrow.append(one.joint)
    return narrow


def _lacks_of_logs(run: FinishedRun, logs: Sequence[Log]) -> Iterator[Lack]:
    """Yield what the logs of a run lack as a whole."""
    outputs = [joint - 1 for joint in run.settings.outputs]
    moving = np.vstack(
        [np.abs(log.command[:, outputs]) >= LEAST_COMMAND for log in logs]
    )
    count = moving.sum(axis=1)
    several = np.sum(count > 1)
    if len(outputs) > 1 and several < TOGETHER * np.sum(count > 0):
        yield Lack("several joints at once", "", "They share pump and inertia.")
    unseen = sum(not prediction.apart for prediction in run.validations.values())
    if unseen < LEAST_BLOCKS:
        why = f"There {'is' if unseen == 1 else 'are'} {unseen or 'none'}."
        yield Lack(f"{LEAST_BLOCKS} unseen logs", " in all, to validate on", why)
    if not run.settings.payloads:
        why = "No log has a payload: its effect is known from the model alone."
        yield Lack("a known load", " at the tip, if the machine is to carry any", why)


def _is_weak(one: Covered) -> bool:
    """Return whether the logs lack large commands in a direction that they drive."""
    driven = [sign for sign in one.smallest if sign not in one.switched]
    sizes = {1.0: one.ends[0, 1], -1.0: -one.ends[0, 0]}
    return any(sizes[sign] < LARGE for sign in driven)


def _is_fast(one: Covered) -> bool:
    """Return whether the logs lack small commands in a direction that they drive."""
    driven = [sign for sign in one.smallest if sign not in one.switched]
    return any(one.smallest[sign] > SMALL for sign in driven)


def _commands(one: Covered, between: str = "to") -> str:
    low, high = one.ends[0]
    return f"{_signed(low)} {between} {_signed(high)}"


def _none_below(joints: Sequence[Covered]) -> str:
    """Say below which size the logs have no commands of any joint; nothing where they
    have small ones."""
    smallest = [size for one in joints for size in one.smallest.values()]
    if not smallest or min(smallest) <= SMALL:
        return ""
    return f"; none below {min(smallest):.0f}"


def _positions(one: Covered) -> str:
    low, high = one.shown.factor * one.ends[1]
    if math.isnan(low):
        return "not measured"
    return f"{low:.0f} to {high:.0f} {one.shown.unit}"


def _signed(value: float) -> str:
    return f"{value:+.0f}".replace("+0", "0")


def _row(one: Covered) -> tuple[Cell, ...]:
    """Return what logs cover of a joint as a row of the table."""
    slowest, fastest = one.shown.factor * one.ends[2]
    share = "no ends" if one.share is None else f"{100 * one.share:.0f} %"
    forward, backward = one.seconds
    return (
        one.joint,
        one.shown.unit,
        _commands(one),
        _positions(one).removesuffix(f" {one.shown.unit}"),
        share,
        f"{slowest:.0f} to {fastest:.0f}",
        f"{forward:.0f} and {backward:.0f}",
    )
