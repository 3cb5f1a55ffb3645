"""`hydroid validate`: fits on logs that they were not fitted to."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydroid.commands.inputs import ModelSource, SettingChanges, Source, as_list, open_model
from hydroid.commands.logs import read_logs
from hydroid.commands.options import command
from hydroid.commands.result import Result, written
from hydroid.errors import SettingsError

if TYPE_CHECKING:
    from hydroid.commands.logs import LogSources
    from hydroid.estimate import JointVerdict
    from hydroid.fitting.validation import Prediction
    from hydroid.identified_model import IdentifiedModel
    from hydroid.log import Log


MOST_ROWS = 12
"""joints of all fits that a terminal shows; of more those of the best fit"""


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
    """Test fits on logs that they were not fitted to: a verdict on each joint beside simple models' errors.

    Each fit reads the logs with its own settings. The report of each run shows its unseen logs too. Error
    indices (article, table 9) and responses stand on the page.

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
    from hydroid.reporting.fit_report import draw
    from hydroid.reporting.page import unique
    from hydroid.reporting.validation_report import validation_page
    from hydroid.reporting.verdict_table import ordered, verdict_table
    from hydroid.run.record import keep_validation

    predicted, verdicts = dict[str, Any](), dict[str, Any]()
    for model, own in zip(models, read, strict=True):
        name = unique(model.name, predicted)
        test = _left_out if leave_one_out else _predicted
        predictions, verdicts[name] = test(model, own)
        predicted[name] = [replace(one, fit=name) for one in predictions]
        if out is not None and not leave_one_out and (run := keep_validation(model, predictions)):
            draw(run)
    fits, arm = ordered(verdicts), models[0].settings.arm
    results = [one for name in fits for one in predicted[name]]
    page = validation_page(results, fits, arm)
    content = {
        "verdict": [{"fit": name} | one.model_dump() for name in fits for one in fits[name]],
        "results": [row for one in results for row in one.plain(arm.joint_names)],
    }
    best = next(iter(fits))
    few = fits if sum(map(len, fits.values())) <= MOST_ROWS else {best: fits[best]}
    details = [page.tables["verdict"], page.tables["errors"]]
    return Result([verdict_table(few), *written(page, out)], content, results, page, details=details)


def _predicted(
    model: "IdentifiedModel", logs: "Sequence[Log]"
) -> "tuple[list[Prediction], tuple[JointVerdict, ...]]":
    """Return predictions of logs, and the verdict by those that the fit has not seen."""
    from hydroid.fitting.validation import predicted
    from hydroid.fitting.verdict import judge
    from hydroid.run.identity import was_fitted
    from hydroid.run.record import fitted_by

    seen = [was_fitted(Path(model.source).parent, log) for log in logs]
    predictions = [
        predicted(model, log, None if s is None else not s) for log, s in zip(logs, seen, strict=True)
    ]
    unseen = [one for one in predictions if one.unseen is not False]
    return predictions, judge(model.settings, *fitted_by(model), unseen)


def _left_out(
    model: "IdentifiedModel", logs: "Sequence[Log]"
) -> "tuple[list[Prediction], tuple[JointVerdict, ...]]":
    """Return the prediction of each log by a fit to the others, and the verdict; baselines know all logs."""
    from hydroid.fitting.validation import predicted, without_one
    from hydroid.fitting.verdict import baselines_of, judge

    folds = [without_one(model, logs, i) for i in range(len(logs))]
    predictions = [predicted(fold, log, unseen=True) for fold, log in zip(folds, logs, strict=True)]
    fitted = [predicted(model, log, unseen=False) for log in logs]
    return predictions, judge(model.settings, fitted, baselines_of(model.settings, logs), predictions)
