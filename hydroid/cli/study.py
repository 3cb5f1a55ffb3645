"""`hydroid study`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hydroid.cli.options import DaskInsecure, Folder, Output
from hydroid.cli.output import show

if TYPE_CHECKING:
    from hydroid.study.study import StudyRuns


def study(
    file: Annotated[Path, typer.Argument(metavar="STUDY.yaml", help="The study's file (docs/studies.md).")],
    output: Output,
    processes: Annotated[
        int, typer.Option(min=0, max=1024, help="Number of processes. 0 means one per core.")
    ] = 0,
    dask: Annotated[
        str | None,
        typer.Option(
            metavar="local[:N]|slurm|ADDRESS",
            help="Run on the workers of a Dask scheduler instead. The result is the same.",
        ),
    ] = None,
    dask_insecure: DaskInsecure = False,
    out: Folder = Path("runs/study"),
) -> None:
    """Compare settings over many seeds.

    The file names a config, the settings that vary, and the logs. To continue a study that was stopped, give
    the same command again.
    """
    from hydroid.api.studies import study
    from hydroid.cli.progress import Progress

    with Progress(quiet=output.silent) as progress:
        result = study(
            file, out, processes=processes, dask=dask, dask_insecure=dask_insecure, progress=progress
        )
    failed = sum(bool(row.failed) for row in result.result.rows)
    lines = [
        result.table,
        *([f"{failed} runs failed"] if failed else []),
        str(out / f"{result.page.name}.html"),
    ]
    show(output, lambda: {"out": str(out)} | _content(result.result), lines)


def _content(runs: "StudyRuns") -> dict[str, Any]:
    from hydroid.estimate import finite

    rows = [
        {"cell": r.cell, "seed": r.seed, "failed": r.failed or None}
        | {name: finite(value) for name, value in r.values.items()}
        for r in runs.rows
    ]
    return {"runs": rows}
