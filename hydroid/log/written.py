"""`Log` -> CSV, written so that it reads back the same."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hydroid.errors import LogError
from hydroid.files import write_atomic
from hydroid.log.log import Floats, Log
from hydroid.log.resample import hold
from hydroid.log.signals import Signal, map_signals
from hydroid.settings.log import LogSettings

DIGITS = "%.10g"


def write_log(path: Path, log: Log, settings: LogSettings, *, exact: bool = False) -> None:
    """Write a log, whole or not at all.

    Cells have ten digits, or with `exact` as many as it takes to read the same bits back; where no cell does
    (degrees for a value that was in radians) the last bit may differ. The command is written ahead by
    `settings.delay_s`, so that reading delays it to what `log` holds.

    Raises:
        LogError: the settings map no column for a joint that is driven, or a column for an angle that was not
            measured.
        RunError: the file cannot be written.
    """
    write_logs(path, [(log, settings)], exact=exact)


def write_logs(path: Path, logs: Sequence[tuple[Log, LogSettings]], *, exact: bool = False) -> None:
    """Write logs of the same time side by side into one file, each with its settings, as `write_log` does."""
    columns: dict[str, list[str]] = {}
    for log, settings in logs:
        columns |= _columns(path, log, settings, exact)
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(columns)
    text.writelines(",".join(row) + "\n" for row in zip(*columns.values(), strict=True))
    write_atomic(path, text.getvalue())


def _columns(path: Path, log: Log, settings: LogSettings, exact: bool) -> dict[str, list[str]]:
    """Return the cells by the names of their columns, T each."""
    signals = map_signals(settings, np.full((log.joints, 2), np.inf))
    if log.pressure is None:
        signals = [signal for signal in signals if signal.kind != "pressure"]
    commanded = {signal.joint for signal in signals if signal.kind == "command"}
    for joint in np.flatnonzero(log.driven) + 1:
        if joint not in commanded:
            hint = f"map a column in log.joints.{joint}.command"
            what = f"joint {joint} is driven but no column holds its command"
            raise LogError(what, where=str(path), hint=hint)
    for signal in signals:
        if signal.kind == "angle" and not log.measured[signal.joint - 1]:
            hint = f"set log.joints.{signal.joint}.angle: null"
            raise LogError(f"joint {signal.joint} has no angle to write", where=str(path), hint=hint)
    command = hold(log.time, log.command, log.time + settings.delay_s, log.period)
    cells: dict[str, list[str]] = {}
    for signal in signals:
        values = _values(signal, log, command)
        numbers = (values - signal.offset) / signal.gain
        cells[signal.name] = _exact(signal, values) if exact else [DIGITS % number for number in numbers]
    return cells


def _values(signal: Signal, log: Log, command: Floats) -> Floats:
    """Return what a signal's cells are read as, shape (T,)."""
    if signal.kind == "command":
        values = signal.sign * command[:, signal.joint - 1]
        return values.clip(min=0.0) if signal.low == 0 else values
    if signal.kind == "angle":
        return log.angle[:, signal.joint - 1]
    if signal.kind == "pressure":
        assert log.pressure is not None
        return log.pressure[:, signal.joint - 1, signal.chamber]
    return log.time


def _exact(signal: Signal, values: Floats) -> list[str]:
    """Return the shortest cells of ten digits or more that are read as these values."""
    wanted = (values - signal.offset) / signal.gain
    cells = np.array([DIGITS % cell for cell in wanted], dtype=object)
    for digits in ("%.15g", "%.16g", "%.17g"):
        wrong = np.flatnonzero(cells.astype(float) * signal.gain + signal.offset != values)
        cells[wrong] = [digits % cell for cell in wanted[wrong]]
    return cells.tolist()
