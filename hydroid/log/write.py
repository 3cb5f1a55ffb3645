"""`Log` -> CSV, written so that it reads back the same."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hydroid.errors import LogError
from hydroid.files import write_atomic
from hydroid.log.columns import Signal, map_signals
from hydroid.log.log import Floats, Log
from hydroid.log.repair import hold
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
        command = hold(log.time, log.command, log.time + settings.delay_s, log.period)
        for signal in _signals(path, log, settings):
            columns[signal.name] = _cells(signal, _values(signal, log, command), exact)
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(columns)
    text.writelines(",".join(row) + "\n" for row in zip(*columns.values(), strict=True))
    write_atomic(path, text.getvalue())


def _signals(path: Path, log: Log, settings: LogSettings) -> list[Signal]:
    """Return the columns to write; refuse to lose a command, or to write an angle that is not there."""
    signals = map_signals(settings, np.full((log.joints, 2), np.inf))
    columns = {kind: {s.joint for s in signals if s.kind == kind} for kind in ("command", "angle")}
    for joint in (np.flatnonzero(log.driven) + 1).tolist():
        if joint not in columns["command"]:
            what, hint = (
                f"joint {joint} is driven but no column holds its command",
                f"map a column in log.joints.{joint}.command",
            )
            raise LogError(what, where=str(path), hint=hint)
    for joint in (np.flatnonzero(~log.measured) + 1).tolist():
        if joint in columns["angle"]:
            hint = f"set log.joints.{joint}.angle: null"
            raise LogError(f"joint {joint} has no angle to write", where=str(path), hint=hint)
    return [signal for signal in signals if signal.kind != "pressure" or log.pressure is not None]


def _values(signal: Signal, log: Log, command: Floats) -> Floats:
    """Return what a signal's cells are read as, shape (T,)."""
    column = signal.joint - 1
    if signal.kind == "command":
        values = -command[:, column] if signal.part else command[:, column]
        return values.clip(min=0.0) if signal.low == 0 else values
    if signal.kind == "pressure":
        assert log.pressure is not None
        return log.pressure[:, column, signal.part]
    return log.angle[:, column] if signal.kind == "angle" else log.time


def _cells(signal: Signal, values: Floats, exact: bool) -> list[str]:
    """Return cells of ten digits, or the shortest of more that are read as these values."""
    wanted = (values - signal.offset) / signal.gain
    cells = np.array([DIGITS % cell for cell in wanted], dtype=object)
    for digits in ("%.15g", "%.16g", "%.17g") if exact else ():
        wrong = np.flatnonzero(cells.astype(float) * signal.gain + signal.offset != values)
        cells[wrong] = [digits % cell for cell in wanted[wrong]]
    return cells.tolist()
