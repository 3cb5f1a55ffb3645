"""`hydroid fit-mech` and `hydroid fit-hyd`: the two stages of a fit."""

from pathlib import Path
from typing import Annotated, Any

import typer

from hydroid.cli.options import (
    Config,
    Dask,
    DaskInsecure,
    Json,
    Quiet,
    Repair,
    Set,
    Verbose,
    Workers,
    overrides,
    warn,
)

Logs = Annotated[
    list[Path] | None,
    typer.Argument(
        metavar="LOG.csv...", help="Logs to fit together; with --resume, the run's own if left out."
    ),
]
Algorithm = Annotated[
    str | None,
    typer.Option(help="ga (simple), nsga2, cmaes, multistart, or one of pymoo's: pymoo:NSGA3, ..."),
]
_PYMOO = "pymoo:"
Seed = Annotated[int | None, typer.Option(help="Seed of the search; the same seed gives the same bits.")]
Runs = Annotated[int, typer.Option(min=1, max=10_000, help="Repeat over this many seeds, from --seed on.")]
Out = Annotated[Path | None, typer.Option(help="Run folder [default: runs/LOG-STAGE-ALGORITHM].")]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with the run in --out, or begin it.")]
Refinement = Annotated[bool | None, typer.Option(help="Least squares from the search's estimate.")]
Threads = Annotated[
    int | None,
    typer.Option(min=0, max=1024, help="Number of threads (0: one per core; one per worker with --dask)."),
]


def fit_mech(
    logs: Logs = None,
    config: Config = "fit-mech",
    algorithm: Algorithm = None,
    seed: Seed = None,
    runs: Runs = 1,
    out: Out = None,
    resume: Resume = False,
    refinement: Refinement = None,
    threads: Threads = None,
    dask: Dask = None,
    dask_insecure: DaskInsecure = False,
    workers: Workers = None,
    setting: Set = None,
    repair: Repair = False,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Estimate gain, damping, stiffness and link masses from logs (stage 1).

    Writes a run folder: parameter tables, figures, report.html, estimate.yaml, the fitted MJCF, history,
    checkpoint. Tell what the estimate is worth with `hydroid validate` on a log it was not fitted on.
    """
    changes = _changes(setting, algorithm, seed, threads, refinement)
    from hydroid.cli.running import run_fits

    run_fits(
        logs or [],
        config,
        changes,
        out,
        runs,
        resume=resume,
        repair=repair,
        json=json,
        quiet=quiet,
        verbose=verbose,
        warn=warn,
        dask=dask,
        dask_insecure=dask_insecure,
    )


def fit_hyd(
    logs: Logs = None,
    mech: Annotated[
        Path | None,
        typer.Option(metavar="RUN|YAML", help="Stage 1: its run folder, or a YAML of its values."),
    ] = None,
    config: Config = "fit-hyd",
    algorithm: Algorithm = None,
    seed: Seed = None,
    runs: Runs = 1,
    out: Out = None,
    resume: Resume = False,
    refinement: Refinement = None,
    refine: Annotated[
        bool | None, typer.Option(help="Then refinement both stages' parameters together.")
    ] = None,
    threads: Threads = None,
    dask: Dask = None,
    dask_insecure: DaskInsecure = False,
    workers: Workers = None,
    setting: Set = None,
    repair: Repair = False,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Estimate the hydraulic actuator with the arm fixed at stage 1's estimate (stage 2).

    Areas, currents, calibration and solenoid of the chain from command to torque. Writes a run folder as
    fit-mech does.
    """
    changes = _changes(setting, algorithm, seed, threads, refinement)
    if refine is not None:
        changes["joint_refinement"] = refine
    from hydroid.cli.running import run_fits, with_mechanical

    if logs:
        changes = with_mechanical(mech, config, changes)
    run_fits(
        logs or [],
        config,
        changes,
        out,
        runs,
        resume=resume,
        repair=repair,
        json=json,
        quiet=quiet,
        verbose=verbose,
        warn=warn,
        dask=dask,
        dask_insecure=dask_insecure,
    )


def _changes(
    setting: list[str] | None,
    algorithm: str | None,
    seed: int | None,
    threads: int | None,
    refinement: bool | None,
) -> dict[str, Any]:
    """The settings that flags replace."""
    changes = overrides(setting)
    pymoo = algorithm is not None and algorithm.startswith(_PYMOO)
    flags: dict[str, Any] = {
        "search.algorithm": "pymoo" if pymoo else algorithm,
        "search.pymoo.algorithm": algorithm.removeprefix(_PYMOO) if algorithm and pymoo else None,
        "search.seed": seed,
        "simulation.threads": threads,
    }
    changes |= {key: value for key, value in flags.items() if value is not None}
    if refinement is False:
        changes["refinement"] = None
    return changes
