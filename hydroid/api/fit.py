"""Fit: `fit` one problem, `fit_mech` and `fit_hyd` from files to run folders, `collect` runs."""

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydroid.api.look import load_settings, read_with_findings
from hydroid.api.mechanics import with_mechanics
from hydroid.api.study import Study
from hydroid.errors import RunError, SettingsError, Stopped
from hydroid.estimate import FitSummary
from hydroid.identified import IdentifiedModel
from hydroid.settings.fit import FitSettings

if TYPE_CHECKING:
    from hydroid.fitting.fit import Fit
    from hydroid.fitting.fit import Watcher as Progress
    from hydroid.log import Finding, Log
    from hydroid.parameters import Array
    from hydroid.problem.problem import Problem, Spread
    from hydroid.report.page import Page
    from hydroid.run.collection import Collection
    from hydroid.run.folder import RunFolder

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class FitResult:
    """A finished fit.

    Attributes:
        problem: the logs and the model.
        fit: estimates, uncertainty, history.
        folder: the run folder; None where nothing was written.
    """

    problem: "Problem"
    fit: "Fit"
    folder: Path | None

    @property
    def summary(self) -> FitSummary:
        """The final estimate with its uncertainty, as in `estimate.yaml`."""
        from hydroid.run.summary import summarise

        return summarise(self.problem, self.fit)

    @property
    def model(self) -> IdentifiedModel:
        """The model at the final estimate, for `Plant`, `simulate`, `validate` and the studies."""
        settings = self.problem.settings
        settings = settings.freed() if self.fit.final == "joint" else settings
        source = str(self.folder or "the fit")
        return IdentifiedModel(settings, self.fit.best.theta, source, self.summary)


@dataclass(frozen=True, eq=False)
class FitRuns:
    """The runs of `fit_mech` or `fit_hyd`: their folder, their results and, if several, their spread."""

    out: Path
    results: tuple[FitResult, ...]
    spread: "Page | None"


class Silent:
    """Progress that is not shown."""

    def generation(self, row: "Array") -> None:
        """Do nothing."""

    def refining(self, simulated: int, rms: float) -> None:
        """Do nothing."""


def _silent(settings: FitSettings, label: str) -> "AbstractContextManager[Progress]":
    return nullcontext(Silent())


@dataclass(frozen=True)
class FitOptions:
    """What `fit_mech` and `fit_hyd` do beside the settings.

    Attributes:
        runs: number of runs, with the seeds from `search.seed` on.
        resume: continue the run in the folder, or begin it.
        repair: fill holes of the logs up to `log.repair_s`.
        dask: where to simulate (`local[:N]`, `slurm`, an address); None: in this process.
        dask_insecure: accept an address without TLS.
        progress: opens what shows the progress of a run, given its settings and a label.
    """

    runs: int = 1
    resume: bool = False
    repair: bool = False
    dask: str | None = None
    dask_insecure: bool = False
    progress: "Callable[[FitSettings, str], AbstractContextManager[Progress]]" = _silent


@dataclass(frozen=True)
class _Task:
    """How one run is made."""

    resume: bool = False
    progress: "Progress" = field(default_factory=Silent)
    workers: "Spread | None" = None
    findings: "Sequence[Finding]" = field(default_factory=tuple)


def fit(
    settings: FitSettings,
    logs: "Sequence[Log]",
    out: str | Path | None = None,
    *,
    resume: bool = False,
    progress: "Progress | None" = None,
    workers: "Spread | None" = None,
) -> FitResult:
    """Fit parameters to logs.

        settings = hydroid.load_settings("fit-mech", {"search.seed": 3})
        result = hydroid.fit(settings, hydroid.read_logs(["a.csv"], settings), out="runs/a")
        print(result.summary.values, result.summary.converged)

    Args:
        settings: of the fit (`load_settings`).
        logs: one or more (`read_logs`).
        out: the run folder; None: nothing is written.
        resume: continue the run in `out`, or begin it.
        progress: is called after every generation and during the refinement.
        workers: where candidates are simulated (`open_workers`); None: in this process.

    Raises:
        SettingsError: settings that do not fit the logs or the arm.
        RunError: `out` holds another run or cannot be written, or every simulation diverged.
    """
    return _fit(settings, logs, out, _Task(resume, progress or Silent(), workers))


