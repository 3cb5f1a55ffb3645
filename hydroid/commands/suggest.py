"""`hydroid suggest`: what the model lacks, and what would determine more."""

from pathlib import Path
from typing import TYPE_CHECKING

from hydroid.commands.inputs import ConfigSource, ModelSource, SettingChanges, Source, open_model
from hydroid.commands.logs import problem_of
from hydroid.commands.options import command
from hydroid.commands.progress import Progress
from hydroid.commands.result import Result, written
from hydroid.files import is_file
from hydroid.identified_model import CONFIG

if TYPE_CHECKING:
    from hydroid.advice.suggestions import Advice
    from hydroid.commands.logs import LogSources
    from hydroid.reporting.table import Table


@command
def suggest(
    logs: "LogSources" = (),
    *,
    fit: "ModelSource",
    out: "Source | None" = "runs/suggestions",
    config: "ConfigSource | None" = None,
    set: "SettingChanges" = None,
    repair: bool = False,
) -> "Result[Advice]":
    """Find what the model lacks, and what to do next.

    Tests every parameter that is kept fixed, switched off or shared, such as a delay or dry friction. The
    most promising ones are freed: does that lower the error on parts of the logs left out? Shows what the
    residual depends on, and predicts for the best actions, from weighing a link to a new experiment, how much
    each would reduce the uncertainty.

    Example: hydroid suggest --fit runs/hyd

        suggested = hydroid.suggest(fit="runs/a").plain()
        print([(term["name"], term["gain_percent"]) for term in suggested["terms"]])

    Raises:
        LogError: a log cannot be used.
        SettingsError: no log is given, and the estimate is not in a run folder.
        RunError: the simulation diverged, a log of the run is not there, or the folder cannot be written.
    """
    model = open_model(fit, config, set)
    problem = problem_of(model, logs, repair=repair)
    from hydroid.advice.suggestions import advice
    from hydroid.posterior.uncertainty import uncertainty
    from hydroid.reporting.page import log_names
    from hydroid.reporting.suggestion_report import suggestion_tables, suggestions

    folder = Path(model.source).parent
    run = str(folder) if is_file(folder / CONFIG) else "RUN"
    with Progress() as progress:
        advised = advice(problem, uncertainty(problem, model.theta), run, progress)
    tables = suggestion_tables(advised.content)
    said = suggestions(problem.settings, advised, log_names(problem.logs))
    lines: list[Table | str] = [*tables.values(), *(f"- {text}" for text in said)]
    return Result([*lines, *written(tables, out)], advised.content, advised)
