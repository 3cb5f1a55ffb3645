"""What a log holds: its columns, and how the joints move in it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hydroid.errors import LogError
from hydroid.log import Log, Table, check_log, guess_columns, suggest_delay
from hydroid.settings.arm import Arm
from hydroid.settings.load import validate
from hydroid.settings.log import LogSettings

FAST = 95
"""percentile of the speeds in a log that counts as what its valves let through"""
STILL_DEG = 1.0
"""travel below which a joint without a command counts as standing still"""
SMOOTHING_S = 0.1
"""over which a speed is taken"""


@dataclass(frozen=True)
class Layout:
    """The columns of a log, and what its numbers say.

    Attributes:
        section: the `log` section of a fit's settings.
        outputs: joints with a command and an angle, numbered from 1.
        reasons: a line for each column, and for what was found in the numbers.
        unused: names of the other columns.
        speeds: of the joints that move, by number [rad/s].
        lags: of the joints behind their commands, by number [s].
        followed: whether a joint without a command moves.
    """

    section: dict[str, Any]
    outputs: tuple[int, ...]
    reasons: tuple[str, ...]
    unused: tuple[str, ...] = ()
    speeds: Mapping[int, float] = field(default_factory=dict[int, float])
    lags: Mapping[int, float] = field(default_factory=dict[int, float])
    followed: bool = False


def find_layout(table: Table, arm: Arm) -> Layout:
    """Guess the columns of a log, turn commands that act against the angle, and see how fast joints are.

    Raises:
        LogError: no column looks like a time, or no joint has an angle.
    """
    guess = guess_columns(table, arm.joint_names)
    section, reasons = guess.log, [*guess.reasons]
    entries: dict[int, Any] = section["joints"]
    if not any(entry["angle"] for entry in entries.values()):
        hint = f"rename them, or write the log section by hand; columns: {', '.join(table.names)}"
        raise LogError("has no column that looks like an angle", where=table.source, hint=hint)
    log = _read(table.source, section, arm, reasons)
    speeds, lags, followed = dict[int, float](), dict[int, float](), False
    for joint, entry in entries.items() if log is not None else ():
        assert log is not None
        name = arm.joint_names[joint - 1]
        if entry["angle"] is None:
            continue
        reasons += _outside(log, joint, arm)
        speeds[joint] = _speed(log, joint)
        if entry["command"] is None:
            followed |= float(np.degrees(np.ptp(log.angle[:, joint - 1]))) > STILL_DEG
        elif (delay := suggest_delay(log, joint)) is not None:
            lags[joint] = delay.lag
            if delay.sign < 0:
                entry["command"] = turned(entry["command"])
                reasons.append(f"{name} moves against its command: the sign of the command is turned round")
    driven = tuple(j for j, e in entries.items() if e["command"] is not None and e["angle"] is not None)
    outputs = driven or tuple(j for j, e in entries.items() if e["angle"] is not None)
    moving = {joint: speed for joint, speed in speeds.items() if speed > math.radians(0.1)}
    return Layout(section, outputs, tuple(reasons), guess.unused, moving, lags, followed)


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
    limits = " to ".join(f"{limit:g}" for limit in arm.joints[joint - 1].range)
    return [
        f"{arm.joint_names[joint - 1]}: the angles in the log run from {math.degrees(low):.1f} to "
        f"{math.degrees(high):.1f} deg, but the arm's file allows {limits}: give the angle an offset or a "
        "scale of -1, or change the range"
    ]


def _speed(log: Log, joint: int) -> float:
    """How fast a joint moves when it moves [rad/s]."""
    apart = max(round(SMOOTHING_S / log.period), 1)
    angle = log.angle[:, joint - 1]
    if len(angle) <= apart:
        return 0.0
    return float(np.percentile(np.abs(angle[apart:] - angle[:-apart]), FAST)) / (apart * log.period)
