"""`hydroid convert`: a log of any format as the plain CSV that every command reads without settings."""

import copy
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from hydroid.commands.check import plain_findings
from hydroid.commands.inputs import joint_ranges, load_settings, setting_changes
from hydroid.commands.options import Repair, Set, command
from hydroid.commands.result import Printed
from hydroid.errors import SettingsError
from hydroid.settings.load import replace_setting, validate
from hydroid.settings.log import LogSettings

if TYPE_CHECKING:
    from hydroid.commands.inputs import ConfigSource, Source
    from hydroid.log import ColumnGuess, Log, LogFinding, Table
    from hydroid.reporting.table import Table as ShownTable

MOST_JOINTS = 12
"""of a log whose columns are guessed"""


@dataclass(frozen=True, eq=False, repr=False)
class Conversion(Printed):
    """A log that was converted.

    Attributes:
        log: what was written; its source is the CSV.
        findings: about the log.
        guess: what each column was taken for; None where settings say it.
    """

    log: "Log"
    findings: "list[LogFinding]"
    guess: "ColumnGuess | None"

    def lines(self) -> "list[ShownTable | str]":
        """Return the guesses, the findings, and what was written."""
        import yaml

        lines: list[ShownTable | str] = []
        if self.guess:
            section = yaml.safe_dump(
                self.guess.log, default_flow_style=True, width=1e9, sort_keys=False, allow_unicode=True
            )
            unused = [f"not used: {', '.join(self.guess.unused)}"] if self.guess.unused else []
            lines += [*self.guess.reasons, *unused, f"as settings: log: {section.strip()}"]
        lines += [f"{finding.level}: {finding}" for finding in self.findings]
        written = f"{self.log.source}: {len(self.log.time)} samples, {self.log.duration:.2f} s"
        return [*lines, f"{written}, every {self.log.period:g} s"]

    def plain(self) -> dict[str, Any]:
        """Return the same by name."""
        return {
            "out": self.log.source,
            "samples": len(self.log.time),
            "duration_s": self.log.duration,
            "period_s": self.log.period,
            "log": self.guess and self.guess.log,
            "reasons": [*self.guess.reasons] if self.guess else [],
            "findings": plain_findings(self.findings),
        }


@command
def convert(
    log: Annotated[
        "Source", typer.Argument(metavar="LOG", help="CSV, .mat, Parquet, ROS bag or MCAP."), Path
    ],
    *,
    out: Annotated["Source", typer.Option("--out", "-o", metavar="OUT.csv", help="The CSV to write."), Path],
    config: Annotated[
        "ConfigSource | None",
        typer.Option(
            help="Settings that map the columns (`log`): a YAML file, or the name of a shipped config "
            "[default: the columns are guessed, and each guess is printed; --set corrects them]."
        ),
        str | None,
    ] = None,
    set: Set = None,
    repair: Repair = False,
) -> Conversion:
    """Write a log of any format as the CSV that every command reads: time [s], commands [%], angles [deg].

    With --config the CSV holds the data as a fit uses them: resampled to log.period_s, commands delayed by
    log.delay_s, signs and units applied. Joints that are measured but not commanded have commands of 0 %.

    Example: hydroid convert LOG.mat --out LOG.csv

        hydroid.convert("a.mat", out="a.csv", config="my-fit.yaml")

    Raises:
        LogError: the log cannot be used.
        SettingsError: `out` would overwrite the log, or a change that is not allowed.
        RunError: `out` cannot be written.
    """
    from hydroid.log import open_table, read_log, write_log

    path, target, changes, guess = Path(log), Path(out), setting_changes(set), None
    if target.resolve() == path.resolve():
        raise SettingsError("would overwrite the log", where=str(out), hint="name another file")
    settings = None if config is None else load_settings(config, changes)
    layout = LogSettings() if settings is None else settings.log
    table = open_table(path, layout)
    if settings is None or (_is_default(layout) and layout.time.column not in table.names):
        joints = None if settings is None else settings.arm.joint_names
        guess, layout = _guessed(table, joints, {} if settings else changes)
    if settings is None:
        ranges = np.full((max(layout.joints, default=1), 2), np.inf) * [-1, 1]
    else:
        ranges = joint_ranges(settings)
    read, findings = read_log(path, layout, ranges, repair=repair)
    write_log(target, read, _plain_layout(read), exact=True)
    return Conversion(replace(read, source=str(out)), findings, guess)


def _is_default(layout: LogSettings) -> bool:
    """Whether settings name the columns that they have without a section `log`."""
    columns = [
        [own.columns(kind, joint) for kind in ("command", "angle") for joint in range(1, MOST_JOINTS + 1)]
        for own in (layout, LogSettings())
    ]
    return layout.time == LogSettings().time and columns[0] == columns[1]


def _guessed(
    table: "Table", joints: "tuple[str, ...] | None", changes: Mapping[str, Any]
) -> "tuple[ColumnGuess, LogSettings]":
    """Guess the columns of a table by the names of the joints, and correct the guess by `changes`."""
    from hydroid.log import guess_columns

    names = joints or [f"joint{number}" for number in range(1, MOST_JOINTS + 1)]
    guess = guess_columns(table, names)
    section = copy.deepcopy({"log": guess.log})
    section["log"]["joints"] = {str(joint): own for joint, own in guess.log["joints"].items()}
    for key, value in changes.items():
        if not key.startswith("log."):
            raise SettingsError("is no setting of `log`", where=f"--set {key}", hint="give it with --config")
        replace_setting(section, key, value)
    layout = validate(section["log"], LogSettings, "the guessed columns", overridden=[*changes])
    return replace(guess, log=section["log"]), layout


def _plain_layout(log: "Log") -> LogSettings:
    """Return the default columns of what a log holds: commands, angles, pressures of both chambers."""
    pressures = np.zeros(log.joints, bool) if log.pressure is None else ~np.isnan(log.pressure[0]).any(axis=1)
    columns: dict[int, dict[str, None] | None] = {}
    for joint in range(log.joints):
        own = {} if log.measured[joint] else {"angle": None}
        own |= {} if pressures[joint] else {"pressure": None}
        columns[joint + 1] = own if log.measured[joint] or log.driven[joint] else None
    return LogSettings.model_validate({"pressure": {}, "joints": columns})
