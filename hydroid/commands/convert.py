"""`hydroid convert`: a log of any format as the plain CSV that every command reads without settings."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hydroid.commands.check import plain_findings
from hydroid.commands.inputs import (
    ConfigSource,
    SettingChanges,
    Source,
    load_settings,
    refuse_overwriting,
    setting_changes,
)
from hydroid.commands.options import command
from hydroid.commands.result import Result
from hydroid.errors import SettingsError
from hydroid.settings.load import replace_setting, validate
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
            [default: the columns are guessed, and each guess is printed; --set corrects them].

    Raises:
        LogError: the log cannot be used.
        SettingsError: `out` would overwrite the log, or a change that is not allowed.
        RunError: `out` cannot be written.
    """
    from hydroid.log import read_log, write_log

    path, target, changes = Path(log), Path(out), setting_changes(set)
    refuse_overwriting(path, target)
    guess = None
    if config is not None:
        settings = load_settings(config, changes)
        layout, ranges = settings.log, settings.arm.ranges
    else:
        guess, layout = _guessed(path, changes)
        ranges = np.full((max(layout.joints, default=1), 2), np.inf) * [-1, 1]
    read, findings = read_log(path, layout, ranges, repair=repair)
    write_log(target, read, _plain_layout(read), exact=True)
    lines = [
        *(_guess_lines(guess) if guess else ()),
        *(f"{finding.level}: {finding}" for finding in findings),
    ]
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


def _guessed(path: Path, changes: Mapping[str, Any]) -> "tuple[ColumnGuess, LogSettings]":
    """Guess the columns of a log, and correct the guess by `changes`."""
    from hydroid.log import guess_columns, open_table

    # more joints than an arm has
    guess = guess_columns(open_table(path, LogSettings()), [f"joint{number}" for number in range(1, 13)])
    section = {"log": guess.log | {"joints": {str(n): {**own} for n, own in guess.log["joints"].items()}}}
    for key, value in changes.items():
        if not key.startswith("log."):
            raise SettingsError("is no setting of `log`", where=f"--set {key}", hint="give it with --config")
        replace_setting(section, key, value)
    layout = validate(section["log"], LogSettings, "the guessed columns", overridden=[*changes])
    return guess._replace(log=section["log"]), layout


def _guess_lines(guess: "ColumnGuess") -> list[str]:
    import yaml

    flow: Any = {"default_flow_style": True, "width": 1e9, "sort_keys": False, "allow_unicode": True}
    unused = [f"not used: {', '.join(guess.unused)}"] if guess.unused else []
    return [*guess.reasons, *unused, f"as settings: log: {yaml.safe_dump(guess.log, **flow).strip()}"]


def _plain_layout(log: "Log") -> LogSettings:
    """Return the default columns of what a log holds: commands, angles, pressures of both chambers."""
    pressures = np.zeros(log.joints, bool) if log.pressure is None else ~np.isnan(log.pressure[0]).any(axis=1)
    columns: dict[int, dict[str, None] | None] = {}
    for joint in range(log.joints):
        held = {"angle": log.measured[joint], "pressure": pressures[joint]}
        absent = {kind: None for kind, there in held.items() if not there}
        columns[joint + 1] = absent if log.measured[joint] or log.driven[joint] else None
    return LogSettings.model_validate({"pressure": {}, "joints": columns})
