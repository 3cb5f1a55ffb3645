"""A study: every cell of some settings, fitted over every seed, and what is measured of each run.

Each run is a fit of one cell and one seed, and leaves one small file. The file's name is a digest
of all that decides its content: settings, arm, data and versions. So a study that was killed goes
on where it was, and studies in one folder share the runs that they have in common. Only the process
that was started writes. The fits run in processes of their own or on Dask's workers,
one thread each.
"""

import json
import math
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from hydroid.arrays import record, rms
from hydroid.errors import HydroidError, RunError
from hydroid.estimate import finite
from hydroid.files import Plain, write_atomic
from hydroid.fitting.fit import fit
from hydroid.log import Log
from hydroid.problem.problem import Problem
from hydroid.progress import LOGGER, NOTE, Progress
from hydroid.run.folder import VERSIONS, deciding, digest, log_hash, model_hash
from hydroid.search.pareto import segment_best
from hydroid.settings.fit import FitSettings, StudySettings, cell_settings
from hydroid.settings.load import load

Result = Plain  # what `perform` returns, or {"failed": why}


@record
class Task:
    """One run: a cell, a seed, the settings with it, and the logs."""

    cell: str
    seed: int
    settings: FitSettings
    logs: tuple[Log, ...]

    def key(self) -> str:
        """Return the digest of all that decides the run's result."""
        return digest(
            {
                "versions": VERSIONS,
                "settings": deciding(self.settings),
                "model": model_hash(self.settings.arm),
                "logs": [log_hash(log, self.settings) for log in self.logs],
            }
        )[:24]


def perform(task: Task) -> Result:
    """Fit, and return what a study needs of the run, as plain values.

    `measures` are those of docs/studies.md, by name. `history` has generation, simulations and best
    objective; `segment_bests` are the parameters of the best candidate of each segment, as `theta`
    are those of the estimate.
    """
    result = fit(Problem(task.settings, task.logs))
    if not result.best.usable:
        raise RunError("the estimate diverged when it was simulated")
    # the estimate may have terms, or a model, that the search had not
    problem, searched = result.problem, task.settings.of_estimate("best").parameter_set()
    angles = np.degrees(problem.angles(problem.output_errors(result.best.theta[None]))[0])
    front, values = result.front
    unit = 1.0 if task.settings.objective.relative else 180 / math.pi
    refined = sum(r.evaluations for r in result.refinements.values())
    measures = {
        "objective": unit * result.best.overall,
        "largest error": np.abs(angles).max(),
        "mean absolute error": np.abs(angles).mean(),
        "rms error": rms(angles),
        "simulations": int(result.history[-1, 2]) + refined,
        "diverged": int(result.history[-1, 3]),
        "seconds": round(sum(result.seconds.values()), 3),
    }
    bests = front[segment_best(values[:, :-1])]
    return {
        "measures": measures,
        "theta": problem.parameters.mapping(result.best.theta),
        "segment_bests": [searched.mapping(theta) for theta in bests],
        "history": [[int(g), int(n), finite(unit * best)] for g, _, n, _, best, _ in result.history],
    }


# reads logs as settings map their columns
Read = Callable[[Sequence[Path], FitSettings], list[Log]]


@record
class Row:
    """One run: its cell and seed, its measures by name (empty where it failed),
    and why it failed."""

    cell: str
    seed: int
    values: Mapping[str, float]
    failed: str = ""


def run_study(
    path: Path, folder: Path, read: Read, executor: Executor, progress: Progress
) -> tuple[Row, ...]:
    """Perform the runs of a study that `folder` does not have yet; return the measures of all,
    by seed."""
    study = load(path, StudySettings)
    cells = cell_settings(study, path)
    logs = read([path.parent / name for name in study.logs], next(iter(cells.values())))
    tasks = make_tasks(cells, study.seeds, logs)
    files = [folder / "runs" / f"{task.key()}.json" for task in tasks]
    results = {file: _read(file) for file in files if file.is_file()}
    missing = {file: task for file, task in zip(files, tasks, strict=True) if file not in results}
    known, total = len(results), len(results) + len(missing)
    if known and missing:
        LOGGER.log(NOTE, "%d of %d runs found, goes on", known, total)
    progress("runs", known, total)
    futures = {executor.submit(perform, task): file for file, task in missing.items()}
    try:
        for done, future in enumerate(as_completed(futures), known + 1):
            file, lasting = futures.pop(future), True
            try:
                results[file] = future.result()
            except BrokenProcessPool:
                hint = "the same command goes on from here; with less memory, use fewer processes"
                raise RunError("a process of the study was killed", hint=hint) from None
            except Exception as error:
                lasting = isinstance(error, HydroidError)  # what is no fault of the input may pass
                words = str(error) if lasting else f"{type(error).__name__}: {error}"
                LOGGER.warning("%s, seed %d failed: %s", missing[file].cell, missing[file].seed, words)
                results[file] = {"failed": words}
            if lasting:
                write_atomic(file, json.dumps(results[file], indent=1, allow_nan=False) + "\n")
            progress("runs", done, total)
    finally:
        for future in futures:
            future.cancel()
    return tuple(measured(task, results[file]) for task, file in zip(tasks, files, strict=True))


def make_tasks(cells: Mapping[str, FitSettings], seeds: int, logs: Sequence[Log]) -> list[Task]:
    """Return all runs of a study, seed by seed, with one thread:
    the runs are what is shared out."""
    return [
        Task(name, seed, settings.changed({"search.seed": seed, "simulation.threads": 1}), tuple(logs))
        for seed in range(1, seeds + 1)
        for name, settings in cells.items()
    ]


def measured(task: Task, result: Result) -> Row:
    """Return the measures of one run (docs/studies.md)."""
    values = {name: float(value) for name, value in result.get("measures", {}).items()}
    values |= {f"value {name}": value for name, value in result.get("theta", {}).items()}
    return Row(task.cell, task.seed, values, result.get("failed", ""))


def _read(file: Path) -> Result:
    try:
        content = json.loads(file.read_bytes())
        if content.keys() & {"theta", "failed"}:
            return content
        what = "is no result of a run"
    except (OSError, ValueError, AttributeError) as error:
        what = f"cannot be read ({error})"
    raise RunError(what, file, "remove it: the run is repeated")


@contextmanager
def processes(count: int = 0) -> Generator[Executor]:
    """Open that many processes, one per core for 0; they end with this one, however it ends."""
    # threads of the simulation do not survive a fork
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(count or None, context, initializer=_end_with_parent)
    try:
        yield pool
    except BaseException:
        for process in list((getattr(pool, "_processes", None) or {}).values()):
            process.kill()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _end_with_parent() -> None:
    """Ignore what the terminal sends to all, and leave when the parent is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