def fit_mech(
    logs: Sequence[str | Path],
    out: str | Path | None = None,
    *,
    config: str | Path = "fit-mech",
    overrides: Mapping[str, Any] | None = None,
    options: FitOptions = FitOptions(),
) -> FitRuns:
    """Estimate gain, damping, stiffness and link masses from logs (stage 1).

        runs = hydroid.fit_mech(["a.csv"], "runs/mech", overrides={"search.algorithm": "ga"})

    Args:
        logs: CSV files; with `options.resume`, those of the run in `out` if none is given.
        out: the run folder, or the folder of several runs; by default runs/LOG-STAGE-ALGORITHM.
        config: settings, a YAML file or a shipped name.
        overrides: settings to replace, by dotted key.
        options: number of runs, resuming, workers.

    Raises:
        HydroidError: an input or a folder that cannot be used.
    """
    return _fit_files(logs, out, config, dict(overrides or {}), options)


def fit_hyd(
    logs: Sequence[str | Path],
    out: str | Path | None = None,
    *,
    mech: str | Path | None = None,
    config: str | Path = "fit-hyd",
    overrides: Mapping[str, Any] | None = None,
    options: FitOptions = FitOptions(),
) -> FitRuns:
    """Estimate the hydraulic actuators with the arm fixed at the estimate of stage 1 (stage 2).

        runs = hydroid.fit_hyd(["a.csv"], "runs/hyd", mech="runs/mech")

    Args:
        logs: as of `fit_mech`.
        out: as of `fit_mech`.
        mech: stage 1: its run folder, whose arm and log layout count where `config` has none; or a YAML
            file of its values.
        config: as of `fit_mech`.
        overrides: as of `fit_mech`; they have the last word.
        options: as of `fit_mech`.

    Raises:
        HydroidError: an input or a folder that cannot be used.
    """
    changes = dict(overrides or {})
    if logs:
        changes = with_mechanics(mech, config, changes, [Path(log).name for log in logs])
    return _fit_files(logs, out, config, changes, options)


def collect(runs: Sequence[str | Path], out: str | Path = "runs/collected") -> "Study[Collection]":
    """Merge finished runs that differ only in their seeds: median and spread of their estimates.

        study = hydroid.collect(["runs/array/seed-*"])
        print(study.result.best.path)

    Runs that are not finished or are damaged are left out, with a warning to the `hydroid` logger. No run is
    copied or changed.

    Args:
        runs: run folders, or patterns of them.
        out: folder for the page, the tables and the figure.

    Raises:
        RunError: no run is left, runs differ in more than their seeds, or `out` cannot be written.
    """
    from hydroid.report.spread import spread_page
    from hydroid.run.collection import read_runs

    collection = read_runs([str(run) for run in runs], Path(out))
    return Study(collection, spread_page(collection.parameters, collection.runs)).write(out)


def _fit_files(
    logs: Sequence[str | Path],
    out: str | Path | None,
    config: str | Path,
    overrides: dict[str, Any],
    options: FitOptions,
) -> FitRuns:
    """Fit over one seed or several, from files to run folders."""
    if logs:
        settings = load_settings(config, overrides)
    else:
        logs, settings = _own_inputs(out, overrides, options)
    folder = Path(out or Path("runs") / f"{Path(logs[0]).stem}-{settings.stage}-{settings.search.name}")
    read, findings = read_with_findings(logs, settings, repair=options.repair)
    results: list[FitResult] = []
    several = options.runs > 1
    with _workers(settings, options) as workers:
        for seed in range(settings.search.seed, settings.search.seed + options.runs):
            search = settings.search.model_copy(update={"seed": seed})
            seeded = settings.model_copy(update={"search": search})
            with options.progress(seeded, f"seed {seed}" if several else "") as progress:
                task = _Task(options.resume, progress, workers, findings)
                results.append(_fit(seeded, read, folder / f"seed-{seed}" if several else folder, task))
    return FitRuns(folder, tuple(results), _spread(folder, results) if several else None)


