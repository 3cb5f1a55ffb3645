"""What commands read: settings, logs, estimates. Each can be a file's name or what was read before."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hydroid.assets import find_config
from hydroid.errors import RunError, SettingsError
from hydroid.files import is_file
from hydroid.identified_model import IdentifiedModel, load_identified
from hydroid.progress import NOTE
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import load, parse_override

if TYPE_CHECKING:
    from hydroid.log import Log, LogFinding
    from hydroid.problem.problem import Problem

    LogSources = str | Path | Log | Sequence[str | Path | Log] | None

Source = str | Path
ConfigSource = str | Path | FitSettings
ModelSource = str | Path | IdentifiedModel
SettingChanges = Mapping[str, Any] | Sequence[str] | None
"""settings to replace: values by dotted key, or texts `KEY=VALUE`"""

_log = logging.getLogger(__name__)


def setting_changes(given: SettingChanges, **options: Any) -> dict[str, Any]:
    """Return settings to replace by dotted key: those of `--set`, and the options that are not None.

    In the names of options two underscores stand for a dot.

    Raises:
        SettingsError: a text that is no KEY=VALUE.
    """
    changes = dict(given if isinstance(given, Mapping) else map(parse_override, given or ()))
    return changes | {key.replace("__", "."): value for key, value in options.items() if value is not None}


def load_settings(config: ConfigSource, overrides: SettingChanges = None) -> FitSettings:
    """Read the settings of a fit, and the arm they name.

        settings = hydroid.load_settings("fit-mech", {"search.seed": 3})

    Args:
        config: a YAML file, the name of a shipped one, or settings that were read before.
        overrides: settings to replace, by dotted key.

    Raises:
        SettingsError: no such file, or a setting that is not allowed.
    """
    changes = setting_changes(overrides)
    if not isinstance(config, FitSettings):
        return load(find_config(config), FitSettings, changes)
    if changes:
        raise SettingsError("cannot be replaced in settings that are read", where=", ".join(changes))
    return config


def open_model(
    fit: ModelSource, config: ConfigSource | None = None, overrides: SettingChanges = None
) -> IdentifiedModel:
    """Return a model as it is, or read it from a run folder, a saved plant or a YAML file of values.

    Raises:
        RunError, SettingsError: as of `load_identified`.
    """
    if isinstance(fit, IdentifiedModel):
        return fit
    return load_identified(fit, _file(config), setting_changes(overrides))


def nominal_model(
    fit: ModelSource | None, config: ConfigSource | None, overrides: SettingChanges
) -> IdentifiedModel:
    """Do as `open_model`, with nominal values where an estimate has none; a note says which."""
    if isinstance(fit, IdentifiedModel):
        return fit
    changes = setting_changes(overrides)
    model = load_identified(fit, _file(config), changes, default="fit-hyd", nominal=True)
    if model.nominal:
        require_hydraulics(model)
        _log.log(NOTE, "note: nominal values for %s", ", ".join(model.nominal) if fit else "all parameters")
    return model


def require_hydraulics(model: IdentifiedModel) -> None:
    """Refuse a model of stage 1."""
    if model.settings.stage != "hyd":
        hint = "give a fit of stage 2 with --fit, or use --config fit-hyd"
        raise SettingsError("stage 1 (mech) does not model the actuators", where=model.source, hint=hint)


def problem_of(model: IdentifiedModel, logs: "LogSources", *, repair: bool = False) -> "Problem":
    """Return the estimation problem of a model and logs.

    Raises:
        RunError: the simulation diverges at the model's parameters.
    """
    read = read_logs(logs, model.settings, repair=repair)
    from hydroid.problem.problem import Problem

    problem = Problem(model.settings, read)
    if not np.isfinite(problem.residuals(model.theta[None])).all():
        raise RunError("the simulation diverged with these parameters", where=model.source)
    return problem


def read_logs(logs: "LogSources", settings: FitSettings, *, repair: bool = False) -> "list[Log]":
    """Read logs as the settings map them; warnings and notes go to the `hydroid` logger.

        logs = hydroid.read_logs(["a.csv", "b.csv"], hydroid.load_settings("fit-mech"))

    Args:
        logs: files, or logs that were read before; one or several.
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
    findings: list[LogFinding] = []
    for source in as_list(logs):
        if isinstance(source, Log):
            read.append(source)
            continue
        log, more = read_log(
            Path(source), settings.log, joint_ranges(settings), outputs=settings.outputs, repair=repair
        )
        findings += more
        pose = np.where(log.measured, log.angle, settings.arm.pose(settings.start_pose))
        read.append(replace(log, angle=pose))
    _report(findings)
    return read, findings


def read_commands(
    path: Source, settings: FitSettings, pose: str | None = None, *, repair: bool = False
) -> "Log":
    """Read a log of commands, whose angles may be missing.

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


def run_logs(run: ModelSource) -> list[Path]:
    """Return the logs that a run folder was fitted to.

    Raises:
        SettingsError: it is no run folder. RunError: a log is not there.
    """
    folder = Path(run.source).parent if isinstance(run, IdentifiedModel) else Path(run)
    if not is_file(folder / "run.json"):
        hint = "name one, as in hydroid suggest LOG.csv --fit RUN, or give a run folder as --fit"
        raise SettingsError("no log is given", hint=hint)
    from hydroid.run.folder import RunFolder

    logs = [Path(name) for name in RunFolder(folder).identity().get("logs", {})]
    missing = [str(log) for log in logs if not log.is_file()]
    if missing or not logs:
        raise RunError(f"its log {', '.join(missing)} is not there", where=str(folder), hint="name the log")
    return logs


def as_list(sources: Any) -> list[Any]:
    """Return one or several sources as a list; an empty one for none."""
    if sources is None:
        return []
    return list(sources) if isinstance(sources, Sequence) and not isinstance(sources, str) else [sources]


def joint_ranges(settings: FitSettings) -> np.ndarray:
    """Return the ranges of the arm's joints [rad], shape (J, 2)."""
    return np.stack([settings.arm.lower, settings.arm.upper], axis=1)


def _file(config: ConfigSource | None) -> Source | None:
    if isinstance(config, FitSettings):
        raise SettingsError("settings that are read make a model with `identified`", where="config")
    return config


def _report(findings: "Sequence[LogFinding]") -> None:
    from hydroid.log import grouped, in_one_line

    for finding, others in grouped(findings):
        level = logging.WARNING if finding.level == "warning" else NOTE
        _log.log(level, "%s: %s", finding.level, in_one_line(finding, others))
