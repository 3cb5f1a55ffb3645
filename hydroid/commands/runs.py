"""The runs of `fit-mech` and `fit-hyd`: from files to run folders, one seed or several."""

from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hydroid.assets import find_config
from hydroid.commands.fit import FitResult, fit
from hydroid.commands.inputs import (
    ConfigSource,
    Source,
    load_settings,
    read_with_findings,
    run_logs,
    setting_changes,
)
from hydroid.commands.options import LOGS_HELP
from hydroid.commands.progress import FitProgress
from hydroid.commands.result import Printed
from hydroid.errors import RunError, SettingsError
from hydroid.estimate import read_values
from hydroid.settings.document import read_yaml
from hydroid.settings.fit import FitSettings

if TYPE_CHECKING:
    from hydroid.commands.inputs import LogSources, SettingChanges
    from hydroid.log import Log, LogFinding
    from hydroid.problem.problem import Spread
    from hydroid.reporting.page import Page
    from hydroid.reporting.table import Table

NAMED = "runs/LOG-STAGE-ALGORITHM"
"""run folder named after its log, stage and algorithm"""
PYMOO = "pymoo:"

FitLogs = Annotated[
    "LogSources",
    typer.Argument(metavar="LOG", help=f"{LOGS_HELP} [default with --resume: the logs of the run]"),
    list[Path] | None,
]
RunFolder = Annotated[
    "Source | None",
    typer.Option(metavar="DIR", help="Run folder; with --runs the folder of all of them."),
    Path | None,
]
Algorithm = Annotated[
    str | None,
    typer.Option(
        help="Search: ga, nsga2, cmaes, multistart, or one of the library pymoo, such as pymoo:NSGA3."
    ),
]
SearchSeed = Annotated[
    int | None, typer.Option(help="Seed of the search. The same seed gives exactly the same result.")
]
Runs = Annotated[
    int, typer.Option(min=1, max=10_000, help="Number of runs, with the seeds SEED, SEED + 1, ...")
]
Start = Annotated[
    "Source | None",
    typer.Option(
        metavar="RUN|YAML",
        help="Start the search from the values of an estimate: a run folder or a YAML file of values.",
    ),
    Path | None,
]
Resume = Annotated[bool, typer.Option(help="Continue the stopped run in --out; start it if there is none.")]
WithRefinement = Annotated[
    bool | None, typer.Option(help="After the search, refine its estimate by least squares.")
]
Threads = Annotated[
    int | None,
    typer.Option(min=0, max=1024, help="Number of threads (0: one per core, or with --dask one per worker)."),
]


@dataclass(frozen=True, eq=False, repr=False)
class FitRuns(Printed):
    """The runs of `fit_mech` or `fit_hyd`.

    Attributes:
        results: one for each seed.
        out: the run folder, or the folder of several runs; None: nothing was written.
        spread: the page of several runs.
    """

    results: tuple[FitResult, ...]
    out: Path | None
    spread: "Page | None" = None

    @property
    def best(self) -> FitResult:
        """The result with the smallest rms error."""
        return min(self.results, key=lambda result: result.fit.best.rms)

    def lines(self) -> "list[Table | str]":
        """Return the lines of the one run, or the table of several."""
        if self.spread is None:
            return self.best.lines()
        from hydroid.reporting.spread import final_spread

        return [
            final_spread(self.spread),
            *([str(self.out / f"{self.spread.name}.html")] if self.out else []),
        ]

    def plain(self) -> dict[str, Any]:
        """Return the estimate, or those of several runs."""
        if len(self.results) == 1:
            return self.best.plain()
        return {"out": self.out and str(self.out), "runs": [result.plain() for result in self.results]}


@dataclass(frozen=True)
class FitInputs:
    """What a fit of files needs: logs that are read, settings, and the folder."""

    settings: FitSettings
    logs: "list[Log]"
    findings: "list[LogFinding]"
    out: Path | None


def search_changes(
    given: "SettingChanges",
    algorithm: str | None,
    seed: int | None,
    threads: int | None,
    refined: bool | None,
) -> dict[str, Any]:
    """Return the settings that the options of a fit replace, by dotted key."""
    pymoo = None
    if algorithm and algorithm.startswith(PYMOO):
        algorithm, pymoo = "pymoo", algorithm.removeprefix(PYMOO)
    options = {"search__algorithm": algorithm, "search__pymoo__algorithm": pymoo, "search__seed": seed}
    changes = setting_changes(given, **options, simulation__threads=threads)
    return changes | ({"refinement": None} if refined is False else {})


