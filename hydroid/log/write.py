"""`Log` -> CSV, in the columns and units from which the same settings read it back."""

import csv
import io
from pathlib import Path

import numpy as np

from hydroid.errors import LogError
from hydroid.files import write_atomic
from hydroid.log.log import Floats, Log
from hydroid.log.resample import hold
from hydroid.log.signals import Signal, map_signals
from hydroid.settings.log import LogSettings

DIGITS = "%.10g"


def write_log(path: Path, log: Log, settings: LogSettings) -> None:
    """Write a log, whole or not at all.

    The command is written ahead by `settings.delay_s`, so that reading delays it to what `log` holds.

    Raises:
        LogError: the settings map no column for a joint that is driven, or a column for an angle that was not
            measured.
        RunError: the file cannot be written.
    """
    signals = map_signals(settings, np.full((log.joints, 2), np.inf))
    if log.pressure is None:
        signals = [signal for signal in signals if signal.kind != "pressure"]
    _check(path, log, signals)
    command = hold(log.time, log.command, log.time + settings.delay_s, log.period)
    columns = [_cells(signal, log, command) for signal in signals]
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow([signal.name for signal in signals])
    np.savetxt(text, np.stack(columns, axis=1), fmt=DIGITS, delimiter=",")
    write_atomic(path, text.getvalue())


def _check(path: Path, log: Log, signals: list[Signal]) -> None:
    commanded = {signal.joint for signal in signals if signal.kind == "command"}
    for joint in np.flatnonzero(log.driven) + 1:
        if joint not in commanded:
            hint = f"map a column in log.joints.{joint}.command"
            raise LogError(
                f"joint {joint} is driven but no column holds its command", where=str(path), hint=hint
            )
    for signal in signals:
        if signal.kind == "angle" and not log.measured[signal.joint - 1]:
            hint = f"set log.joints.{signal.joint}.angle: null"
            raise LogError(f"joint {signal.joint} has no angle to write", where=str(path), hint=hint)


def _cells(signal: Signal, log: Log, command: Floats) -> Floats:
    """Return the column [file's unit] whose reading gives the log's values, shape (T,)."""
    values = log.time
    if signal.kind == "command":
        values = signal.sign * command[:, signal.joint - 1]
        values = values.clip(min=0.0) if signal.low == 0 else values
    elif signal.kind == "angle":
        values = log.angle[:, signal.joint - 1]
    elif signal.kind == "pressure":
        assert log.pressure is not None
        values = log.pressure[:, signal.joint - 1, signal.chamber]
    return (values - signal.offset) / signal.gain