def _workers(settings: FitSettings, options: FitOptions) -> "AbstractContextManager[Spread | None]":
    if options.dask is None:
        return nullcontext()
    from hydroid.parallel.cluster import open_workers

    return open_workers(options.dask, settings.cluster, insecure=options.dask_insecure)


def _spread(out: Path, results: Sequence[FitResult]) -> "Page":
    from hydroid.report.page import write_page
    from hydroid.report.spread import run_result, spread_page

    parameters = results[0].problem.parameters
    runs = [
        run_result(r.folder or out, r.problem.settings.search.seed, r.fit, parameters.names) for r in results
    ]
    page = spread_page(parameters, runs)
    write_page(page, out)
    return page


def _own_inputs(
    out: str | Path | None, overrides: dict[str, Any], options: FitOptions
) -> tuple[list[Path], FitSettings]:
    """The logs and settings of a run that is resumed by its folder alone."""
    if not options.resume or out is None:
        raise SettingsError("no log is given", hint="name at least one, or the folder of a run to resume")
    if options.runs > 1:
        raise SettingsError("several runs are resumed with their logs named", where=str(out))
    from hydroid.run.folder import RunFolder

    folder = RunFolder(Path(out))
    logs = [Path(name) for name in folder.identity().get("logs", {})]
    missing = [str(log) for log in logs if not log.is_file()]
    if missing or not logs:
        raise RunError(f"its log {', '.join(missing)} is not there", where=str(out), hint="name the log")
    return logs, folder.settings(overrides)


def _fit(settings: FitSettings, logs: "Sequence[Log]", out: str | Path | None, task: _Task) -> FitResult:
    _refuse_stray_payloads(settings, logs)
    from hydroid.fitting.fit import fit as run_fit
    from hydroid.fitting.search import check_search
    from hydroid.problem.problem import Problem
    from hydroid.run.folder import RunFolder
    from hydroid.run.run_log import log_end, log_start

    folder = None if out is None else RunFolder(Path(out))
    if folder is not None and folder.exists and not task.resume:
        raise RunError("holds a run already", where=str(out), hint="resume it, or choose another folder")
    problem = (
        Problem(settings, list(logs)) if task.workers is None else Problem(settings, list(logs), task.workers)
    )
    check_search(problem)
    if folder is None:
        return FitResult(problem, run_fit(problem, lambda *_: None, task.progress), None)
    with folder.owned():
        log_start(settings, logs, task.findings)
        began = time.monotonic()
        try:
            result = _fit_in(folder, problem, task.progress)
        except KeyboardInterrupt:
            _log.info("interrupted after %.0f s", time.monotonic() - began)
            raise Stopped(folder.interrupt()) from None
        except Exception as error:
            _log.error("ended by %s: %s", type(error).__name__, error)
            raise
        log_end(result, time.monotonic() - began)
    return FitResult(problem, result, folder.path)


def _fit_in(folder: "RunFolder", problem: "Problem", progress: "Progress") -> "Fit":
    """Begin the folder's run, or continue it, to its report."""
    from hydroid.fitting.fit import fit as run_fit
    from hydroid.report.fit_report import fit_page
    from hydroid.report.page import write_page

    checkpoint = folder.begin_or_continue(problem.settings, problem.logs)
    result = run_fit(problem, folder.save, progress, checkpoint, folder.refinements())
    folder.write_estimate(problem, result)
    began = time.monotonic()
    write_page(fit_page(folder.identity(), problem, result), folder.path)
    folder.done(dict(result.seconds) | {"report": time.monotonic() - began})
    return result


def _refuse_stray_payloads(settings: FitSettings, logs: "Sequence[Log]") -> None:
    """Refuse a payload whose log's name is misspelt: it would be left out silently."""
    names = [Path(log.source).name for log in logs]
    stray = sorted(set(settings.payloads) - set(names))
    if stray:
        hint = f"logs: {', '.join(names)}"
        raise SettingsError("is none of the logs", where=f"payloads.{stray[0]}", hint=hint)
