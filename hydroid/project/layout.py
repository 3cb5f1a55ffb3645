"""What a log holds: its columns, and how the joints move in it."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hydroid.errors import LogError, SettingsError
from hydroid.log import JointMotion, Log, Table, check_log, driven_joints, guess_columns, motion_of
from hydroid.settings.arm import Arm
from hydroid.settings.load import validate
from hydroid.settings.log import LogSettings

REVERSED = (
    "a command is reversed as if its valve were wired the other way round; where it is the angle that counts "
    "the other way (compare arm.png), set the angle's scale to -1 instead, because gravity follows the angle"
)
CLEARER = 0.3
"""correlation with another joint's command above that with its own from which on it is worth a word"""
DEAD_BAND = 10.0
"""above which it is worth a word [%]"""
STILL_DEG = 1.0
"""travel below which a joint without a command counts as standing still"""


@dataclass(frozen=True)
class Layout:
    """The columns of a log, and what its numbers say.

    Attributes:
        section: the `log` section of a fit's settings.
        outputs: joints with a command and an angle, numbered from 1.
        reasons: a line for each column, and for what was found in the numbers.
        unused: names of the other columns.
        motions: how the measured joints move, by number.
        followed: whether a joint without a command moves.
    """

    section: dict[str, Any]
    outputs: tuple[int, ...]
    reasons: tuple[str, ...]
    unused: tuple[str, ...] = ()
    motions: Mapping[int, JointMotion] = field(default_factory=dict[int, JointMotion])
    followed: bool = False


def find_layout(table: Table, arm: Arm, order: Sequence[str] = ()) -> Layout:
    """Guess the columns of a log, turn commands that act against the angle, and see how fast joints are.

    Args:
        table: the log.
        arm: whose joints it is about.
        order: names of the joints as the log counts them; by default those of the arm.

    Raises:
        LogError: no column looks like a time, or no joint has an angle.
        SettingsError: a name in `order` that no joint has.
    """
    for name in order:
        if name not in arm.joint_names:
            hint = f"the arm's joints: {', '.join(arm.joint_names)}"
            raise SettingsError(f"no joint {name!r}", where="--joints", hint=hint)
    guess = guess_columns(table, order or arm.joint_names)
    section = guess.log
    reasons = [re.sub(r"joint \d+ \((\w+)\)", r"\1", reason) for reason in guess.reasons]
    entries: dict[int, Any] = section["joints"]
    if order:
        entries = {arm.joint_names.index(order[k - 1]) + 1: entry for k, entry in entries.items()}
        section["joints"] = entries = dict(sorted(entries.items()))
    if not any(entry["angle"] for entry in entries.values()):
        hint = f"rename them, or write the log section by hand; columns: {', '.join(table.names)}"
        raise LogError("has no column that looks like an angle", where=table.source, hint=hint)
    log = _read(table.source, section, arm, reasons)
    motions, followed = dict[int, JointMotion](), False
    for joint, entry in entries.items() if log is not None else ():
        assert log is not None
        if entry["angle"] is None:
            continue
        reasons += _outside(log, joint, arm)
        motions[joint] = motion = motion_of(log, joint)
        reasons += _remarks(motion, arm.joint_names) if log.driven[joint - 1] else []
        if entry["command"] is None:
            followed |= motion.travel > STILL_DEG
        elif motion.turned:
            entry["command"] = turned(entry["command"])
    if any(motion.turned for motion in motions.values()):
        reasons.append(REVERSED)
    driven = tuple(j for j, e in entries.items() if e["command"] is not None and e["angle"] is not None)
    outputs = driven or tuple(j for j, e in entries.items() if e["angle"] is not None)
    return Layout(section, outputs, tuple(reasons), guess.unused, motions, followed)


def _remarks(motion: JointMotion, names: Sequence[str]) -> list[str]:
    """Return what a user should know of a driven joint."""
    name, follows = names[motion.joint - 1], {j: motion.follows(j)[0] for j in driven_joints(motion.log)}
    own, other = follows[motion.joint], max(follows, key=lambda joint: follows[joint])
    if follows[other] > own + CLEARER:
        return [
            f"{name} follows the command of {names[other - 1]} (correlation {follows[other]:.2f}) more than "
            f"its own ({own:.2f}): check which columns belong together"
        ]
    lines, (path, against) = list[str](), motion.directed
    if motion.turned:
        share = f"for {against:.0%} of {path:.3g} deg of travel"
        lines.append(f"{name} moves against its command ({share}): the sign of the command is reversed")
    if motion.dead_band > DEAD_BAND:
        lines.append(f"{name} does not move below about {motion.dead_band:g} % of command: a dead band")
    return lines


def turned(command: dict[str, Any]) -> dict[str, Any]:
    """Return the settings of a command of the other sign."""
    if isinstance(command["column"], list):
        return command | {"column": command["column"][::-1]}
    changed = {"scale": -command.get("scale", 1.0)}
    return command | changed | ({"offset": -command["offset"]} if command.get("offset") else {})


def _read(source: str, section: dict[str, Any], arm: Arm, reasons: list[str]) -> Log | None:
    settings = validate(section, LogSettings, source)
    free = np.tile([-np.inf, np.inf], (len(arm.joints), 1))
    log, findings = check_log(Path(source), settings, free, repair=True)
    if log is None:
        reasons.append(f"the log cannot be used as it is: {findings[0]}")
    return log


def _outside(log: Log, joint: int, arm: Arm) -> list[str]:
    angle = log.angle[:, joint - 1]
    low, high = float(np.nanmin(angle)), float(np.nanmax(angle))
    margin = math.radians(LogSettings().angle_margin_deg)
    if low >= arm.lower[joint - 1] - margin and high <= arm.upper[joint - 1] + margin:
        return []
    limits = " to ".join(f"{limit:.6g}" for limit in arm.joints[joint - 1].range)
    return [
        f"{arm.joint_names[joint - 1]}: the angles in the log run from {math.degrees(low):.1f} to "
        f"{math.degrees(high):.1f} deg, but the arm allows {limits}: give the angle an offset or a "
        "scale of -1, or change the range"
    ]
