"""What a fit command does: run one or several fits, show how far they are, print what they found."""

import json as jsonlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer

from hydroid.cli.progress import Progress
from hydroid.cli.terminal import shown
from hydroid.errors import RunError, SettingsError
from hydroid.fitting.fit import Fit
from hydroid.jobs import fit_logs, load_settings, mechanical_values
from hydroid.log import Warn
from hydroid.parallel.cluster import open_workers
from hydroid.problem.problem import Problem
from hydroid.report.fit_report import objective_table, parameter_table
from hydroid.report.page import write_page
from hydroid.report.phrases import fit_summary, fit_warnings
from hydroid.report.spread import final_spread, run_result, spread_page
from hydroid.run.folder import RunFolder
from hydroid.run.summary import summarise
from hydroid.settings.fit import FitSettings
from hydroid.settings.problem import MECHANICAL_UNITS


def run_fits(
    logs: Sequence[Path],
    config: str,
    changes: dict[str, Any],
    out: Path | None,
    runs: int,
    *,
    resume: bool,
    repair: bool,
    json: bool,
    quiet: bool,
    verbose: bool,
    warn: Warn,
    dask: str | None = None,
    dask_insecure: bool = False,
) -> None:
    """Fit over one seed or several and print the tables, or JSON."""
    settings = load_settings(config, changes)
    if not logs:
        logs, settings = _continued(out, changes, resume, runs)
    out = out or Path("runs") / f"{logs[0].stem}-{settings.stage}-{settings.search.name}"
    results: list[tuple[int, Path, Problem, Fit]] = []
    warn = _silent if verbose else warn  # the log has them
    with shown(verbose, quiet), open_workers(dask, settings.cluster, insecure=dask_insecure) as workers:
        for seed in range(settings.search.seed, settings.search.seed + runs):
            search = settings.search.model_copy(update={"seed": seed})
            seeded = settings.model_copy(update={"search": search})
            folder = out / f"seed-{seed}" if runs > 1 else out
            options = {"resume": resume, "repair": repair}
            with Progress(seeded, f"seed {seed}" if runs > 1 else "", quiet=quiet or json) as progress:
                problem, fit = fit_logs(seeded, logs, folder, progress, warn, **options, spread=workers)
            results.append((seed, folder, problem, fit))
            warn = _silent  # the logs are the same for every seed
    _, _, problem, fit = results[0]
    tables = [objective_table(problem, fit), parameter_table(problem, fit)]
    if runs > 1:
        names = problem.parameters.names
        page = spread_page(problem.parameters, [run_result(path, s, f, names) for s, path, _, f in results])
        write_page(page, out)
        tables = [final_spread(page)]
    if json:
        found = [summarise(problem, fit).plain() for _, _, problem, fit in results]
        typer.echo(jsonlib.dumps({"out": str(out), "runs": found}))
    elif not quiet:
        for table in tables:
            table.show()
        for line in (fit_summary(fit), *fit_warnings(problem, fit)) if runs == 1 else ():
            typer.echo(line)
        typer.echo(str(out / ("runs.html" if runs > 1 else "report.html")))


def with_mechanical(mech: Path | None, config: str, changes: dict[str, Any]) -> dict[str, Any]:
    """Add what holds stage 1's parameters at its estimate; `--set` still has the last word."""
    settings = load_settings(config, changes)
    if mech is not None:
        return mechanical_values(mech, settings) | changes
    open_ = [n for n, p in settings.parameters.items() if p.quantity in MECHANICAL_UNITS and p.fixed is None]
    if open_:
        hint = "give --mech RUN, or fix them in the config"
        raise SettingsError(f"stage 2 needs stage 1's {', '.join(open_)}", hint=hint)
    return changes


def _continued(
    out: Path | None, changes: dict[str, Any], resume: bool, runs: int
) -> tuple[list[Path], FitSettings]:
    """The logs and settings of a run that is continued by its folder alone."""
    if not resume or out is None:
        raise SettingsError(
            "no log given", hint="name at least one LOG.csv, or --resume a run with --out DIR"
        )
    if runs > 1:
        raise SettingsError("--runs needs its logs to be named", where="--resume")
    folder = RunFolder(out)
    logs = [Path(name) for name in folder.identity().get("logs", {})]
    missing = [str(p) for p in logs if not p.is_file()]
    if missing or not logs:
        raise RunError(f"its log {', '.join(missing)} is not there", where=str(out), hint="name the log")
    settings = folder.settings(changes)
    return logs, settings


def _silent(finding: object) -> None:
    """Say nothing."""
