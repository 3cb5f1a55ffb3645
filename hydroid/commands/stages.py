"""`hydroid fit-mech` and `hydroid fit-hyd`: both stages, from files to run folders, one seed or several."""

from contextlib import nullcontext
from dataclasses import KW_ONLY, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from hydroid.commands.fit import FitResult, fit
from hydroid.commands.inputs import ConfigSource, ModelSource, SettingChanges, Source, setting_changes
from hydroid.commands.logs import read_logs, run_logs
from hydroid.commands.options import NAMED, command, taking
from hydroid.commands.progress import FitProgress
from hydroid.commands.result import written
from hydroid.commands.stage_one import load_stage, with_mechanics
from hydroid.errors import RunError, SettingsError
from hydroid.estimate import read_values
from hydroid.settings.fit import FitSettings

if TYPE_CHECKING:
    from hydroid.commands.logs import LogSources


@dataclass(frozen=True)
class FitOptions:
    """The options of stage 1 (`options.SHARED` says what each is), and the settings that they ask for."""

    logs: "LogSources" = ()
    _: KW_ONLY
    out: "Source | None" = None
    algorithm: str | None = None
    seed: int | None = None
    runs: int = 1
    start: "Source | None" = None
    resume: bool = False
    refinement: bool | None = None
    threads: int | None = None
    dask: str | None = None
    dask_insecure: bool = False
    config: "ConfigSource | None" = None
    set: "SettingChanges" = None
    repair: bool = False

    stage: ClassVar[str] = "mech"

    def changes(self) -> dict[str, Any]:
        """Return the settings that the options replace."""
        changes = {
            "search.algorithm": self.algorithm,
            "search.seed": self.seed,
            "simulation.threads": self.threads,
        }
        return setting_changes(self.set, changes) | ({"refinement": None} if self.refinement is False else {})

    def settings(self) -> FitSettings:
        """Read the settings of a fit to logs, with the start that an estimate gives."""
        config, changes = self.config or f"fit-{self.stage}", self.with_stage_one(self.changes())
        settings = load_stage(self.stage, config, changes)
        if self.start is None:
            return settings
        values, _ = read_values(Path(self.start))
        free = [name for name, p in settings.parameters.items() if p.fixed is None and name in values]
        if not free:
            raise SettingsError("has a value of none of the free parameters", where=str(self.start))
        starts = {f"parameters.{name}.start": values[name] for name in free}
        return load_stage(self.stage, config, {**changes, **starts, **changes})

    def stored(self) -> FitSettings:
        """Read the settings of a run that is resumed by its folder alone."""
        stage = self.stage
        if self.out is None or str(self.out) == NAMED or not self.resume or self.runs > 1:
            hint = f"name one, as in hydroid fit-{stage} LOG.csv, or continue one run with --resume --out RUN"
            raise SettingsError("no log is given", hint=hint)
        from hydroid.run.folder import RunFolder

        settings = RunFolder(Path(self.out)).settings(self.changes())
        if settings.stage != stage:
            what, hint = (
                f"is a run of fit-{settings.stage}, not of fit-{stage}",
                "use the command of its stage",
            )
            raise RunError(what, where=str(self.out), hint=hint)
        return settings

    def with_stage_one(self, changes: dict[str, Any]) -> dict[str, Any]:
        """Return changes of settings with those that the estimate of stage 1 makes."""
        return changes

    def workers(self) -> Any:
        """Open the workers that are asked for; a fit without them imports no Dask."""
        if self.dask is None:
            return nullcontext()
        from hydroid.parallel.cluster import open_workers

        return open_workers(self.dask, insecure=self.dask_insecure)


@dataclass(frozen=True, kw_only=True)
class HydOptions(FitOptions):
    """The options of stage 2."""

    mech: "ModelSource | None" = None
    both_stages: bool | None = None

    stage: ClassVar[str] = "hyd"

    def changes(self) -> dict[str, Any]:
        """Return the settings that the options replace."""
        return setting_changes(super().changes(), {"joint_refinement": self.both_stages})

    def with_stage_one(self, changes: dict[str, Any]) -> dict[str, Any]:
        """Return changes of settings with those that the estimate of stage 1 makes."""
        return with_mechanics(self.mech, self.config or "fit-hyd", changes)


@command
@taking(FitOptions)
def fit_mech(options: FitOptions) -> FitResult:
    """Estimate gain, damping, stiffness and link masses from logs (stage 1).

    Writes a run folder with report.html, estimate.yaml, tables, figures and the fitted arm. Then test the
    estimate on a log that it was not fitted to: `hydroid validate`.

    Example: hydroid fit-mech LOG.csv --out runs/mech

        fitted = hydroid.fit_mech("a.csv", out="runs/mech", algorithm="ga")
        print(fitted.summary.values)

    Args:
        out (DIR): Run folder; with --runs the folder of all of them [default of the command line:
            runs/LOG-STAGE-ALGORITHM].

    Raises:
        HydroidError: an input or a folder that cannot be used.
    """
    return _fit(options)


@command
@taking(HydOptions)
def fit_hyd(options: HydOptions) -> FitResult:
    """Estimate the hydraulic actuators (stage 2); the arm's parameters come from stage 1.

    By default it estimates piston areas, valve openings, onsets, delay and damping. The config can free more,
    such as the amplifier's currents and the solenoid. Writes a run folder as fit-mech does.

    Example: hydroid fit-hyd LOG.csv --mech runs/mech --out runs/hyd

        fitted = hydroid.fit_hyd("a.csv", mech="runs/mech", out="runs/hyd")
        print(fitted.summary.values)

    Args:
        out (DIR): Run folder; with --runs the folder of all of them [default of the command line:
            runs/LOG-STAGE-ALGORITHM].
        mech (RUN|YAML): Stage 1: its run folder, or a YAML file of its values.
        both_stages: At the end, refine the parameters of both stages together.

    Raises:
        HydroidError: an input or a folder that cannot be used.
    """
    return _fit(options)


def _fit(options: FitOptions) -> FitResult:
    """Fit over one seed or several; return the best."""
    settings = options.settings() if options.logs else options.stored()
    logs, out, runs = options.logs or run_logs(options.out or ""), options.out, options.runs
    read = read_logs(logs, settings, repair=options.repair)
    if str(out) == NAMED:
        out = f"runs/{Path(read[0].source).stem}-{settings.stage}-{settings.search.algorithm}"
    results: list[FitResult] = []
    with options.workers() as workers:
        for seed in range(settings.search.seed, settings.search.seed + runs):
            seeded = settings.changed({"search.seed": seed})
            name, folder = ("", out) if runs == 1 else (f"seed {seed}", out and Path(out) / f"seed-{seed}")
            with FitProgress(seeded, name) as watcher:
                done = fit(seeded, read, folder, resume=options.resume, progress=watcher, workers=workers)
                results.append(done)
    best = min(results, key=lambda result: result.fit.best.rms)
    if runs == 1:
        return best
    content = {"out": out and str(out), "runs": [result.plain() for result in results]}
    several, lines, details = tuple(results), [f"The best of {runs} runs:", *best.lines], best.details
    if out is not None:
        from hydroid.reporting.validation_report import merged_tables
        from hydroid.run.collection import read_runs

        tables = merged_tables(read_runs([str(result.folder) for result in results], Path(out)))
        lines, details = [*lines, *written(tables, out)], [tables["spread"]]
    return replace(best, lines=lines, content=content, runs=several, details=details)
