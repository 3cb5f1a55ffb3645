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
from hydroid.estimate import NAME
from hydroid.identified_model import IdentifiedModel

if TYPE_CHECKING:
    from hydroid.commands.logs import LogSources
    from hydroid.fitting.validation import Prediction
    from hydroid.log import Log


MOST_ROWS = 12
"""joints of all fits that a terminal shows; of more those of the best fit"""


@command
def validate(
    logs: "LogSources",
    *,
    fit: "ModelSource | Sequence[ModelSource]",
    leave_one_out: bool = False,
    tolerance: float | None = None,
    out: "Source | None" = None,
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
        tolerance (0.001 to 90): An rms error [deg] that you accept, of every joint; config.yaml can
            hold one for each (tolerance_deg) [default: that of the fit, or else 2 % of a joint's travel].

    Raises:
        LogError: a log cannot be used.
        RunError: a simulation diverged, or the folder cannot be written.
    """
    given: list[ModelSource] = as_list(fit)
    if leave_one_out and len(given) > 1:
        raise SettingsError("takes one fit", where="--leave-one-out", hint="call it for each fit")
    models = [open_model(one, None, set) for one in given]
    read = [read_logs(logs, model.settings, repair=repair) for model in models]
    from hydroid.fitting.validation import predicted
    from hydroid.fitting.verdict import judge
    from hydroid.reporting.fit_report import draw
    from hydroid.reporting.page import unique
    from hydroid.reporting.validation_report import validation_page
    from hydroid.reporting.verdict_table import next_lines, next_step, ordered, verdict_lines
    from hydroid.run.identity import log_hash, was_fitted
    from hydroid.run.record import fitted_by, keep_validation

    results, verdicts = dict[str, Any](), dict[str, Any]()
    for one, model, own in zip(given, models, read, strict=True):
        name = unique(model.name, results)
        if leave_one_out:
            fitted, baselines, predictions = _left_out(model, own)
        else:
            if isinstance(one, str | Path | IdentifiedModel):
                fitted, baselines = fitted_by(model)
                seen = [was_fitted(Path(model.source).parent, log) for log in own]
            else:
                fitted, baselines = one.predictions, one.baselines
                hashes = {log_hash(log) for log in one.problem.logs}
                seen = [log_hash(log) in hashes for log in own]
            new = [None if known is None else not known for known in seen]
            predictions = [predicted(model, log, unseen) for log, unseen in zip(own, new, strict=True)]
            if out is not None and (run := keep_validation(model, predictions)):
                draw(run)
        unseen = [prediction for prediction in predictions if prediction.unseen is not False]
        stated = {} if tolerance is None else {"tolerance_deg": tolerance}
        verdicts[name] = judge(model.settings.model_copy(update=stated), fitted, baselines, unseen)
        results[name] = [replace(prediction, fit=name) for prediction in predictions]
    fits, arm = ordered(verdicts), models[0].settings.arm
    every = [prediction for name in fits for prediction in results[name]]
    best = next(iter(fits))
    model, steps = models[[*results].index(best)], list[Any]()
    if Path(model.source).name == NAME:
        steps.append(next_step(model.settings, fits[best], str(Path(model.source).parent)))
    page = validation_page(every, fits, arm, *steps)
    content = {
        "verdict": [{"fit": name} | one.model_dump() for name in fits for one in fits[name]],
        "results": [row for one in every for row in one.plain(arm.joint_names)],
    }
    few = fits if sum(map(len, fits.values())) <= MOST_ROWS else {best: fits[best]}
    details = [page.tables["verdict"], page.tables["errors"]]
    lines = [*verdict_lines(few), *(line for step in steps for line in next_lines(step))]
    return Result([*lines, *written(page, out)], content, every, page, details=details)


def _left_out(model: "IdentifiedModel", logs: "Sequence[Log]") -> Any:
    """Return what a fit makes of its logs, baselines that know all of them, and each predicted without it."""
    from hydroid.fitting.validation import predicted, without_one
    from hydroid.fitting.verdict import baselines_of

    folds = [without_one(model, logs, i) for i in range(len(logs))]
    predictions = [predicted(fold, log, unseen=True) for fold, log in zip(folds, logs, strict=True)]
    fitted = [predicted(model, log, unseen=False) for log in logs]
    return fitted, baselines_of(model.settings, logs), predictions
