"""Fit one problem, with settings and logs that are read: `hydroid.fit`."""

import time
from collections.abc import Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydroid.arrays import record
from hydroid.commands.console import Printed
from hydroid.commands.inputs import LogSource, LogSources, ModelSource, Source
from hydroid.commands.logs import earlier_logs, read_log, read_logs, refuse_unfit
from hydroid.errors import LogError, RunError, SettingsError
from hydroid.estimate import NAME, FitSummary
from hydroid.findings import OF_OPTIMUM
from hydroid.identified_model import IdentifiedModel
from hydroid.settings.fit import FitSettings
from hydroid.settings.log import OTHER, log_file
from hydroid.words import listed

if TYPE_CHECKING:
    import pandas

    from hydroid.commands.console import Result
    from hydroid.fitting.fit import Fit, Watcher
    from hydroid.fitting.validation import Prediction
    from hydroid.fitting.verdict import Baselines
    from hydroid.log import Log
    from hydroid.parallel.workers import DaskWorkers
    from hydroid.plant import Plant
    from hydroid.problem.problem import Problem
    from hydroid.reporting.page import Table
    from hydroid.run.folder import RunFolder
    from hydroid.run.record import FitRecord
    from hydroid.use.draws import Draws


@record
class FitResult(Printed):
    """A finished fit; every command takes it as `fit`, and `load_plant` as its source.

    Attributes:
        problem: the logs and the model.
        fit: estimates, uncertainty, history.
        folder: the run folder; None where nothing was written.
        summary: the final estimate with its uncertainty, as in `estimate.yaml`.
        model: at the final estimate.
        record: the same that the run folder stores, as `load_record(folder).result`
            reads it.
        earlier: logs of the fits that it began from, which are no test of it either.
    """

    problem: "Problem"
    fit: "Fit"
    folder: Path | None
    summary: FitSummary
    model: IdentifiedModel
    record: "FitRecord"
    earlier: "tuple[Log, ...]" = ()

    @property
    def predictions(self) -> "tuple[Prediction, ...]":
        """What the final estimate makes of its logs."""
        return self.record.fitted

    @property
    def baselines(self) -> "Baselines":
        """Simple models fitted to the same logs, by joint and name."""
        return self.record.baselines

    def begun_from(self, *fits: "ModelSource | None") -> "FitResult":
        """Return the fit with the logs that other fits have seen, which it began from;
        its run keeps them."""
        from hydroid.run.record import keep_earlier

        earlier = earlier_logs(fits)
        if self.folder is not None:
            keep_earlier(self.folder, earlier)
        return replace(self, earlier=earlier)

    def __repr__(self) -> str:
        from hydroid.reporting.verdict_table import lead

        return f"<FitResult: {lead({'': self.summary.verdict})}>"

    def plant(self, **how: Any) -> "Plant":
        """Return the identified arm to be stepped; the keywords are those of
        `Plant`."""
        from hydroid.plant import Plant

        return Plant(self.model, **how)

    def draw(self, n: int, seed: int = 0) -> "Draws":
        """Draw n machines that the logs do not rule out (`hydroid.draw`)."""
        from hydroid.use.draws import draw

        return draw(self.model, n, seed, self.problem)

    def predict(self, log: "LogSource") -> "Prediction":
        """Predict a log from its commands and its first angles; NaN if the simulation
        diverges.

            predicted = fitted.predict("b.csv")
            print(predicted["boom"].error, predicted.to_frame())

        Raises:
            LogError: the log cannot be used.
        """
        from hydroid.fitting.validation import predicted

        return predicted(self.model, read_log(log, self.model.settings), None)

    def validate(
        self, logs: "LogSources", out: Source | None = None
    ) -> "Result[list[Prediction]]":
        """Return the verdict on each joint by logs that were not fitted;
        a page of it is written to `out`.

        Raises:
            LogError, RunError: as of `hydroid.validate`.
        """
        from hydroid.commands.validate import validate

        return validate(logs, fit=self, out=out)

    def to_frame(self) -> "pandas.DataFrame":
        """Return the parameters, one row each: value, unit, sd, interval, flag, ..."""
        import pandas

        estimate = self.summary.estimate
        rows = {name: parameter.model_dump() for name, parameter in estimate.items()}
        return pandas.DataFrame.from_dict(rows, orient="index")

    def report(self, out: Source) -> Path:
        """Write the run of a fit in memory to a folder, as `out` of the fit does;
        return its page.

        Raises:
            RunError: the folder holds another run or cannot be written.
        """
        from hydroid.run.folder import RunFolder

        folder = RunFolder(Path(out))
        with folder.owned():
            folder.begin(self.problem.settings, self.problem.logs)
            return _store(folder, self)


