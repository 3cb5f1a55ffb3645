"""The fits from files to run folders: `fit_mech` and `fit_hyd`; `collect` merges runs."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydroid.api.fit import FitResult, Silent, fit
from hydroid.api.look import load_settings, read_with_findings
from hydroid.api.mechanics import with_mechanics
from hydroid.api.study import Study
from hydroid.assets import find_config
from hydroid.errors import RunError, SettingsError
from hydroid.estimate import read_values
from hydroid.settings.document import read_yaml
from hydroid.settings.fit import FitSettings

if TYPE_CHECKING:
    from hydroid.fitting.fit import Watcher as Progress
    from hydroid.problem.problem import Spread
    from hydroid.report.page import Page
    from hydroid.run.collection import Collection


@dataclass(frozen=True, eq=False)
class FitRuns:
    """The runs of `fit_mech` or `fit_hyd`: their folder, their results and, if several, their spread."""

    out: Path
    results: tuple[FitResult, ...]
    spread: "Page | None"


def _silent(settings: FitSettings, label: str) -> "AbstractContextManager[Progress]":
    return nullcontext(Silent())


@dataclass(frozen=True)
class FitOptions:
    """What `fit_mech` and `fit_hyd` do beside the settings.

    Attributes:
        runs: number of runs, with the seeds from `search.seed` on.
        resume: continue the run in the folder, or begin it.
        repair: fill holes of the logs up to `log.repair_s`.
        start: an estimate from whose values the search starts: a run folder or a YAML file of values.
        dask: where to simulate (`local[:N]`, `slurm`, an address); None: in this process.
        dask_insecure: accept an address without TLS.
        progress: opens what shows the progress of a run, given its settings and a label.
    """

    runs: int = 1
    resume: bool = False
    repair: bool = False
    start: str | Path | None = None
    dask: str | None = None
    dask_insecure: bool = False
    progress: "Callable[[FitSettings, str], AbstractContextManager[Progress]]" = _silent


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
    changes = dict(overrides or {})
    if logs:
        _refuse_other_stage(config, changes, "mech")
    return _fit_files("mech", logs, out, config, changes, options)


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
        _refuse_other_stage(config, changes, "hyd")
        changes = with_mechanics(mech, config, changes, [Path(log).name for log in logs])
    return _fit_files("hyd", logs, out, config, changes, options)


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
    return Study(collection, spread_page(collection)).write(out)


def _fit_files(
    stage: str,
    logs: Sequence[str | Path],
    out: str | Path | None,
    config: str | Path,
    overrides: dict[str, Any],
    options: FitOptions,
) -> FitRuns:
    """Fit over one seed or several, from files to run folders."""
    if logs:
        settings = load_settings(config, overrides)
        if options.start is not None:
            started = _started(settings, Path(options.start))
            settings = load_settings(
                config, overrides | {k: v for k, v in started.items() if k not in overrides}
            )
    else:
        logs, settings = _own_inputs(out, overrides, options)
        if settings.stage != stage:
            hint = f"use hydroid fit-{settings.stage}"
            raise RunError(f"is a run of fit-{settings.stage}, not of fit-{stage}", where=str(out), hint=hint)
    folder = Path(out or Path("runs") / f"{Path(logs[0]).stem}-{settings.stage}-{settings.search.name}")
    read, findings = read_with_findings(logs, settings, repair=options.repair)
    results: list[FitResult] = []
    several = options.runs > 1
    with _workers(settings, options) as workers:
        for seed in range(settings.search.seed, settings.search.seed + options.runs):
            search = settings.search.model_copy(update={"seed": seed})
            seeded = settings.model_copy(update={"search": search})
            with options.progress(seeded, f"seed {seed}" if several else "") as progress:
                own = folder / f"seed-{seed}" if several else folder
                result = fit(
                    seeded,
                    read,
                    own,
                    resume=options.resume,
                    progress=progress,
                    workers=workers,
                    findings=findings,
                )
                results.append(result)
    return FitRuns(folder, tuple(results), _spread(folder, results) if several else None)


def _refuse_other_stage(config: str | Path, overrides: Mapping[str, Any], stage: str) -> None:
    """Refuse settings of the other stage."""
    own, _ = read_yaml(find_config(config))
    given = overrides.get("stage", own.get("stage", "mech"))
    if given != stage and given in ("mech", "hyd"):
        what = f"has stage: {given}, but hydroid fit-{stage} needs stage: {stage}"
        raise SettingsError(what, where=str(config), hint=f"use hydroid fit-{given}, or another --config")


def _started(settings: FitSettings, start: Path) -> dict[str, Any]:
    """Return overrides that start the free parameters at the values of an estimate, which must have one."""
    values, _ = read_values(start)
    free = [n for n, p in settings.parameters.items() if p.fixed is None]
    if not set(free) & set(values):
        raise SettingsError("has a value of none of the free parameters", where=str(start))
    return {f"parameters.{name}.start": values[name] for name in free if name in values}


def _workers(settings: FitSettings, options: FitOptions) -> "AbstractContextManager[Spread | None]":
    if options.dask is None:
        return nullcontext()
    from hydroid.parallel.cluster import open_workers

    return open_workers(options.dask, settings.cluster, insecure=options.dask_insecure)


def _spread(out: Path, results: Sequence[FitResult]) -> "Page":
    from hydroid.report.page_file import write_page
    from hydroid.report.spread import spread_page
    from hydroid.run.collection import read_runs

    page = spread_page(read_runs([str(r.folder) for r in results], out))
    write_page(page, out)
    return page


def _own_inputs(
    out: str | Path | None, overrides: dict[str, Any], options: FitOptions
) -> tuple[list[Path], FitSettings]:
    """The logs and settings of a run that is resumed by its folder alone."""
    if not options.resume or out is None:
        raise SettingsError(
            "no log is given",
            hint="name one, as in hydroid fit-mech LOG.csv, or continue a run with --resume --out RUN",
        )
    if options.runs > 1:
        raise SettingsError("several runs are resumed with their logs named", where=str(out))
    from hydroid.run.folder import RunFolder

    folder = RunFolder(Path(out))
    logs = [Path(name) for name in folder.identity().get("logs", {})]
    missing = [str(log) for log in logs if not log.is_file()]
    if missing or not logs:
        raise RunError(f"its log {', '.join(missing)} is not there", where=str(out), hint="name the log")
    return logs, folder.settings(overrides)
