"""Fit one problem, with settings and logs that are read: `hydroid.fit`."""

import logging
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydroid.commands.inputs import read_logs
from hydroid.commands.result import Printed
from hydroid.errors import RunError, SettingsError, Stopped
from hydroid.estimate import FitSummary
from hydroid.identified_model import IdentifiedModel
from hydroid.settings.fit import FitSettings

if TYPE_CHECKING:
    from hydroid.commands.inputs import LogSources
    from hydroid.fitting.fit import Fit, Watcher
    from hydroid.log import Log, LogFinding
    from hydroid.problem.problem import Problem, Spread
    from hydroid.reporting.table import Table
    from hydroid.run.folder import RunFolder

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False, repr=False)
class FitResult(Printed):
    """A finished fit.

    Attributes:
        problem: the logs and the model.
        fit: estimates, uncertainty, history.
        folder: the run folder; None where nothing was written.
    """

    problem: "Problem"
    fit: "Fit"
    folder: Path | None

    @cached_property
    def summary(self) -> FitSummary:
        """The final estimate with its uncertainty, as in `estimate.yaml`."""
        from hydroid.fitting.summary import summarise

        return summarise(self.problem, self.fit)

    @cached_property
    def model(self) -> IdentifiedModel:
        """The model at the final estimate, which every command takes as `fit`."""
        settings = self.problem.settings
        settings = settings.freed() if self.fit.final == "joint" else settings
        source = str(self.folder or "the fit")
        return IdentifiedModel(settings, self.fit.best.theta, source, self.summary)

    def lines(self) -> "list[Table | str]":
        """Return the table of the estimate, and what must be read before any use."""
        from hydroid.reporting.fit_report import fit_lines
        from hydroid.reporting.parameters_report import parameter_table

        table = parameter_table(self.model.settings, self.summary)
        return [table, *fit_lines(self.summary), *([str(self.folder / "report.html")] if self.folder else [])]

    def plain(self) -> dict[str, Any]:
        """Return what `estimate.yaml` holds, and the folder."""
        return self.summary.plain() | {"out": self.folder and str(self.folder)}


def fit(
    settings: FitSettings,
    logs: "LogSources",
    out: str | Path | None = None,
    *,
    resume: bool = False,
    progress: "Watcher | None" = None,
    workers: "Spread | None" = None,
    findings: "Sequence[LogFinding]" = (),
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
        findings: what reading the logs found, for `run.log`.

    Raises:
        SettingsError: settings that do not fit the logs or the arm.
        RunError: `out` holds another run or cannot be written, or every simulation diverged.
    """
    read = read_logs(logs, settings)
    _refuse_stray_payloads(settings, read)
    from hydroid.fitting.fit import fit as run_fit
    from hydroid.fitting.search import check_search
    from hydroid.problem.problem import Problem
    from hydroid.run.folder import RunFolder
    from hydroid.run.run_log import log_end, log_start

    folder = None if out is None else RunFolder(Path(out))
    if folder is not None and folder.exists and not resume:
        raise RunError("holds a run already", where=str(out), hint="resume it, or choose another folder")
    problem = Problem(settings, read) if workers is None else Problem(settings, read, workers)
    check_search(problem)
    if folder is None:
        return FitResult(problem, run_fit(problem, progress), None)
    with folder.owned():
        log_start(settings, read, findings)
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
        log_end(result, time.monotonic() - began)
    return FitResult(problem, result, folder.path)


def _fit_in(folder: "RunFolder", problem: "Problem", progress: "Watcher | None") -> "Fit":
    """Begin the folder's run, or continue it, to its report."""
    from hydroid.advice.proposals import advice
    from hydroid.advice.suggest import suggestions
    from hydroid.fitting.fit import fit as run_fit
    from hydroid.reporting.drawing import draw
    from hydroid.run.record import fit_result, save_result

    checkpoints = folder.begin_or_continue(problem.settings, problem.logs)
    result = run_fit(problem, progress, checkpoints)
    folder.write_estimate(problem, result)
    began = time.monotonic()
    last = problem.varied(problem.settings.freed()) if result.final == "joint" else problem
    suggested = (
        suggestions(last, result.uncertainty, result.quantities, thorough=False)
        if result.best.usable
        else None
    )
    advised = None if suggested is None else advice(last, suggested, str(folder.path))
    save_result(folder.path, fit_result(last, result, advised))
    draw([folder.path], folder.path)
    folder.done(dict(result.seconds) | {"report": time.monotonic() - began})
    return result


def _refuse_stray_payloads(settings: FitSettings, logs: "Sequence[Log]") -> None:
    """Refuse a payload whose log's name is misspelt: it would be left out silently."""
    names = [Path(log.source).name for log in logs]
    stray = sorted(set(settings.payloads) - set(names))
    if stray:
        hint = f"logs: {', '.join(names)}"
        raise SettingsError("is none of the logs", where=f"payloads.{stray[0]}", hint=hint)
