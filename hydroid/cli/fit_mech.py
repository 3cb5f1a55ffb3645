"""`hydroid fit-mech`: the arm's mechanical parameters."""

from pathlib import Path
from typing import Annotated, Any

import typer

from hydroid.cli.options import Config, Json, Quiet, Repair, Set, overrides, warn


def fit_mech(
    logs: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="LOG.csv...", help="Logs to fit together; with --resume, the run's own if left out."
        ),
    ] = None,
    config: Config = "fit-mech",
    algorithm: Annotated[str | None, typer.Option(help="ga (simple) or nsga2 (multi-objective).")] = None,
    seed: Annotated[
        int | None, typer.Option(help="Seed of the search; the same seed gives the same bits.")
    ] = None,
    runs: Annotated[
        int, typer.Option(min=1, max=10_000, help="Repeat over this many seeds, from --seed on.")
    ] = 1,
    out: Annotated[Path | None, typer.Option(help="Run folder [default: runs/LOG-ALGORITHM].")] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the run in --out, or begin it.")
    ] = False,
    polish: Annotated[bool | None, typer.Option(help="Least squares from the search's estimate.")] = None,
    workers: Annotated[int | None, typer.Option(min=0, max=1024, help="Threads; 0: one a core.")] = None,
    setting: Set = None,
    repair: Repair = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Estimate gain, damping, stiffness and link masses from logs (stage 1).

    Writes a run folder: parameter tables, figures, report.html, estimate.yaml, the fitted MJCF, history,
    checkpoint. Tell what the estimate is worth with `hydroid validate` on a log it was not fitted on.
    """
    changes = overrides(setting)
    flags: dict[str, Any] = {
        "search.algorithm": algorithm,
        "search.seed": seed,
        "simulation.threads": workers,
    }
    changes |= {key: value for key, value in flags.items() if value is not None}
    if polish is False:
        changes["polish"] = None

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
        warn=warn,
    )