def fit(
    settings: FitSettings,
    logs: "LogSources",
    out: Source | None = None,
    *,
    resume: bool = False,
    progress: "Watcher | None" = None,
    workers: "DaskWorkers | None" = None,
) -> FitResult:
    """Fit parameters to logs.

        settings = hydroid.load_settings("fit-mech", {"search.seed": 3})
        result = hydroid.fit(settings, ["a.csv"], out="runs/a")
        print(result.summary.values, result.summary.converged)

    Args:
        settings: of the fit (`load_settings`).
        logs: files or logs, one or several.
        out: the run folder; None: nothing is written.
        resume: continue the run in `out`, or begin it.
        progress: is called after every generation and during the refinement.
        workers: where candidates are simulated (`open_workers`); None: in this process.

    Raises:
        LogError: a log cannot be used, or none drives a joint that stage 2 compares.
        SettingsError: settings that do not fit the logs or the arm.
        RunError: `out` holds another run or cannot be written, or every simulation
            diverged.
    """
    _refuse_lacked(settings)
    read = read_logs(logs, settings, fitted=True)
    _refuse_copies(read)
    files = [*dict.fromkeys(log_file(log.source) for log in read)]
    _refuse_wrong_payloads(settings, files)
    refuse_unfit(read, settings)
    _refuse_empty_groups(settings, files)
    from hydroid.fitting.fit import fit as run_fit
    from hydroid.problem.problem import Problem
    from hydroid.run.folder import RunFolder
    from hydroid.run.process import log_start

    # a folder of another run is refused before the fit, which takes long
    folder = None if out is None else RunFolder(Path(out))
    if folder is not None and folder.exists and not resume:
        raise RunError(
            "holds a run already", out, "resume it, or choose another folder"
        )
    problem = Problem(settings, read, workers)
    if folder is None:
        return fit_result(problem, run_fit(problem, progress), None)
    with folder.owned():
        log_start()
        checkpoints = folder.begin(problem.settings, problem.logs)
        result = fit_result(
            problem, run_fit(problem, progress, checkpoints), folder.path
        )
        _store(folder, result)
    return result


def _refuse_lacked(settings: FitSettings) -> None:
    """Refuse to estimate what the model does not have: no log would tell it.

    Terms are left alone: each is tried on the models that have it.
    """
    for name, parameter in settings.parameters.items():
        wanted = parameter.fixed is None and parameter.term is None
        if wanted and not any(rung.has(parameter.quantity) for rung in settings.rungs):
            model = settings.simulation.model
            what = f"the model {model} has no {parameter.quantity}"
            hint = "leave it out, or choose another simulation.model"
            raise SettingsError(what, f"parameters.{name}", hint)


def _refuse_copies(logs: "Sequence[Log]") -> None:
    """Refuse a log that is given twice, in whatever file: it would count twice, and
    intervals would be too narrow.

    Raises LogError.
    """
    from hydroid.run.folder import samples

    first = dict[bytes, str]()
    for log in logs:
        digest = samples(log)
        if digest in first:
            what = f"holds the same samples as {first[digest]}"
            raise LogError(what, log.source, "leave one of them out")
        first[digest] = log.source


