"""`hydroid validate` and `hydroid report`: fits on logs that they were not fitted to;
reports drawn anew."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from hydroid.arrays import record, rms
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
from hydroid.commands.joint_units import in_joint_units
from hydroid.commands.logs import read_tests, seen_logs
from hydroid.files import Plain
from hydroid.findings import Finding
from hydroid.identified_model import IdentifiedModel, warn_of_changes
from hydroid.log import Log
from hydroid.log.overlap import KNOWN, overlap
from hydroid.progress import LOGGER, NOTE
from hydroid.settings.log import log_file
from hydroid.words import listed, numbered

OWN = "is what the fit itself simulates: that tests nothing"
OWN_ERROR = 2e-7
"""rms error of every joint [rad, m] below which a log is the fit's own simulation"""
IN_OTHER_UNITS = (
    "seems to be in other units than the logs of the fit: that tests nothing, "
    "and the report of the fit does not show it"
)

if TYPE_CHECKING:
    from hydroid.advice.loads import Load
    from hydroid.fitting.validation import Prediction
    from hydroid.fitting.verdict import Baselines
    from hydroid.joint_verdict import JointVerdict
    from hydroid.run.record import FinishedRun


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
    """Test fits on logs that they were not fitted to. The verdict on each joint
    compares its error with those of simple models.

    Each fit reads the logs with its own settings. Writes a page with every response
    and its errors, and tables. From then on, the report of the fit's own run shows these
    logs too.

    Example: hydroid validate OTHER.csv --fit runs/mech --fit runs/hyd

        validated = hydroid.validate("b.csv", fit="runs/a")
        print(validated.result[0]["shoulder"].rms)  # [deg]

    Args:
        fit (RUN|YAML): A fit: its run folder, its estimate.yaml, a folder that
            Plant.save wrote in Python, or a YAML file of parameter values.
            Repeat the option to compare several.
        tolerance (0.001 to 90): The rms error that you accept at every joint [deg]. To give each
            joint its own: --set 'tolerance_deg={boom: 2, arm: 1}' [default: the
            fit's, or else 2 % of a joint's travel].
        apart: These logs were recorded under other conditions, such as another load.
            The fit's report shows them, but its verdict does not count them. Repeat
            without --apart to count them again.

    Raises:
        LogError: a log cannot be used.
        RunError: the folder cannot be written.
    """
    sources: list[ModelSource] = as_list(fit)
    models = [open_model(source, None, set) for source in sources]
    read = [read_tests(logs, model.settings, repair=repair) for model in models]
    from hydroid.advice.loads import load_finding
    from hydroid.fitting.verdict import standing_out
    from hydroid.reporting.predictions import validation_page
    from hydroid.reporting.verdict_table import (
        next_lines,
        next_step,
        ordered,
        verdict_lines,
    )
    from hydroid.run.record import run_of

    tested = dict[str, _Tested]()
    names = numbered(model.name for model in models)
    for source, model, tests, name in zip(sources, models, read, names, strict=True):
        unseen, in_other_units = tests
        tested[name] = _test(source, model, unseen, in_other_units, tolerance)
    fits = ordered({name: test.verdict for name, test in tested.items()})
    best = tested[next(iter(fits))]
    run = run_of(best.model)
    if out is not None:
        _keep(tested.values(), apart=apart)
        if run and set:
            # with other settings it is another model than the run's
            text = "note: what --set gives does not go into %s and its report"
            LOGGER.log(NOTE, text, run)
    arm = models[0].settings.arm
    predictions = _by_fit(fits, tested)
    lines = verdict_lines(fits)
    steps = list[Finding]()
    if run:
        step = next_step(best.model.summarise(), best.verdict, str(run), best.fitted)
        steps.append(step)
        lines += next_lines(step)
    page = validation_page(predictions, fits, arm, *steps)
    loads = load_finding(_asked_loads(best))
    lines += map(str, loads)
    lines += map(str, standing_out(best.predictions, best.verdict, str(run or "RUN")))
    lines[1:1] = _fitted_lines(best.predictions)
    lines += written(page, out)
    content = _content(fits, predictions, arm.joint_names)
    content["findings"] = [asdict(one) for one in loads]
    content = in_joint_units(content, arm)
    return Result(lines, content, predictions, page, details=[page.tables["errors"]])


def _asked_loads(test: "_Tested") -> "list[Load]":
    """Return the loads that unseen logs ask for in which a joint errs by more than the
    fit expects of any log."""
    from hydroid.advice.loads import asked_loads

    odd = list[Log]()
    for prediction in test.predictions:
        errors = prediction.indices
        beyond = [
            errors[joint].rms > band.expected
            for joint, band in prediction.bands.items()
        ]
        if prediction.unseen is not False and any(beyond):
            odd.append(prediction.log)
    return asked_loads(test.model, odd)


def _by_fit(fits: Iterable[str], tested: "Mapping[str, _Tested]") -> "list[Prediction]":
    """Return all predictions with the names of their fits, in the order of these."""
    predictions = list["Prediction"]()
    for name in fits:
        predictions += [replace(p, fit=name) for p in tested[name].predictions]
    return predictions


def _fitted_lines(predictions: "Sequence[Prediction]") -> list[str]:
    """Return which logs test nothing, because the fit was made with them."""
    fitted = [p.log.source for p in predictions if p.unseen is False and not _is_own(p)]
    if not fitted:
        return []
    what = f"was made with {listed(fitted, 3)}"
    return [f"The fit, or one that it began from, {what}: that tests nothing."]


