"""Look at logs, actuators and the moving arm: `check`, `plot_actuator`, `view`; and read inputs."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hydroid.assets import find_config
from hydroid.errors import SettingsError
from hydroid.identified_model import IdentifiedModel, load_identified
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import load

if TYPE_CHECKING:
    from hydroid.log import Log, LogFinding

    LogSources = str | Path | Log | Sequence[str | Path | Log]

NOTE = 25
"""level of the logging module between INFO and WARNING, for notes on a log"""
logging.addLevelName(NOTE, "NOTE")

_log = logging.getLogger(__name__)


ModelSource = str | Path | IdentifiedModel


def open_model(model: ModelSource) -> IdentifiedModel:
    """Return a model as it is, or read it from a run folder, a saved plant or a YAML file of values."""
    return model if isinstance(model, IdentifiedModel) else load_identified(model)


def load_settings(config: str | Path, overrides: Mapping[str, Any] | None = None) -> FitSettings:
    """Read the settings of a fit, and the arm they name.

        settings = hydroid.load_settings("fit-mech", {"search.seed": 3})

    Args:
        config: a YAML file, or the name of a shipped one.
        overrides: settings to replace, by dotted key.

    Raises:
        SettingsError: no such file, or a setting that is not allowed.
    """
    return load(find_config(config), FitSettings, dict(overrides or {}))


def read_logs(logs: "LogSources", settings: FitSettings, *, repair: bool = False) -> "list[Log]":
    """Read logs as the settings map them; warnings and notes go to the `hydroid` logger.

        logs = hydroid.read_logs(["a.csv", "b.csv"], hydroid.load_settings("fit-mech"))

    Args:
        logs: CSV files, or logs that were read before; one or several.
        settings: of the fit; joints that a log does not measure stand in its `start_pose`.
        repair: fill holes up to `log.repair_s`.

    Raises:
        LogError: the first fault that keeps a log from being used.
    """
    return read_with_findings(logs, settings, repair=repair)[0]


def read_with_findings(
    logs: "LogSources", settings: FitSettings, *, repair: bool = False
) -> "tuple[list[Log], list[LogFinding]]":
    """Do as `read_logs`, and return the warnings and notes too."""
    from hydroid.log import Log, read_log

    read: list[Log] = []
    found: list[LogFinding] = []
    for path in [logs] if isinstance(logs, str | Path | Log) else logs:
        if isinstance(path, Log):
            read.append(path)
            continue
        log, findings = read_log(
            Path(path), settings.log, joint_ranges(settings), outputs=settings.outputs, repair=repair
        )
        found += findings
        pose = np.where(log.measured, log.angle, settings.arm.pose(settings.start_pose))
        read.append(replace(log, angle=pose))
    _report(found)
    return read, found


def read_commands(
    path: str | Path, settings: FitSettings, pose: str | None = None, *, repair: bool = False
) -> "Log":
    """Read a CSV of commands, whose angles may be missing.

    Args:
        path: the file.
        settings: which map its columns.
        pose: pose of the arm's file to start from; None: as logged, or the settings' pose where unmeasured.
        repair: fill holes up to `log.repair_s`.

    Raises:
        LogError: a fault that keeps the commands from being used.
        SettingsError: no such pose.
    """
    from hydroid.log import read_log

    start = settings.arm.pose(pose or settings.start_pose)
    log, findings = read_log(
        Path(path), settings.log, joint_ranges(settings), angles_required=False, repair=repair
    )
    _report(findings)
    return replace(log, angle=np.where(log.measured & (pose is None), log.angle, start))


@dataclass(frozen=True, eq=False)
class LogCheck:
    """What `check` found in one file.

    Attributes:
        path: the file.
        log: None if it is unusable.
        findings: all of them, errors first.
        moved_deg: range over which each driven joint moved, by its number.
    """

    path: Path
    log: "Log | None"
    findings: "list[LogFinding]"
    moved_deg: dict[int, float] = field(default_factory=dict[int, float])


@dataclass(frozen=True, eq=False)
class Check:
    """What `check` found in each file, and in all usable ones together."""

    logs: list[LogCheck]
    findings: "list[LogFinding]"


def check(logs: Sequence[str | Path], settings: FitSettings, *, repair: bool = False) -> Check:
    """Find everything that is wrong or odd about logs, and what they lack.

        result = hydroid.check(["a.csv", "b.csv"], hydroid.load_settings("fit-mech"))
        for log in result.logs:
            print(log.path, *log.findings)
        print(*result.findings)

    Args:
        logs: files.
        settings: of the fit that is to use them.
        repair: fill holes up to `log.repair_s`.
    """
    from hydroid.log import check_log, driven_joints, motion_findings, survey

    how: dict[str, Any] = {"outputs": settings.outputs, "repair": repair}
    results: list[LogCheck] = []
    for path in map(Path, logs):
        log, findings = check_log(path, settings.log, joint_ranges(settings), **how)
        if log is None:
            results.append(LogCheck(path, log, findings))
            continue
        motions = {joint: motion.travel for joint, motion in driven_joints(log).items()}
        results.append(LogCheck(path, log, [*findings, *motion_findings(log)], motions))
    return Check(results, survey([result.log for result in results if result.log]))


def plot_actuator(model: ModelSource, joint: int = 2, out: str | Path = "runs/actuator") -> list[Path]:
    """Draw the curves of one actuator: calibration, current, force, spool, opening, flow and torque.

        hydroid.plot_actuator("runs/hyd", joint=2)

    The curves of a fit have bands, their 95 % intervals.

    Args:
        model: of stage 2: a run folder, a YAML file of values or an identified model.
        joint: numbered from 1.
        out: folder for the figures.

    Returns:
        The files.

    Raises:
        SettingsError: no such joint, no hydraulics, or no force-stroke curve.
        RunError: `out` cannot be written.
    """
    model = open_model(model)
    require_hydraulics(model)
    from hydroid.posterior.posterior import stored_posterior
    from hydroid.problem.stage import Stage
    from hydroid.report.actuator_report import KnownActuator, actuator_page, joint_actuator, joint_records
    from hydroid.report.page_file import write_page

    stage, arm = Stage(model.settings), model.settings.arm
    actuator = joint_actuator(arm, stage.candidates(model.theta[None]), joint, model.source)
    if (posterior := stored_posterior(model)) is not None:
        known = KnownActuator(posterior, lambda theta: joint_records(arm, stage.candidates(theta), joint))
        actuator = replace(actuator, known=known)
    return write_page(actuator_page(actuator), Path(out))


def require_hydraulics(model: IdentifiedModel) -> None:
    """Refuse a model of stage 1."""
    if model.settings.stage != "hyd":
        hint = "give a fit of stage 2 with --fit, or use --config fit-hyd"
        raise SettingsError("stage 1 (mech) does not model the actuators", where=model.source, hint=hint)


def joint_ranges(settings: FitSettings) -> np.ndarray:
    """Return the ranges of the arm's joints [rad], shape (J, 2)."""
    return np.stack([settings.arm.lower, settings.arm.upper], axis=1)


def _report(findings: "Sequence[LogFinding]") -> None:
    from hydroid.log import grouped, in_one_line

    for finding, others in grouped(findings):
        level = logging.WARNING if finding.level == "warning" else NOTE
        _log.log(level, "%s: %s", finding.level, in_one_line(finding, others))
