"""Plan what is next: `suggest` and `design`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hydroid.api.look import ModelSource, open_model, read_logs
from hydroid.api.study import Study
from hydroid.errors import RunError, SettingsError
from hydroid.files import is_file
from hydroid.identified_model import CONFIG, IdentifiedModel
from hydroid.log import write_log
from hydroid.progress import Progress, no_progress

if TYPE_CHECKING:
    from hydroid.advice.design import Design
    from hydroid.advice.proposals import Advice
    from hydroid.api.look import LogSources


def suggest(
    model: ModelSource,
    logs: "LogSources" = (),
    out: str | Path | None = "runs/suggestions",
    *,
    repair: bool = False,
    progress: Progress = no_progress,
) -> "Study[Advice]":
    """Find what the model lacks, what the residual shows, and what would determine more.

        study = hydroid.suggest("runs/a")
        for test in study.result.content["missing"]:
            print(test["name"], test["rms_deg"])

    Args:
        model: as of `design`.
        logs: CSV files or logs, one or several; none: those of the run folder `model`.
        out: folder for the page, tables and figure; None: nothing is written.
        repair: fill holes of the logs up to `log.repair_s`.
        progress: called with what is done, how much of it, and how much there is.

    Raises:
        LogError: a log cannot be used.
        SettingsError: no log is given, and `model` is no run folder.
        RunError: the simulation diverged, a log of the run is not there, or the folder cannot be written.
    """
    from hydroid.advice.proposals import advice
    from hydroid.advice.suggest import suggestions
    from hydroid.posterior.covariance import uncertainty
    from hydroid.problem.problem import Problem
    from hydroid.report.page import log_names
    from hydroid.report.suggestion_report import suggestion_page

    opened = open_model(model)
    given = logs if not isinstance(logs, Sequence) or len(logs) else run_logs(model)
    problem = Problem(opened.settings, read_logs(given, opened.settings, repair=repair))
    if not np.isfinite(problem.residuals(opened.theta[None])).all():
        raise RunError("the simulation diverged with these parameters", where=opened.source)
    result = suggestions(problem, uncertainty(problem, opened.theta), progress=progress)
    source = Path(opened.source)
    run = str(source.parent) if is_file(source.parent / CONFIG) else "RUN"
    advised = advice(problem, result, run)
    page = suggestion_page(problem.settings, advised, log_names(problem.logs), opened.name)
    return Study(advised, page).write(out)


def run_logs(model: ModelSource) -> list[Path]:
    """Logs that a run folder was fitted to."""
    source = Path(model.source).parent if isinstance(model, IdentifiedModel) else Path(model)
    if not is_file(source / "run.json"):
        raise SettingsError(
            "no log is given",
            hint="name one, as in hydroid suggest LOG.csv --fit RUN, or give a run folder as --fit",
        )
    from hydroid.run.folder import RunFolder

    logs = [Path(name) for name in RunFolder(source).identity().get("logs", {})]
    missing = [str(log) for log in logs if not log.is_file()]
    if missing:
        raise RunError(f"its log {', '.join(missing)} is not there", where=str(source), hint="name the log")
    return logs


def design(
    model: ModelSource,
    logs: "LogSources" = (),
    out: str | Path | None = "runs/design",
    *,
    seed: int = 1,
    progress: Progress = no_progress,
) -> "Study[Design]":
    """Choose start pose and commands that determine most what is known least.

        model = hydroid.load_identified("runs/a", overrides={"design.duration_s": 30})
        commands = hydroid.design(model).result.log

    Limits and length are the settings `design`. They are checked on the simulated response only.

    Args:
        model: at the present estimate: a run folder, a YAML file of values or an identified model.
        logs: CSV files or logs whose information is there already.
        out: folder for the report, commands.csv (every angle in the start pose) and predicted.csv (the
            simulated motion, which is no measurement); None: nothing is written.
        seed: the same seed gives the same experiment.
        progress: called with what is done, how much of it, and how much there is.

    Raises:
        SettingsError: limits that no experiment keeps.
        RunError: the folder cannot be written.
    """
    from hydroid.advice import design as experiment
    from hydroid.report.design_report import design_page

    model = open_model(model)
    settings = model.settings
    result = experiment.design(settings, model.theta, read_logs(logs, settings), seed, progress)
    if out is not None:
        write_log(Path(out) / "commands.csv", result.log, settings.log)
        write_log(Path(out) / "predicted.csv", result.predicted, settings.log)
    return Study(result, design_page(settings.arm, settings.design, result, model.values)).write(out)
