"""Plan the next experiment: `design`."""

from pathlib import Path
from typing import TYPE_CHECKING

from hydroid.api.look import ModelSource, open_model, read_logs
from hydroid.api.study import Study
from hydroid.log import write_log
from hydroid.progress import Progress, no_progress

if TYPE_CHECKING:
    from hydroid.api.look import LogSources
    from hydroid.experiment.design import Design


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
    from hydroid.experiment import design as experiment
    from hydroid.report.design_report import design_page

    model = open_model(model)
    settings = model.settings
    result = experiment.design(settings, model.theta, read_logs(logs, settings), seed, progress)
    if out is not None:
        write_log(Path(out) / "commands.csv", result.log, settings.log)
        write_log(Path(out) / "predicted.csv", result.predicted, settings.log)
    return Study(result, design_page(settings.arm, settings.design, result, model.values)).write(out)
