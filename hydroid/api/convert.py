"""`convert`: a log of any format -> the plain CSV that every command reads without settings."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hydroid.api.look import joint_ranges
from hydroid.errors import SettingsError
from hydroid.settings.fit import FitSettings

if TYPE_CHECKING:
    from hydroid.log import ColumnGuess, Finding, Log

MOST_JOINTS = 12
"""of a log whose columns are guessed"""


@dataclass(frozen=True, eq=False)
class Conversion:
    """A converted log: what was written, what reading it found, and the guess if there were no settings."""

    log: "Log"
    findings: "list[Finding]"
    guess: "ColumnGuess | None"


def convert(
    log: str | Path, out: str | Path, settings: FitSettings | None = None, *, repair: bool = False
) -> Conversion:
    """Write a log as CSV with the default columns: time [s], commands [%], angles [deg], pressures [bar].

        hydroid.convert("a.mat", "a.csv", hydroid.load_settings("my-fit.yaml"))

    The file holds what a fit with these settings uses: resampled to `log.period_s`, commands delayed by
    `log.delay_s`, signs and units applied. Joints that are measured but not commanded have commands of 0 %.

    Args:
        log: a file of any format.
        out: the CSV to write.
        settings: of a fit, which map the columns; None: the columns are guessed.
        repair: fill holes up to `log.repair_s`.

    Raises:
        LogError: the log cannot be used.
        SettingsError: `out` would overwrite the log.
        RunError: `out` cannot be written.
    """
    from hydroid.log import guess_columns, open_table, read_log, write_log
    from hydroid.settings.log import LogSettings

    path, guess = Path(log), None
    if Path(out).resolve() == path.resolve():
        raise SettingsError("would overwrite the log", where=str(out), hint="name another file")
    if settings is None:
        joints = [f"joint{number}" for number in range(1, MOST_JOINTS + 1)]
        guess = guess_columns(open_table(path), joints)
        layout = LogSettings.model_validate(guess.log)
        ranges = np.full((max(layout.joints, default=1), 2), np.inf) * [-1, 1]
    else:
        layout, ranges = settings.log, joint_ranges(settings)
    read, findings = read_log(path, layout, ranges, repair=repair)
    columns: dict[str, dict[str, dict[str, str] | None] | None] = {}
    pressures = _with_pressures(read)
    for joint in range(1, read.joints + 1):
        own: dict[str, dict[str, str] | None] = {} if read.measured[joint - 1] else {"angle": None}
        own |= {"pressure": {}} if joint in pressures else {}
        known = read.measured[joint - 1] or read.driven[joint - 1]
        columns[str(joint)] = own if known else None
    write_log(Path(out), read, LogSettings.model_validate({"joints": columns}), exact=True)
    return Conversion(replace(read, source=str(out)), findings, guess)


def _with_pressures(log: "Log") -> list[int]:
    """Return the joints of which a log holds both chamber pressures, by number."""
    if log.pressure is None:
        return []
    return (np.flatnonzero(~np.isnan(log.pressure[0]).any(axis=1)) + 1).tolist()