def _content(
    fits: "Mapping[str, Sequence[JointVerdict]]",
    predictions: "Sequence[Prediction]",
    joint_names: Sequence[str],
) -> Plain:
    """Return verdicts and errors as JSON has them, of the best fit first."""
    verdicts = list[Plain]()
    for name, verdict in fits.items():
        verdicts += [{"fit": name} | joint.model_dump() for joint in verdict]
    results = list[Plain]()
    for prediction in predictions:
        results += prediction.plain(joint_names)
    return {"verdict": verdicts, "results": results}


@record
class _Tested:
    """A fit, what it makes of its own logs and of those that test it, and the
    verdict."""

    model: IdentifiedModel
    fitted: "Sequence[Prediction]"
    predictions: "list[Prediction]"
    verdict: "tuple[JointVerdict, ...]"


def _test(
    source: ModelSource,
    model: IdentifiedModel,
    logs: Sequence[Log],
    in_other_units: Collection[Path],
    tolerance: float | None,
) -> _Tested:
    """Test a fit on logs that were read with its settings; files that seem to be in
    other units count apart."""
    from hydroid.fitting.validation import predicted
    from hydroid.fitting.verdict import judge
    from hydroid.run.record import record_of

    # a fit in memory brings its record along
    is_fit = not isinstance(source, str | Path | IdentifiedModel)
    record = source.record if is_fit else record_of(model)
    fitted: Sequence[Prediction] = ()
    baselines: Baselines = {}
    if record is not None:
        fitted = record.fitted
        baselines = record.baselines
    # also those of fits that it began from
    seen = seen_logs(source)
    predictions = list["Prediction"]()
    for log in logs:
        unseen = None
        if seen:
            unseen = _unseen(log, seen)
        load = model.settings.payload_of(log.source)
        if unseen and load:
            # another day's log may have the name of one that was fitted
            text = "note: %s: is taken to hold %g kg, by its name (payloads)"
            LOGGER.log(NOTE, text, log.source, load)
        prediction = predicted(model, log, unseen)
        if _is_own(prediction):
            LOGGER.warning("warning: %s: %s", log.source, OWN)
            prediction = replace(prediction, unseen=False)
        if log_file(log.source) in in_other_units:
            LOGGER.warning("warning: %s: %s", log.source, IN_OTHER_UNITS)
            prediction = replace(prediction, apart=True)
        predictions.append(prediction)
    settings = model.settings
    if tolerance is not None:
        settings = settings.changed({"tolerance_deg": tolerance})
    return _Tested(
        model, fitted, predictions, judge(settings, fitted, baselines, predictions)
    )


def _is_own(prediction: "Prediction") -> bool:
    """Return whether a log is what a fit itself simulates, such as `hydroid simulate`
    wrote: no sensor is so good."""
    errors = [rms(prediction.error(joint)) for joint in prediction.joints]
    return bool(max(errors) < OWN_ERROR)


def _keep(tested: Iterable[_Tested], *, apart: bool) -> None:
    """Store what fits make of unseen logs in their own runs, whose reports show them
    from now on; not that of logs which seem to be in other units."""
    from hydroid.reporting.predictions import write_report
    from hydroid.run.record import keep_validation

    for test in tested:
        kept = [p for p in test.predictions if not p.apart]
        predictions = [replace(p, apart=apart) for p in kept]
        run = keep_validation(test.model, predictions)
        if run:
            write_report(run)


def _unseen(log: Log, fitted: Sequence[Log]) -> bool:
    """Return whether a log is none of the fitted ones, in whatever file,
    and holds no large part of them."""
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
) -> "Result[tuple[FinishedRun, ...]]":
    """Draw the reports of finished runs anew, or merge runs of one fit with different
    seeds.

    Nothing is simulated and no log is needed, because a run stores all that its report
    shows. The report is written into the run's folder again. To compare several fits,
    use `hydroid validate`.

    Example: hydroid report runs/mech runs/hyd

        hydroid.report(["runs/mech", "runs/hyd"])
        print(hydroid.report("runs/array/seed-*", merge=True).content["best"])

    Args:
        runs (RUN): Folders of finished runs; with --merge also a pattern in quotes.
        merge: The folders are runs of one fit with different seeds: show median and
            spread of their estimates. Unfinished and damaged runs are left out, with a warning.
        figures: Also write every chart as PNG and SVG, to figures/.
        out (DIR): Folder for the tables of --merge.

    Raises:
        RunError: a folder holds no finished run of this version, runs to be merged
            differ in more than their seeds, or the page cannot be written.
    """
    folders = as_list(runs)
    if merge:
        return _merged([str(folder) for folder in folders], out)
    from hydroid.reporting.predictions import write_report

    for folder in folders:
        warn_of_changes(Path(folder))
    files = [str(write_report(folder, figures=figures)) for folder in folders]
    return Result(files, {"files": files}, ())


def _merged(
    folders: Sequence[str], out: "Source | None"
) -> "Result[tuple[FinishedRun, ...]]":
    """Return median and spread of the estimates of one fit with different seeds."""
    from hydroid.reporting.merged_report import merged_tables
    from hydroid.run.record import read_runs

    collected = read_runs(folders, out)
    tables = merged_tables(collected)
    best = min(collected, key=lambda run: run.rms_deg)
    spread = tables["spread"]
    content: Plain = {
        "out": out and str(out),
        "best": best.folder,
        "runs": {},
        "parameters": [
            dict(zip(spread.header, row, strict=True)) for row in spread.rows
        ],
    }
    for run in collected:
        fitted_deg = {joint.name: joint.fitted_deg for joint in run.summary.verdict}
        content["runs"][run.folder] = {"seed": run.seed, "fitted_deg": fitted_deg}
    line = f"smallest error: {best.folder} (seed {best.seed})"
    return Result([spread, line, *written(tables, out)], content, collected)
