"""`Log` -> CSV, written so that it reads back the same."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hydroid.arrays import Array
from hydroid.errors import LogError
from hydroid.files import write_atomic
from hydroid.log.log import Log
from hydroid.log.read import map_signals
from hydroid.log.repair import hold
from hydroid.log.table import Signal
from hydroid.settings.log import LogSettings


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
        signals = map_signals(settings, np.full((log.joints, 2), np.inf))
        _refuse_loss(path, log, {(signal.kind, signal.joint) for signal in signals})
        command = hold(log.time, log.command, log.time + settings.delay_s, log.period)
        for signal in signals:
            values, joint = log.time, signal.joint - 1
            if signal.kind == "command":
                values = (-command if signal.part else command)[:, joint].clip(min=signal.low)
            elif signal.kind == "angle":
                values = log.angle[:, joint]
            elif signal.kind == "pressure":
                if log.pressure is None:
                    continue
                values = log.pressure[:, joint, signal.part]
            columns[signal.name] = _cells(signal, values, exact)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    write_atomic(path, text.getvalue())


def _refuse_loss(path: Path, log: Log, mapped: set[tuple[str, int]]) -> None:
    """Refuse to lose a command, or to write an angle that is not there."""
    for joint, (driven, measured) in enumerate(zip(log.driven, log.measured, strict=True), 1):
        if driven and ("command", joint) not in mapped:
            what = f"joint {joint} is driven but no column holds its command"
            raise LogError(what, where=path, hint=f"map a column in log.joints.{joint}.command")
        if not measured and ("angle", joint) in mapped:
            hint = f"set log.joints.{joint}.angle: null"
            raise LogError(f"joint {joint} has no angle to write", where=path, hint=hint)


def _cells(signal: Signal, values: Array, exact: bool) -> list[str]:
    """Return cells of ten digits, or the shortest of more that are read as these values."""
    wanted = (values - signal.offset) / signal.gain
    cells = np.array([f"{cell:.10g}" for cell in wanted], dtype=object)
    for digits in (15, 16, 17) if exact else ():
        wrong = np.flatnonzero(cells.astype(float) * signal.gain + signal.offset != values)
        cells[wrong] = [f"{cell:.{digits}g}" for cell in wanted[wrong]]
    return cells.tolist()
