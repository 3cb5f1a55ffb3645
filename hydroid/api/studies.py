"""Settings compared over many seeds: `study`."""

from collections.abc import Generator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from hydroid.api.look import read_logs
from hydroid.api.study import Study
from hydroid.errors import Stopped
from hydroid.progress import Progress, no_progress

if TYPE_CHECKING:
    from hydroid.study.study import StudyRuns


def study(
    file: str | Path,
    out: str | Path = "runs/study",
    *,
    processes: int = 0,
    dask: str | None = None,
    dask_insecure: bool = False,
    progress: Progress = no_progress,
) -> "Study[StudyRuns]":
    """Fit every cell of a study over every seed.

        runs = hydroid.study("my-study.yaml", "runs/my-study").result
        print([(row.cell, row.seed, row.values["rms error"]) for row in runs.rows])

    Every run leaves a small file in `out`/runs when it ends. If the study is stopped or killed, the same call
    goes on from there, and ends with the same bits.

    Args:
        file: the study's YAML file (docs/studies.md).
        out: folder for the runs, the page and its tables.
        processes: on this machine; 0: one per core.
        dask: run on Dask workers instead (`local[:N]`, `slurm`, an address).
        dask_insecure: accept an address without TLS.
        progress: called with what is done, how much of it, and how much there is.

    Raises:
        SettingsError: a key or value of the file that is not allowed.
        RunError: `out` cannot be written or is in use, or a process died.
    """
    from hydroid.settings.study import load_study

    load_study(Path(file))  # a wrong file is refused before anything heavy is imported
    from hydroid.report.study_report import study_page
    from hydroid.run.lock import locked
    from hydroid.study.study import run_study

    path, folder = Path(file), Path(out)
    with stoppable(folder), locked(folder), executor(processes, dask, dask_insecure) as workers:
        runs = run_study(path, folder, read_logs, workers, progress)
        return Study(runs, study_page(path.stem, runs)).write(folder)


@contextmanager
def executor(processes: int, dask: str | None = None, dask_insecure: bool = False) -> Generator[Executor]:
    """Open what performs runs: processes of this machine, or Dask workers."""
    from hydroid.parallel.cluster import open_workers
    from hydroid.settings.simulation import ClusterSettings
    from hydroid.study.execution import processes as open_processes

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
