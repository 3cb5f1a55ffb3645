"""Fit one problem, with settings and logs that are read: `hydroid.fit`."""

import logging
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from hydroid.commands.logs import read_logs
from hydroid.commands.result import Printed
from hydroid.errors import RunError, SettingsError, Stopped
from hydroid.estimate import FitSummary
from hydroid.identified_model import IdentifiedModel
from hydroid.settings.fit import FitSettings

if TYPE_CHECKING:
    from hydroid.commands.logs import LogSources
    from hydroid.fitting.fit import Fit, Watcher
    from hydroid.problem.problem import Problem, Spread
    from hydroid.run.folder import RunFolder

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False, repr=False)
class FitResult(Printed):
    """A finished fit.

    Attributes:
        problem: the logs and the model.
        fit: estimates, uncertainty, history.
        folder: the run folder; None where nothing was written.
        summary: the final estimate with its uncertainty, as in `estimate.yaml`.
        model: at the final estimate; every command takes it as `fit`.
    """

    problem: "Problem"
    fit: "Fit"
    folder: Path | None
    summary: FitSummary
    model: IdentifiedModel


def fit(
    settings: FitSettings,
    logs: "LogSources",
    out: str | Path | None = None,
    *,
    resume: bool = False,
    progress: "Watcher | None" = None,
    workers: "Spread | None" = None,
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
        SettingsError: settings that do not fit the logs or the arm.
        RunError: `out` holds another run or cannot be written, or every simulation diverged.
    """
    read = read_logs(logs, settings)
    names = [Path(log.source).name for log in read]
    if stray := sorted(set(settings.payloads) - set(names)):  # misspelt, it would be left out silently
        hint = f"logs: {', '.join(names)}"
        raise SettingsError("is none of the logs", where=f"payloads.{stray[0]}", hint=hint)
    from hydroid.fitting.fit import fit as run_fit
    from hydroid.fitting.search import check_search
    from hydroid.problem.problem import Problem
    from hydroid.run.folder import RunFolder

    folder = None if out is None else RunFolder(Path(out))
    if folder is not None and folder.exists and not resume:
        raise RunError("holds a run already", where=str(out), hint="resume it, or choose another folder")
    problem = Problem(settings, read, workers)
    check_search(problem)
    if folder is None:
        return _result(problem, run_fit(problem, progress), None)
    with folder.owned():
        began = time.monotonic()
        try:
            result = _fit_in(folder, problem, progress)
        except KeyboardInterrupt:
            _log.info("interrupted after %.0f s", time.monotonic() - began)
            kept = folder.interrupt()
            raise Stopped(kept and f"{kept}; the same command with --resume continues") from None
        except Exception as error:
            _log.error("ended by %s: %s", type(error).__name__, error)
            raise
        _log.info("done in %.0f s", time.monotonic() - began)
    return result


def _result(problem: "Problem", fit: "Fit", folder: Path | None) -> FitResult:
    from hydroid.fitting.summary import summarise
    from hydroid.reporting.fit_report import fit_lines
    from hydroid.reporting.parameters_report import parameter_table

    summary, settings = summarise(problem, fit), problem.settings.of_estimate(fit.final)
    model = IdentifiedModel(settings, fit.best.theta, str(folder or "the fit"), summary)
    report = [str(folder / "report.html")] if folder else []
    lines = [parameter_table(settings, summary), *fit_lines(summary), *report]
    content = summary.plain() | {"out": folder and str(folder)}
    return FitResult(lines, content, problem, fit, folder, summary, model)


def _fit_in(folder: "RunFolder", problem: "Problem", progress: "Watcher | None") -> FitResult:
    """Begin the folder's run, or continue it, to its report."""
    from hydroid.advice.proposals import advice
    from hydroid.fitting.fit import fit as run_fit
    from hydroid.reporting.drawing import draw
    from hydroid.run.record import fit_result, save_result
    from hydroid.run.run_log import log_start

    log_start(problem.settings, problem.logs)
    checkpoints = folder.begin_or_continue(problem.settings, problem.logs)
    fit = run_fit(problem, progress, checkpoints)
    result = _result(problem, fit, folder.path)
    folder.write_estimate(problem.logs[0], fit.best.theta, result.summary)
    began, advised = time.monotonic(), None
    last = problem.varied(result.model.settings)
    if fit.best.usable:
        run = str(folder.path)
        advised = advice(last, fit.uncertainty, fit.quantities, run=run, thorough=False)
    save_result(folder.path, fit_result(last, fit, advised))
    draw([folder.path], folder.path)
    folder.status("done", seconds=dict(fit.seconds) | {"report": time.monotonic() - began})
    return result
