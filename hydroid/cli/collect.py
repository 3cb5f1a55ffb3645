"""`hydroid collect`: the runs of a job array, or any that differ in their seeds, together."""

import json as jsonlib
from pathlib import Path
from typing import Annotated

import typer

from hydroid.cli.options import Json, Quiet


def collect(
    runs: Annotated[list[str], typer.Argument(metavar="RUN...", help="Run folders, or patterns of them.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the tables and the figure.")] = Path(
        "runs/collected"
    ),
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Merge runs of the same logs and settings with different seeds: median and spread of what they found.

    Runs that are not finished or damaged are named and left out. Nothing is copied.
    """
    from hydroid.collect import collect as merge

    found = merge(runs, out, lambda line: typer.echo(f"hydroid: {line}", err=True))
    if json:
        collected = {str(run.path): {"seed": run.seed, "rms_deg": run.rms_deg} for run in found.runs}
        values = {"best": str(found.best.path), "runs": collected, "parameters": found.table.records()}
        typer.echo(jsonlib.dumps({"out": str(out)} | values))
    elif not quiet:
        found.table.show()
        best = found.best
        typer.echo(f"smallest error: {best.path} (seed {best.seed}, rms {best.rms_deg:.4g} deg)")
        typer.echo(str(out / "tables"))
