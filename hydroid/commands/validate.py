"""`hydroid validate` and `hydroid report`: fits on logs that they were not fitted to; reports drawn anew."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from hydroid.commands.console import Result, written
from hydroid.commands.inputs import (
    LogSources,
    ModelSource,
    SettingChanges,
    Source,
    as_list,
    command,
    open_model,
)
from hydroid.commands.logs import read_logs, seen_logs
from hydroid.files import Plain
from hydroid.identified_model import IdentifiedModel, warn_of_changes
from hydroid.log import Log
from hydroid.log.overlap import KNOWN, overlap
from hydroid.progress import LOGGER
from hydroid.words import listed, numbered

if TYPE_CHECKING:
    from hydroid.fitting.validation import Prediction
    from hydroid.run.record import Record


@command
def validate(
    logs: "LogSources",
    *,
    fit: "ModelSource | Sequence[ModelSource]",
    tolerance: float | None = None,
    apart: bool = False,
    out: "Source | None" = None,
    set: "SettingChanges" = None,
    repair: bool = False,
) -> "Result[list[Prediction]]":
    """Test fits on logs that they have not seen: a verdict on each joint, beside the errors of simple models.

    Each fit reads the logs with its own settings. The page shows every response with its errors (article,
    table 9). From then on, the report of the fit's own run shows these logs too.

    Example: hydroid validate OTHER.csv --fit runs/mech --fit runs/hyd

        validated = hydroid.validate("b.csv", fit="runs/a")
        print(validated.result[0]["boom"].rms)  # [deg]

    Args:
        fit (RUN|YAML): An estimate: a run folder, a folder written by Plant.save (Python), or a YAML file.
            Repeat the option for several estimates.
        tolerance (0.001 to 90): The rms error [deg] that you accept for every joint; config.yaml can
            hold one for each (tolerance_deg) [default: that of the fit, or else 2 % of a joint's travel].
        apart: These logs are of other conditions than the fit's, such as another load: its own report shows
            them, and does not count them in its verdict. Without it, they count again.

    Raises:
        LogError: a log cannot be used.
        RunError: the folder cannot be written.
    """
    given: list[ModelSource] = as_list(fit)
    models = [open_model(one, None, set) for one in given]
    read = [read_logs(logs, model.settings, repair=repair) for model in models]
    from hydroid.fitting.validation import predicted
    from hydroid.fitting.verdict import judge, standing_out
    from hydroid.reporting.predictions import draw, validation_page
    from hydroid.reporting.verdict_table import next_lines, next_step, ordered, verdict_lines
    from hydroid.run.record import fitted_by, keep_validation, run_of

    stated = {} if tolerance is None else {"tolerance_deg": tolerance}
    results, verdicts, own_logs = Plain(), Plain(), Plain()
    named = dict(zip(numbered(model.name for model in models), models, strict=True))
    for one, own, (name, model) in zip(given, read, named.items(), strict=True):
        fitted, baselines = fitted_by(model)
        if not isinstance(one, str | Path | IdentifiedModel):
            fitted, baselines = one.predictions, one.baselines
        known = seen_logs(one)
        predictions = [predicted(model, log, _unseen(log, known) if known else None) for log in own]
        kept = [replace(one, apart=apart) for one in predictions]
        if out is not None and (run := keep_validation(model, kept)):
            draw(run)
        own_logs[name] = fitted
        verdicts[name] = judge(model.settings.changed(stated), fitted, baselines, predictions)
        results[name] = [replace(prediction, fit=name) for prediction in predictions]
    fits, arm = ordered(verdicts), models[0].settings.arm
    every = [prediction for name in fits for prediction in results[name]]
    best = next(iter(fits))
    run = run_of(named[best])
    steps = [next_step(named[best].summarise(), fits[best], str(run), own_logs[best])] if run else []
    page = validation_page(every, fits, arm, *steps)
    content = {
        "verdict": [{"fit": name} | one.model_dump() for name in fits for one in fits[name]],
        "results": [row for one in every for row in one.plain(arm.joint_names)],
    }
    lines = [*verdict_lines(fits), *(line for step in steps for line in next_lines(step))]
    lines += map(str, standing_out(results[best], fits[best], str(run or "RUN")))
    if seen := [one.log.source for one in results[best] if one.unseen is False]:
        lines.insert(
            1, f"The fit, or one that it began from, was made with {listed(seen, 3)}: that tests nothing."
        )
    return Result([*lines, *written(page, out)], content, every, page, details=[page.tables["errors"]])


def _unseen(log: Log, fitted: Sequence[Log]) -> bool:
    """Return whether a log is none of the fitted ones, in whatever file, and holds no large part of them."""
    part = overlap(log, fitted)
    if 0 < part < 1:
        counts = "unseen" if part < KNOWN else "fitted"
        text = "warning: %.0f %% of the motion in %s stands in the fitted logs: it counts as %s"
        LOGGER.warning(text, 100 * part, log.source, counts)
    return part < KNOWN


@command
def report(
    runs: "Source | Sequence[Source]",
    *,
    merge: bool = False,
    figures: bool = False,
    out: "Source | None" = None,
) -> "Result[tuple[Record, ...]]":
    """Draw the reports of finished runs anew, or merge runs of one fit with different seeds.

    Nothing is simulated, and no log is needed: a run stores all that its report shows, which is written again
    in its folder. `hydroid validate` compares several fits.

    Example: hydroid report runs/mech runs/hyd

        hydroid.report(["runs/mech", "runs/hyd"])
        print(hydroid.report("runs/array/seed-*", merge=True).content["best"])

    Args:
        runs (RUN): Folders of finished runs; with --merge also a quoted pattern.
        merge: The folders are runs of one fit with different seeds: show median and spread of their
            estimates. Runs that are not finished or damaged are left out, with a warning.
        figures: Also write every chart as PNG and SVG, to figures/.
        out (DIR): Folder for the tables of --merge.

    Raises:
        RunError: a folder holds no finished run of this version, runs to be merged differ in more than their
            seeds, or the page cannot be written.
    """
    if not merge:
        from hydroid.reporting.predictions import draw

        for run in as_list(runs):
            warn_of_changes(Path(run))
        files = [str(draw(run, figures=figures)) for run in as_list(runs)]
        return Result(files, {"files": files}, ())
    from hydroid.reporting.merged_report import merged_tables
    from hydroid.run.record import read_runs

    collected = read_runs([str(run) for run in as_list(runs)], out)
    tables, best = merged_tables(collected), min(collected, key=lambda run: run.rms_deg)
    line = f"smallest error: {best.folder} (seed {best.seed})"
    spread = tables["spread"]
    content = {
        "out": out and str(out),
        "best": best.folder,
        "runs": {
            run.folder: {"seed": run.seed, "fitted_deg": {v.name: v.fitted_deg for v in run.summary.verdict}}
            for run in collected
        },
        "parameters": [dict(zip(spread.header, row, strict=True)) for row in spread.rows],
    }
    return Result([spread, line, *written(tables, out)], content, collected)