def given_inputs(
    logs: "LogSources",
    config: ConfigSource,
    changes: Mapping[str, Any],
    out: Source | None,
    start: Source | None,
    repair: bool,
) -> FitInputs:
    """Read the logs and settings of a fit; `start` is an estimate to start from.

    Raises:
        LogError, SettingsError: an input that cannot be used.
    """
    settings = load_settings(config, changes)
    if start is not None:
        values, _ = read_values(Path(start))
        free = [name for name, p in settings.parameters.items() if p.fixed is None and name in values]
        if not free:
            raise SettingsError("has a value of none of the free parameters", where=str(start))
        starts = {f"parameters.{name}.start": values[name] for name in free}
        settings = load_settings(config, {**changes, **starts, **changes})
    read, findings = read_with_findings(logs, settings, repair=repair)
    if out is not None and str(out) == NAMED:
        out = f"runs/{Path(read[0].source).stem}-{settings.stage}-{settings.search.name}"
    return FitInputs(settings, read, findings, None if out is None else Path(out))


def stored_inputs(stage: str, changes: Mapping[str, Any], out: Source | None, *, resume: bool) -> FitInputs:
    """Read the logs and settings of a run that is resumed by its folder alone.

    Raises:
        SettingsError: no folder is given. RunError: its logs are gone, or it is of another stage.
    """
    if not resume or out is None or str(out) == NAMED:
        hint = f"name one, as in hydroid fit-{stage} LOG.csv, or continue one run with --resume --out RUN"
        raise SettingsError("no log is given", hint=hint)
    from hydroid.run.folder import RunFolder

    folder = RunFolder(Path(out))
    folder.identity()
    logs, settings = run_logs(out), folder.settings(dict(changes))
    if settings.stage != stage:
        hint = f"use hydroid fit-{settings.stage}"
        raise RunError(f"is a run of fit-{settings.stage}, not of fit-{stage}", where=str(out), hint=hint)
    return FitInputs(settings, *read_with_findings(logs, settings), folder.path)


def refuse_other_stage(config: ConfigSource, changes: Mapping[str, Any], stage: str) -> None:
    """Refuse settings of the other stage."""
    own = config.stage if isinstance(config, FitSettings) else read_yaml(find_config(config))[0].get("stage")
    given = changes.get("stage", own or "mech")
    if given != stage and given in ("mech", "hyd"):
        what = f"has stage: {given}, but hydroid fit-{stage} needs stage: {stage}"
        raise SettingsError(what, where=str(config), hint=f"use hydroid fit-{given}, or another --config")


def fit_runs(inputs: FitInputs, runs: int, *, resume: bool, dask: str | None, dask_insecure: bool) -> FitRuns:
    """Fit over one seed or several.

    Raises:
        HydroidError: as of `fit`.
    """
    settings, out = inputs.settings, inputs.out
    results: list[FitResult] = []
    with _workers(settings, dask, dask_insecure) as workers:
        for seed in range(settings.search.seed, settings.search.seed + runs):
            search = settings.search.model_copy(update={"seed": seed})
            seeded = settings.model_copy(update={"search": search})
            with FitProgress(seeded, f"seed {seed}" if runs > 1 else "") as progress:
                result = fit(
                    seeded,
                    inputs.logs,
                    out / f"seed-{seed}" if out and runs > 1 else out,
                    resume=resume,
                    progress=progress,
                    workers=workers,
                    findings=inputs.findings,
                )
                results.append(result)
    return FitRuns(tuple(results), out, _spread(out, results) if runs > 1 else None)


def _workers(
    settings: FitSettings, dask: str | None, insecure: bool
) -> "AbstractContextManager[Spread | None]":
    if dask is None:
        return nullcontext()
    from hydroid.parallel.cluster import open_workers

    return open_workers(dask, settings.cluster, insecure=insecure)


def _spread(out: Path | None, results: list[FitResult]) -> "Page | None":
    """Write and return the page of several runs, which are read back from their folders."""
    if out is None:
        return None
    from hydroid.reporting.page_file import write_page
    from hydroid.reporting.spread import spread_page
    from hydroid.run.collection import read_runs

    page = spread_page(read_runs([str(result.folder) for result in results], out))
    write_page(page, out)
    return page
