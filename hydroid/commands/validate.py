"""`hydroid validate`: fits on logs that they were not fitted to."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from hydroid.commands.inputs import as_list, open_model
from hydroid.commands.logs import read_logs
from hydroid.commands.options import command
from hydroid.commands.result import Result, written
from hydroid.errors import SettingsError

if TYPE_CHECKING:
    from hydroid.commands.inputs import ModelSource, SettingChanges, Source
    from hydroid.commands.logs import LogSources
    from hydroid.fitting.validation import Prediction


@command
def validate(
    logs: "LogSources",
    *,
    fit: "ModelSource | Sequence[ModelSource]",
    leave_one_out: bool = False,
    out: "Source | None" = "runs/validation",
    set: "SettingChanges" = None,
    repair: bool = False,
) -> "Result[list[Prediction]]":
    """Test fits on logs that they were not fitted to: error indices (article, table 9) and plots.

    Each fit reads the logs with its own settings. The report of each run shows its unseen logs too.

    Example: hydroid validate OTHER.csv --fit runs/mech --fit runs/hyd

        validated = hydroid.validate("b.csv", fit="runs/a")
        print(validated.result[0].indices[2].rms)  # of joint 2 [rad]

    Args:
        fit (RUN|YAML): An estimate: a run folder, a folder written by Plant.save (Python), or a YAML file.
            Repeat the option for several estimates.
        leave_one_out: Give the fit's own logs. For each of them: refit without it, and predict it. Takes one
            fit.

    Raises:
        LogError: a log cannot be used.
        RunError: a simulation diverged, or the folder cannot be written.
    """
    models = [open_model(model, None, set) for model in as_list(fit)]
    if leave_one_out and len(models) > 1:
        raise SettingsError("takes one fit", where="--leave-one-out", hint="call it for each fit")
    read = [read_logs(logs, model.settings, repair=repair) for model in models]
    from hydroid.fitting.validation import predicted, without_one
    from hydroid.reporting.comparison import validation_page
    from hydroid.reporting.drawing import draw
    from hydroid.run.identity import was_fitted
    from hydroid.run.record import keep_validation

    folds = [without_one(models[0], read[0], i) for i in range(len(read[0]))] if leave_one_out else []
    by_model: list[list[Prediction]] = []
    for model, own in zip(models, read, strict=True):
        seen = [was_fitted(Path(model.source).parent, log) for log in own]
        unseen = [True if folds else None if fitted is None else not fitted for fitted in seen]
        by_model.append(list(map(predicted, folds or [model] * len(own), own, unseen)))
    results = [result for own in by_model for result in own]
    page = validation_page(results, models[0].settings.arm, folds)
    lines = [page.tables["errors"], *(f"- {warning}" for warning in page.warnings), *written(page, out)]
    if out is not None and not folds:
        for model, own in zip(models, by_model, strict=True):
            if (run := keep_validation(model, own)) is not None:
                draw([run], run)
    return Result(lines, {"results": [row for result in results for row in result.plain()]}, results, page)
