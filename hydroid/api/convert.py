"""`convert`: a log of any format -> the plain CSV that every command reads without settings."""

import copy
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hydroid.api.look import joint_ranges
from hydroid.errors import SettingsError
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import replace_setting, validate

if TYPE_CHECKING:
    from hydroid.log import ColumnGuess, Log, LogFinding

MOST_JOINTS = 12
"""of a log whose columns are guessed"""


@dataclass(frozen=True, eq=False)
class Conversion:
    """A converted log: what was written, what reading it found, and the guess if there were no settings."""

    log: "Log"
    findings: "list[LogFinding]"
    guess: "ColumnGuess | None"


def convert(
    log: str | Path,
    out: str | Path,
    settings: FitSettings | None = None,
    *,
    changes: Mapping[str, Any] | None = None,
    repair: bool = False,
) -> Conversion:
    """Write a log as CSV with the default columns: time [s], commands [%], angles [deg], pressures [bar].

        hydroid.convert("a.mat", "a.csv", hydroid.load_settings("my-fit.yaml"))

    The file holds what a fit with these settings uses: resampled to `log.period_s`, commands delayed by
    `log.delay_s`, signs and units applied. Joints that are measured but not commanded have commands of 0 %.

    Args:
        log: a file of any format.
        out: the CSV to write.
        settings: of a fit, which map the columns. None, or settings without a `log` section whose columns the
            file lacks: the columns are guessed, by the names of the arm's joints if there are settings.
        changes: settings to replace in what was guessed, by dotted key: {"log.joints.2.command.scale": -1}.
        repair: fill holes up to `log.repair_s`.

    Raises:
        LogError: the log cannot be used.
        SettingsError: `out` would overwrite the log, or a change that is not allowed.
        RunError: `out` cannot be written.
    """
    from hydroid.log import guess_columns, open_table, read_log, write_log
    from hydroid.settings.log import LogSettings

    path, guess = Path(log), None
    if Path(out).resolve() == path.resolve():
        raise SettingsError("would overwrite the log", where=str(out), hint="name another file")
    if settings is None:
        names = [f"joint{number}" for number in range(1, MOST_JOINTS + 1)]
    else:
        names = settings.arm.joint_names
    layout = LogSettings() if settings is None else settings.log
    table = open_table(path, layout)
    if settings is None or (layout == LogSettings() and layout.time.column not in table.names):
        guess = guess_columns(table, names)
        section = copy.deepcopy({"log": guess.log})
        section["log"]["joints"] = {str(joint): own for joint, own in guess.log["joints"].items()}
        for key, value in (changes or {}).items():
            if not key.startswith("log."):
                raise SettingsError(
                    "is no setting of `log`", where=f"--set {key}", hint="give it with --config"
                )
            replace_setting(section, key, value)
        guess = replace(guess, log=section["log"])
        layout = validate(section["log"], LogSettings, "the guessed columns", overridden=[*(changes or {})])
    joints = max(layout.joints, default=1) if settings is None else len(names)
    ranges = np.full((joints, 2), np.inf) * [-1, 1] if settings is None else joint_ranges(settings)
    read, findings = read_log(path, layout, ranges, repair=repair)
    columns: dict[int, dict[str, None] | None] = {}
    pressures = _with_pressures(read)
    for joint in range(1, read.joints + 1):
        own = {} if read.measured[joint - 1] else {"angle": None}
        own |= {} if joint in pressures else {"pressure": None}
        known = read.measured[joint - 1] or read.driven[joint - 1]
        columns[joint] = own if known else None
    plain = LogSettings.model_validate({"pressure": {}, "joints": columns})
    write_log(Path(out), read, plain, exact=True)
    return Conversion(replace(read, source=str(out)), findings, guess)


def _with_pressures(log: "Log") -> list[int]:
    """Return the joints of which a log holds both chamber pressures, by number."""
    if log.pressure is None:
        return []
    return (np.flatnonzero(~np.isnan(log.pressure[0]).any(axis=1)) + 1).tolist()