def _refuse_wrong_payloads(settings: FitSettings, files: Sequence[Path]) -> None:
    """Refuse a payload of no log, which would be left out silently if it is misspelt,
    and one of several, which may have different ones."""
    for name in sorted(settings.payloads):
        held = [str(f) for f in files if settings.payload_name(str(f)) == name]
        if not held:
            hint = f"logs: {', '.join(file.name for file in files)}"
            raise SettingsError("is none of the logs", f"payloads.{name}", hint)
        if len(held) > 1:
            hint = "write one for each, with as much of its path as tells them apart"
            raise SettingsError(f"is {listed(held)}", f"payloads.{name}", hint)


def _refuse_empty_groups(settings: FitSettings, files: Sequence[Path]) -> None:
    """Refuse to estimate the effect of a group that no log is in."""
    groups = {None, OTHER, *(settings.log.group_of(str(file)) for file in files)}
    for parameter in settings.parameters.values():
        if parameter.fixed is None and parameter.per not in groups:
            hint = f"logs: {', '.join(map(str, files))}"
            raise SettingsError(
                "none of the logs is in it", f"log.groups.{parameter.per}", hint
            )


def fit_result(problem: "Problem", fit: "Fit", folder: Path | None) -> FitResult:
    """Return a finished fit with its account and its verdict; `folder` is that of its
    run, where it has one."""
    from hydroid.advice.assumptions import assumption_findings, doubts
    from hydroid.fitting.summary import summarise
    from hydroid.fitting.validation import fitted
    from hydroid.fitting.verdict import baselines_of, behind, judge
    from hydroid.reporting.knowledge_report import warnings
    from hydroid.reporting.parameters_report import parameter_table, sentence
    from hydroid.reporting.verdict_table import next_lines, next_step, verdict_lines
    from hydroid.run.record import fit_record
    from hydroid.search.descent import Ending

    settings = fit.problem.settings
    predictions = fitted(fit)
    baselines = baselines_of(settings, problem.logs)
    verdict = judge(settings, predictions, baselines)
    summary = summarise(problem, fit)
    doubted = doubts(settings, problem.logs)
    findings = [
        *summary.findings,
        *assumption_findings(settings, problem.logs, doubted),
    ]
    # after the first, which may be that time was up
    findings[1:1] = behind(settings, verdict)
    # one whose time was up may be far from its optimum
    if summary.ending == Ending.TIME.value:
        findings = [one for one in findings if one.kind not in OF_OPTIMUM]
    summary = summary.changed({"verdict": verdict, "findings": tuple(findings)})
    source = "the fit" if folder is None else str(folder / NAME)
    lines: list[Table | str] = verdict_lines({fit.final: verdict})
    # of a run the next step says that time was up, and how to go on
    said = [w for w in warnings(summary) if folder is None or w.kind != "time up"]
    lines += [sentence(finding, settings) for finding in said]
    if folder is not None:
        step = next_step(summary, verdict, str(folder), predictions)
        lines += [*next_lines(step), str(folder / "report.html")]
    details = [sentence(finding, settings) for finding in summary.findings]
    return FitResult(
        lines=lines,
        content=summary.plain() | {"out": folder and str(folder)},
        details=[parameter_table(settings, summary), *details],
        problem=problem,
        fit=fit,
        folder=folder,
        summary=summary,
        model=IdentifiedModel(settings, fit.best.theta, source, summary),
        record=fit_record(fit, predictions, baselines),
    )


def _store(folder: "RunFolder", result: FitResult) -> Path:
    """Write a fit to its run folder, and return its page."""
    from hydroid.reporting.predictions import write_report
    from hydroid.run.record import keep_earlier, write_record

    began = time.monotonic()
    folder.write_estimate(result.model, result.problem.logs[0])
    write_record(folder.path, result.record)
    keep_earlier(folder.path, result.earlier)
    seconds = dict(result.fit.seconds)
    folder.status("running", finished=date.today().isoformat(), seconds=seconds)
    page = write_report(folder.path)
    folder.status("done", seconds=seconds | {"report": time.monotonic() - began})
    return page
