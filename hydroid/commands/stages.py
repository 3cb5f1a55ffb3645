"""`hydroid fit-mech` and `hydroid fit-hyd`: both stages, from files to run folders, one seed or several."""

from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypedDict, Unpack

import typer

from hydroid.commands.fit import FitResult, fit
from hydroid.commands.inputs import as_list, setting_changes
from hydroid.commands.logs import read_with_findings, run_logs
from hydroid.commands.options import LOGS_HELP, Dask, DaskInsecure, Repair, Set, command
from hydroid.commands.progress import FitProgress
from hydroid.commands.result import Printed, written
from hydroid.commands.stage_one import load_stage, with_mechanics
from hydroid.errors import RunError, SettingsError
from hydroid.estimate import read_values
from hydroid.settings.fit import FitSettings

if TYPE_CHECKING:
    from hydroid.commands.inputs import ConfigSource, Source
    from hydroid.commands.logs import LogSources

NAMED = "runs/LOG-STAGE-ALGORITHM"
"""run folder named after its log, stage and algorithm"""
FitLogs = Annotated[
    "LogSources",
    typer.Argument(metavar="LOG", help=f"{LOGS_HELP} [default with --resume: the logs of the run]"),
    list[Path] | None,
]


class FitOptions(TypedDict, total=False):
    """The options of both stages."""

    out: Annotated[
        "Source | None",
        typer.Option(metavar="DIR", help="Run folder; with --runs the folder of all of them."),
        Path | None,
        NAMED,
    ]
    algorithm: Annotated[
        str | None,
        typer.Option(
            help="Search: ga, nsga2, cmaes, multistart, or one of the library pymoo, such as pymoo:NSGA3."
        ),
    ]
    seed: Annotated[
        int | None, typer.Option(help="Seed of the search. The same seed gives exactly the same result.")
    ]
    runs: Annotated[
        int,
        typer.Option(min=1, max=10_000, help="Number of runs, with the seeds SEED, SEED + 1, ..."),
        int,
        1,
    ]
    start: Annotated[
        "Source | None",
        typer.Option(
            metavar="RUN|YAML",
            help="Start the search from the values of an estimate: a run folder or a YAML file of values.",
        ),
        Path | None,
    ]
    resume: Annotated[
        bool, typer.Option(help="Continue the stopped run in --out; start it if there is none.")
    ]
    refinement: Annotated[
        bool | None, typer.Option(help="After the search, refine its estimate by least squares.")
    ]
    threads: Annotated[
        int | None,
        typer.Option(
            min=0, max=1024, help="Number of threads (0: one per core, or with --dask one per worker)."
        ),
    ]
    dask: Dask
    dask_insecure: DaskInsecure
    config: Annotated[
        "ConfigSource | None",
        typer.Option(
            help="Settings: a YAML file, or the name of a shipped config [default: that of the same name]."
        ),
        str | None,
    ]
    set: Set
    repair: Repair


@dataclass(frozen=True, eq=False, repr=False)
class FitRuns(Printed):
    """The runs of `fit_mech` or `fit_hyd`, one for each seed."""

    results: tuple[FitResult, ...]

    @property
    def best(self) -> FitResult:
        """The result with the smallest rms error."""
        return min(self.results, key=lambda result: result.fit.best.rms)


@command
def fit_mech(logs: FitLogs = (), **options: Unpack[FitOptions]) -> FitRuns:
    """Estimate gain, damping, stiffness and link masses from logs (stage 1).

    Writes a run folder with report.html, estimate.yaml, tables, figures and the fitted arm. Then test the
    estimate on a log that it was not fitted to: `hydroid validate`.

    Example: hydroid fit-mech LOG.csv --out runs/mech

        fitted = hydroid.fit_mech("a.csv", out="runs/mech", algorithm="ga")
        print(fitted.best.summary.values)

    Raises:
        HydroidError: an input or a folder that cannot be used.
    """
    return _fit("mech", logs, options, {})


@command
def fit_hyd(
    logs: FitLogs = (),
    *,
    mech: Annotated[
        "Source | None",
        typer.Option(
            metavar="RUN|YAML",
            help="Stage 1: its run folder, or a YAML file of its values. The run folder also gives the arm "
            "and the log layout, unless --config sets them.",
        ),
        Path | None,
    ] = None,
    both_stages: Annotated[
        bool | None, typer.Option(help="At the end, refine the parameters of both stages together.")
    ] = None,
    **options: Unpack[FitOptions],
) -> FitRuns:
    """Estimate the hydraulic actuators (stage 2); the arm's parameters come from stage 1.

    By default it estimates piston areas, valve openings, onsets, delay and damping. The config can free more,
    such as the amplifier's currents and the solenoid. Writes a run folder as fit-mech does.

    Example: hydroid fit-hyd LOG.csv --mech runs/mech --out runs/hyd

        fitted = hydroid.fit_hyd("a.csv", mech="runs/mech", out="runs/hyd")
        print(fitted.best.summary.values)

    Raises:
        HydroidError: an input or a folder that cannot be used.
    """
    return _fit("hyd", logs, options, {"joint_refinement": both_stages}, mech)


