"""`hydroid study`: settings compared over many seeds."""

from collections.abc import Generator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hydroid.commands.inputs import read_logs
from hydroid.commands.options import Dask, DaskInsecure, Folder, command
from hydroid.commands.progress import Progress
from hydroid.commands.result import Result
from hydroid.errors import Stopped
from hydroid.settings.study import load_study

if TYPE_CHECKING:
    from hydroid.commands.inputs import Source
    from hydroid.reporting.table import Table
    from hydroid.studies.study import StudyRuns


@dataclass(frozen=True, eq=False, repr=False)
class StudyResult(Result):
    """The runs of every cell of a study over every seed."""

    result: "StudyRuns"

    def lines(self) -> "list[Table | str]":
        """Return the table of cells, and how many runs failed."""
        failed = sum(bool(row.failed) for row in self.result.rows)
        return [self.table, *([f"{failed} runs failed"] if failed else []), *self.written]

    def plain(self) -> dict[str, Any]:
        """Return the measures of each run."""
        from hydroid.estimate import finite

        runs = [
            {"cell": row.cell, "seed": row.seed, "failed": row.failed or None}
            | {name: finite(value) for name, value in row.values.items()}
            for row in self.result.rows
        ]
        return {"out": str(self.out), "runs": runs}


@command
def study(
    file: Annotated[
        "Source", typer.Argument(metavar="STUDY.yaml", help="The study's file (docs/studies.md)."), Path
    ],
    *,
    out: Folder = "runs/study",
    processes: Annotated[
        int, typer.Option(min=0, max=1024, help="Number of processes. 0 means one per core.")
    ] = 0,
    dask: Dask = None,
    dask_insecure: DaskInsecure = False,
) -> StudyResult:
    """Compare settings over many seeds.

    The file names a config, the settings that vary, and the logs. Every run leaves a small file in DIR/runs
    when it ends. To continue a study that was stopped, give the same command again: it ends with the same
    bits.

    Example: hydroid study my-study.yaml --out runs/my-study

        runs = hydroid.study("my-study.yaml", out="runs/my-study").result
        print([(row.cell, row.seed, row.values["rms error"]) for row in runs.rows])

    Raises:
        SettingsError: a key or value of the file that is not allowed.
        RunError: the folder cannot be written or is in use, or a process died.
    """
    path, folder = Path(file), Path(out or "runs/study")
    load_study(path)  # a wrong file is refused before anything heavy is imported
    from hydroid.reporting.study_report import study_page
    from hydroid.run.lock import locked
    from hydroid.studies.study import run_study

    with stoppable(folder), locked(folder), executor(processes, dask, dask_insecure) as workers:
        with Progress() as progress:
            runs = run_study(path, folder, read_logs, workers, progress)
        return StudyResult(runs, study_page(path.stem, runs), folder).write()


@contextmanager
def executor(processes: int, dask: str | None = None, dask_insecure: bool = False) -> Generator[Executor]:
    """Open what performs runs: processes of this machine (0: one per core), or Dask workers."""
    from hydroid.parallel.cluster import open_workers
    from hydroid.settings.simulation import ClusterSettings
    from hydroid.studies.execution import processes as open_processes

    with open_workers(dask, ClusterSettings(), insecure=dask_insecure) as workers:
        if workers is None:
            with open_processes(processes) as pool:
                yield pool
        else:
            yield workers.executor()


@contextmanager
def stoppable(out: Path) -> Generator[None]:
    """Say what is kept where a study is stopped."""
    try:
        yield
    except KeyboardInterrupt:
        count = len(list(out.glob("runs/*.json")))
        raise Stopped(f"{out} holds {count} runs that have ended; the same command goes on") from None
