"""`Log` -> a CSV file that reads back the same."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hydroid.arrays import Array
from hydroid.errors import LogError
from hydroid.files import csv_text, write_atomic
from hydroid.log.conditions import absolute, is_condition
from hydroid.log.log import Log
from hydroid.log.mapping import map_signals
from hydroid.log.repair import hold
from hydroid.log.table import Signal
from hydroid.settings.arm import Arm
from hydroid.settings.log import LogSettings

EXACT_DIGITS = (15, 16, 17)
"""of cells, tried in turn: with 17 every number reads back to the same bits"""


def write_log(
    path: Path,
    log: Log,
    settings: LogSettings,
    *,
    exact: bool = False,
    arm: Arm | None = None,
) -> None:
    """Write a log, whole or not at all. The `arm` has the cylinders whose lengths stand
    for angles.

    Cells have ten digits, or with `exact` as many as it takes to read the same bits
    back; where no cell does (degrees for a value that was in radians) the last bit may
    differ. The command is written ahead by `settings.delay_s`, so that reading delays
    it to what `log` holds.

    Raises LogError: the settings map no column for a joint that is driven, or one for
    an angle that was not measured.
    """
    write_logs(path, [(log, settings)], exact=exact, arm=arm)


def write_logs(
    path: Path,
    logs: Sequence[tuple[Log, LogSettings]],
    *,
    exact: bool = False,
    arm: Arm | None = None,
) -> None:
    """Write logs of the same time side by side into one file, each with its settings,
    as `write_log` does."""
    columns = dict[str, list[str]]()
    for log, settings in logs:
        names = map(str, range(1, 1 + log.joints))
        # ranges are for what is read
        unlimited = dict.fromkeys(names, (np.inf, np.inf))
        signals = map_signals(settings, unlimited, arm)
        _refuse_incomplete(path, log, signals)
        at = log.time + settings.delay_s
        command = hold(log.time, log.command, at, log.period)
        for signal in signals:
            if signal.kind == "pressure" and log.pressure is None:
                continue
            if is_condition(signal) and log.conditions is None:
                continue
            values = _values(signal, log, command)
            columns[signal.name] = _cells(signal, values, exact=exact)
    rows = zip(*columns.values(), strict=True)
    write_atomic(path, csv_text([columns, *rows]))


def _refuse_incomplete(path: Path, log: Log, signals: Sequence[Signal]) -> None:
    """Refuse a command without a column, and a column without an angle."""
    mapped = {(signal.kind, signal.joint) for signal in signals}
    for joint in range(1, 1 + log.joints):
        if log.drives(joint) and ("command", joint) not in mapped:
            what = f"joint {joint} is driven but no column holds its command"
            hint = f"map a column in log.joints.{joint}.command"
            raise LogError(what, path, hint)
        if not log.measures(joint) and ("angle", joint) in mapped:
            hint = f"set log.joints.{joint}.angle: null"
            raise LogError(f"joint {joint} has no angle to write", path, hint)


def _values(signal: Signal, log: Log, command: Array) -> Array:
    """Return what a column of a log holds in SI, shape (T,), from commands of which the
    delay is taken off, shape (T, J)."""
    joint = signal.joint - 1
    if signal.kind == "command":
        # the second column is for the negative direction
        sign = 1
        if signal.part:
            sign = -1
        return (sign * command[:, joint]).clip(min=signal.low)
    if signal.kind == "angle":
        angle = log.angle[:, joint]
        # the file holds the length of the joint's cylinder
        if signal.rod is not None:
            return signal.rod.cylinder.length(angle)
        return angle
    if signal.kind == "pressure":
        assert log.pressure is not None
        return log.pressure[:, joint, signal.part]
    if is_condition(signal):
        return absolute(signal, log)
    return log.time


def _cells(signal: Signal, values: Array, *, exact: bool) -> list[str]:
    """Return the cells of a column: ten digits, or the shortest that read back the
    same."""
    numbers = (values - signal.offset) / signal.gain
    cells = np.array([f"{number:.10g}" for number in numbers], dtype=object)
    for digits in EXACT_DIGITS if exact else ():
        read_back = cells.astype(float) * signal.gain + signal.offset
        wrong = np.flatnonzero(read_back != values)
        cells[wrong] = [f"{number:.{digits}g}" for number in numbers[wrong]]
    return cells.tolist()
