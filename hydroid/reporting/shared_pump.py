"""How much slower a joint is while another one takes oil from the same pump."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from hydroid.arrays import Array
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.log.command_sizes import largest_commands
from hydroid.plant.plant import Plant
from hydroid.plant.steady import SteadyArm
from hydroid.reporting.page import Cell, Table
from hydroid.reporting.parameters_report import direction_word
from hydroid.words import three_digits

LEAST_PART = 1e-3
"""of the largest command's speed, below which a joint stands still"""
_NOTE = (
    "Two joints that share the pump, at the estimate. alone: the steady speed at the joint's largest "
    "command of the logs, at mid travel; the others stand where the first log starts. beside: its "
    "change while that joint has its own largest command, in the direction that slows this one more."
)


class Drive(NamedTuple):
    """A joint, numbered from 1, under its largest command of the logs in one direction
    [%], and what the joint then does."""

    joint: int
    command: float
    word: str


class SlowDown(NamedTuple):
    """The table of what joints lose beside another one, and the most that one of them
    loses, in words."""

    table: Table
    answer: str


def slow_down(model: IdentifiedModel, logs: Sequence[Log]) -> SlowDown | None:
    """Return how much slower joints are beside each other.

    None of a single joint, and of a model that has no settled speeds, or a pump without
    a limit.
    """
    settings = model.settings
    outputs = settings.outputs
    plant = Plant(model, joints=outputs)
    limited = np.isfinite(plant.actuators["pump_flow"]).any()
    if len(outputs) < 2 or not settings.rung.has("pump_flow") or not limited:
        return None
    drives = [*_drives(model, logs)]
    changes = _changes(plant.steady(), drives, logs)
    names = [settings.arm.name_of(joint) for joint in outputs]
    header = ("joint", "command", "unit", "alone", *(f"beside {one}" for one in names))
    rows = list[tuple[Cell, ...]]()
    most = dict[int, float]()
    for drive, (alone, beside) in zip(drives, changes, strict=True):
        if np.isnan(beside).all():
            continue
        shown = settings.arm.joint(drive.joint).shown
        name = settings.arm.name_of(drive.joint)
        command = f"{drive.command:+.0f} % {drive.word}".strip()
        of_others = beside[[joint - 1 for joint in outputs]]
        speed = three_digits(abs(shown.factor * alone))
        cells = [_percent(change) for change in of_others]
        rows.append((name, command, f"{shown.unit}/s", speed, *cells))
        lost = float(np.nanmin(of_others))
        most[drive.joint] = min(lost, most.get(drive.joint, lost))
    if not rows:
        return None
    slowest = min(most, key=most.__getitem__)
    slowed = f"{settings.arm.name_of(slowest)} {_percent(most[slowest])}"
    return SlowDown(
        Table("", header, tuple(rows), _NOTE),
        f"{slowed} beside another joint",
    )


def _drives(model: IdentifiedModel, logs: Sequence[Log]) -> Iterator[Drive]:
    """Yield the largest commands of the logs, both directions of each joint."""
    summary = model.summarise()
    arm = model.settings.arm
    for joint in model.settings.outputs:
        negative, positive = largest_commands(logs, joint)
        name = arm.name_of(joint)
        for towards, command in (("positive", positive), ("negative", negative)):
            if command:
                word = direction_word(summary, name, towards)
                yield Drive(joint, float(command), word)


def _changes(
    steady: SteadyArm, drives: Sequence[Drive], logs: Sequence[Log]
) -> list[tuple[float, Array]]:
    """Return of each drive the speed alone [rad/s], and its change beside each joint of
    the arm [%], (J,): NaN beside itself, and where it stands still alone."""
    travelled = np.concatenate([log.posed for log in logs])
    middle = (travelled.min(axis=0) + travelled.max(axis=0)) / 2
    count = len(drives)
    joints = len(middle)
    # row by row: a drive, and the other that has its command as well
    commands = np.zeros((count, count, joints))
    # of the drive as on the bench, whose speeds other sections state
    poses = np.tile(logs[0].start, (count, count, 1))
    for i, drive in enumerate(drives):
        place = drive.joint - 1
        for k, other in enumerate(drives):
            commands[i, k, other.joint - 1] = other.command
        # the other direction of the same joint leaves it alone
        commands[i, :, place] = drive.command
        poses[i, :, place] = middle[place]
    rows = count * count
    speeds = steady.speeds(commands.reshape(rows, joints), poses.reshape(rows, joints))
    speeds = speeds.reshape(commands.shape)
    top = np.abs(speeds).max(axis=(0, 1))
    changes = list[tuple[float, Array]]()
    for i, drive in enumerate(drives):
        of_drive = speeds[i, :, drive.joint - 1]
        alone = float(of_drive[i])
        beside = np.full(joints, np.nan)
        if abs(alone) > LEAST_PART * top[drive.joint - 1]:
            for k, other in enumerate(drives):
                if other.joint != drive.joint:
                    change = 100.0 * (of_drive[k] / alone - 1.0)
                    place = other.joint - 1
                    beside[place] = np.fmin(beside[place], change)
        changes.append((alone, beside))
    return changes


def _percent(change: float) -> str:
    """Write a change [%]; nothing of NaN."""
    if np.isnan(change):
        return ""
    return f"{change:+.0f} %" if abs(change) >= 0.5 else "0 %"