def _fit(
    stage: str, logs: "LogSources", options: FitOptions, more: Mapping[str, Any], mech: "Source | None" = None
) -> FitRuns:
    """Fit over one seed or several; `more` are settings that an option of one stage replaces."""
    algorithm, pymoo = options.get("algorithm"), None
    if algorithm and algorithm.startswith("pymoo:"):
        algorithm, pymoo = "pymoo", algorithm.removeprefix("pymoo:")
    given = {
        "search.algorithm": algorithm,
        "search.pymoo.algorithm": pymoo,
        "search.seed": options.get("seed"),
        "simulation.threads": options.get("threads"),
    }
    changes = setting_changes(options.get("set"), given | dict(more))
    if options.get("refinement") is False:
        changes["refinement"] = None
    runs, resume, out = options.get("runs", 1), options.get("resume", False), options.get("out", NAMED)
    repair = options.get("repair", False)
    if logs:
        names = [Path(getattr(log, "source", log)).name for log in as_list(logs)]
        settings = _settings(stage, options, changes, names, mech)
        read, findings = read_with_findings(logs, settings, repair=repair)
    else:
        settings = _stored(stage, changes, out if resume and runs == 1 else None)
        read, findings = read_with_findings(run_logs(out or ""), settings, repair=repair)
    if str(out) == NAMED:
        out = f"runs/{Path(read[0].source).stem}-{settings.stage}-{settings.search.name}"
    results: list[FitResult] = []
    with _workers(options) as workers:
        for seed in range(settings.search.seed, settings.search.seed + runs):
            search = settings.search.model_copy(update={"seed": seed})
            seeded = settings.model_copy(update={"search": search})
            name, folder = ("", out) if runs == 1 else (f"seed {seed}", out and Path(out) / f"seed-{seed}")
            with FitProgress(seeded, name) as watcher:
                how: Any = {"resume": resume, "progress": watcher, "workers": workers, "findings": findings}
                results.append(fit(seeded, read, folder, **how))
    return (
        _several(results, out) if runs > 1 else FitRuns(results[0].lines, results[0].content, (results[0],))
    )


def _settings(
    stage: str, options: FitOptions, changes: dict[str, Any], logs: list[str], mech: "Source | None"
) -> FitSettings:
    """Read the settings of a fit to logs by name, with what stage 1 and an estimate to start from give."""
    config, start = options.get("config") or f"fit-{stage}", options.get("start")
    if stage == "hyd":
        changes = with_mechanics(mech, config, changes, logs)
    settings = load_stage(stage, config, changes)
    if start is None:
        return settings
    values, _ = read_values(Path(start))
    free = [name for name, p in settings.parameters.items() if p.fixed is None and name in values]
    if not free:
        raise SettingsError("has a value of none of the free parameters", where=str(start))
    starts = {f"parameters.{name}.start": values[name] for name in free}
    return load_stage(stage, config, {**changes, **starts, **changes})


def _stored(stage: str, changes: dict[str, Any], out: "Source | None") -> FitSettings:
    """Read the settings of a run that is resumed by its folder alone."""
    if out is None or str(out) == NAMED:
        hint = f"name one, as in hydroid fit-{stage} LOG.csv, or continue one run with --resume --out RUN"
        raise SettingsError("no log is given", hint=hint)
    from hydroid.run.folder import RunFolder

    settings = RunFolder(Path(out)).settings(changes)
    if settings.stage != stage:
        hint = f"use hydroid fit-{settings.stage}"
        raise RunError(f"is a run of fit-{settings.stage}, not of fit-{stage}", where=str(out), hint=hint)
    return settings


def _workers(options: FitOptions) -> Any:
    """Open the workers that are asked for; a fit without them imports no Dask."""
    if (dask := options.get("dask")) is None:
        return nullcontext()
    from hydroid.parallel.cluster import open_workers

    return open_workers(dask, insecure=options.get("dask_insecure", False))


def _several(results: list[FitResult], out: "Source | None") -> FitRuns:
    """Return runs over several seeds with the page of their folders."""
    content = {"out": out and str(out), "runs": [result.plain() for result in results]}
    if out is None:
        return FitRuns(results[0].lines, content, tuple(results))
    from hydroid.reporting.comparison import spread_page
    from hydroid.run.collection import read_runs

    page = spread_page(read_runs([str(result.folder) for result in results], Path(out)))
    return FitRuns([page.tables["spread"], *written(page, out)], content, tuple(results))
