"""`Log` -> CSV, in the columns and units from which the same settings read it back."""

import csv
import io
from pathlib import Path

import numpy as np

from hydroid.errors import LogError
from hydroid.files import write_atomic
from hydroid.log.channels import Channel, map_channels
from hydroid.log.log import Floats, Log
from hydroid.log.resample import hold
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
    channels = map_channels(settings, np.full((log.joints, 2), np.inf))
    if log.pressure is None:
        channels = [channel for channel in channels if channel.kind != "pressure"]
    _check(path, log, channels)
    command = hold(log.time, log.command, log.time + settings.delay_s, log.period)
    columns = [_cells(channel, log, command) for channel in channels]
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow([channel.name for channel in channels])
    np.savetxt(text, np.stack(columns, axis=1), fmt=DIGITS, delimiter=",")
    write_atomic(path, text.getvalue())


def _check(path: Path, log: Log, channels: list[Channel]) -> None:
    commanded = {channel.joint for channel in channels if channel.kind == "command"}
    for joint in np.flatnonzero(log.driven) + 1:
        if joint not in commanded:
            hint = f"map a column in log.joints.{joint}.command"
            raise LogError(
                f"joint {joint} is driven but no column holds its command", where=str(path), hint=hint
            )
    for channel in channels:
        if channel.kind == "angle" and not log.measured[channel.joint - 1]:
            hint = f"set log.joints.{channel.joint}.angle: null"
            raise LogError(f"joint {channel.joint} has no angle to write", where=str(path), hint=hint)


def _cells(channel: Channel, log: Log, command: Floats) -> Floats:
    """Return the column [file's unit] whose reading gives the log's values, shape (T,)."""
    values = log.time
    if channel.kind == "command":
        values = channel.sign * command[:, channel.joint - 1]
        values = values.clip(min=0.0) if channel.low == 0 else values
    elif channel.kind == "angle":
        values = log.angle[:, channel.joint - 1]
    elif channel.kind == "pressure":
        assert log.pressure is not None
        values = log.pressure[:, channel.joint - 1, channel.chamber]
    return (values - channel.offset) / channel.gain
