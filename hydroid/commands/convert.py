"""`hydroid convert`: a log of any format as the plain CSV that every command reads without settings."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hydroid.commands.inputs import ConfigSource, SettingChanges, Source, load_settings, refuse_overwriting
from hydroid.commands.logs import plain_findings
from hydroid.commands.options import command
from hydroid.commands.result import Result
from hydroid.settings.log import LogSettings

if TYPE_CHECKING:
    from hydroid.log import ColumnGuess, Log


class Converted(NamedTuple):
    """What was written, and what each column was taken for; None where settings say it."""

    log: "Log"
    guess: "ColumnGuess | None"


@command
def convert(
    log: "Source",
    *,
    out: "Source",
    config: "ConfigSource | None" = None,
    set: "SettingChanges" = None,
    repair: bool = False,
) -> Result[Converted]:
    """Write a log of any format as the CSV that every command reads: time [s], commands [%], angles [deg].

    With --config the CSV holds the data as a fit uses them: resampled to log.period_s, commands delayed by
    log.delay_s, signs and units applied. Joints that are measured but not commanded have commands of 0 %.

    Example: hydroid convert LOG.mat --out LOG.csv

        hydroid.convert("a.mat", out="a.csv", config="my-fit.yaml")

    Args:
        log (LOG): CSV, .mat, Parquet, ROS bag or MCAP.
        out (OUT.csv): The CSV to write.
        config (YAML): Settings that map the columns (`log`): a file, or the name of a shipped config
            [default: the columns are guessed, and each guess is printed].
        set (KEY=VALUE): Replace a setting of --config.

    Raises:
        LogError: the log cannot be used.
        SettingsError: `out` would overwrite the log, or a setting that is not allowed.
        RunError: `out` cannot be written.
    """
    from hydroid.log import guess_columns, open_table, read_log, write_log

    path, guess = Path(log), None
    refuse_overwriting(path, out)
    if config is not None or set:
        settings = load_settings(config or "fit-mech", set)
        layout, ranges = settings.log, settings.arm.ranges
    else:
        most = [f"joint{number}" for number in range(1, 13)]  # more joints than an arm has
        guess = guess_columns(open_table(path, LogSettings()), most)
        layout = LogSettings.model_validate(guess.log)
        ranges = np.full((max(layout.joints, default=1), 2), np.inf) * [-1, 1]
    read, findings = read_log(path, layout, ranges, repair=repair)
    write_log(Path(out), read, _plain_layout(read), exact=True)
    unused = [f"not used: {', '.join(guess.unused)}"] if guess and guess.unused else []
    lines = [*(guess.reasons if guess else ()), *unused, *(f"{f.level}: {f}" for f in findings)]
    size = f"{len(read.time)} samples, {read.duration:.2f} s, every {read.period:g} s"
    content = {
        "out": str(out),
        "samples": len(read.time),
        "duration_s": read.duration,
        "period_s": read.period,
        "findings": plain_findings(findings),
        "log": guess and guess.log,
        "reasons": [*guess.reasons] if guess else [],
    }
    return Result([*lines, f"{out}: {size}"], content, Converted(replace(read, source=str(out)), guess))


def _plain_layout(log: "Log") -> LogSettings:
    """Return the default columns of what a log holds: commands, angles, pressures of both chambers."""
    pressures = np.zeros(log.joints, bool) if log.pressure is None else ~np.isnan(log.pressure[0]).any(axis=1)
    columns: dict[int, dict[str, None] | None] = {}
    for joint in range(log.joints):
        held = {"angle": log.measured[joint], "pressure": pressures[joint]}
        absent = {kind: None for kind, there in held.items() if not there}
        columns[joint + 1] = absent if log.measured[joint] or log.driven[joint] else None
    return LogSettings.model_validate({"pressure": {}, "joints": columns})
