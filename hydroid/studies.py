"""A study: every cell of some settings, fitted over every seed, and what is measured of
each run.

Each run is a fit of one cell and one seed, and leaves one small file. The file's name
is a digest of all that decides its content: settings, arm, data and versions. So a
study that was killed goes on where it was, and studies in one folder share the runs
that they have in common. Only the process that was started writes. The fits run in
processes of their own or on Dask's workers, one thread each.
"""

import json
import math
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from hydroid.arrays import record, rms
from hydroid.errors import HydroidError, RunError
from hydroid.estimate import finite
from hydroid.files import Plain, write_atomic
from hydroid.fitting.fit import fit
from hydroid.log import Log
from hydroid.parallel.workers import VERSIONS
from hydroid.problem.problem import Problem
from hydroid.progress import LOGGER, NOTE, Progress
from hydroid.run.folder import deciding, digest, log_hash, model_hash
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
        content = {
            "versions": VERSIONS,
            "settings": deciding(self.settings),
            "model": model_hash(self.settings.arm),
            "logs": [log_hash(log, self.settings) for log in self.logs],
        }
        # 96 bits are enough: no two runs of a study have the same by chance
        return digest(content)[:24]


def perform(task: Task) -> Result:
    """Fit, and return what a study needs of the run, as plain values.

    `measures` are those of docs/studies.md, by name. `history` has generation,
    simulations and best objective; `segment_bests` are the parameters of the best
    candidate of each segment, as `theta` are those of the estimate.

    Raises RunError: the estimate diverges.
    """
    fitted = fit(Problem(task.settings, task.logs))
    best = fitted.best
    if not best.usable:
        raise RunError("the estimate diverged when it was simulated")
    # the estimate may have terms, or a model, that the search had not
    problem = fitted.problem
    errors = problem.output_errors(best.theta[None])
    angles = np.degrees(problem.angles(errors)[0])
    unit = 1.0
    if not task.settings.objective.relative:
        unit = 180 / math.pi
    refined = sum(refinement.evaluations for refinement in fitted.refinements.values())
    measures = {
        "objective": unit * best.overall,
        "largest error": np.abs(angles).max(),
        "mean absolute error": np.abs(angles).mean(),
        "rms error": rms(angles),
        "simulations": int(fitted.history[-1, 2]) + refined,
        "diverged": int(fitted.history[-1, 3]),
        "seconds": round(sum(fitted.seconds.values()), 3),
    }
    searched = task.settings.of_estimate("best").parameter_set()
    front, objectives = fitted.front
    bests = front[segment_best(objectives[:, :-1])]
    history = list[list[Any]]()
    for generation, _, simulated, _, objective, _ in fitted.history:
        history.append([int(generation), int(simulated), finite(unit * objective)])
    return {
        "measures": measures,
        "theta": problem.parameters.mapping(best.theta),
        "segment_bests": [searched.mapping(theta) for theta in bests],
        "history": history,
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
    """Perform the runs of a study that `folder` does not have yet; return the measures
    of all, by seed."""
    study = load(path, StudySettings)
    cells = cell_settings(study, path)
    logs = read_cells([path.parent / name for name in study.logs], cells, read)
    tasks = make_tasks(cells, study.seeds, logs)
    files = [folder / "runs" / f"{task.key()}.json" for task in tasks]
    results = {file: _read(file) for file in files if file.is_file()}
    missing = dict[Path, Task]()
    for file, task in zip(files, tasks, strict=True):
        # cells that say the same are one run
        if file not in results:
            missing[file] = task
    if results and missing:
        total = len(results) + len(missing)
        LOGGER.log(NOTE, "%d of %d runs found, goes on", len(results), total)
    _perform_all(missing, results, executor, progress)
    return tuple(map(measures_of, tasks, [results[file] for file in files]))


def _perform_all(
    missing: Mapping[Path, Task],
    results: dict[Path, Result],
    executor: Executor,
    progress: Progress,
) -> None:
    """Perform the runs that are missing, and add their results to those that are
    there."""
    there = len(results)
    total = there + len(missing)
    progress("runs", there, total)
    futures = {executor.submit(perform, task): file for file, task in missing.items()}
    try:
        for done, future in enumerate(as_completed(futures), there + 1):
            file = futures.pop(future)
            results[file], lasting = _ended(future, missing[file])
            # written one by one: whoever ends a study goes on from here
            if lasting:
                text = json.dumps(results[file], indent=1, allow_nan=False)
                write_atomic(file, text + "\n")
            progress("runs", done, total)
    finally:
        for future in futures:
            future.cancel()


def _ended(future: Future[Result], task: Task) -> tuple[Result, bool]:
    """Return the result of a run that has ended, and whether it would end so again.

    What is no fault of the input may pass: a failure of that kind is not kept.
    """
    try:
        return future.result(), True
    except BrokenProcessPool:
        hint = (
            "the same command goes on from here; with less memory, use fewer processes"
        )
        raise RunError("a process of the study was killed", hint=hint) from None
    except Exception as error:
        lasting = isinstance(error, HydroidError)
        words = str(error) if lasting else f"{type(error).__name__}: {error}"
        LOGGER.warning("%s, seed %d failed: %s", task.cell, task.seed, words)
        return {"failed": words}, lasting


def read_cells(
    paths: Sequence[Path], cells: Mapping[str, FitSettings], read: Read
) -> dict[str, Sequence[Log]]:
    """Return the logs as each cell's settings read them, by the cell's name.

    A cell may name another column, delay or period. Cells that read alike share logs.
    """
    logs = dict[str, Sequence[Log]]()
    for name, settings in cells.items():
        for other in logs:
            # the arm says how long its rods are, which logs may hold
            reads_alike = cells[other].log == settings.log
            if reads_alike and cells[other].arm == settings.arm:
                logs[name] = logs[other]
                break
        else:
            logs[name] = read(paths, settings)
    return logs


def make_tasks(
    cells: Mapping[str, FitSettings], seeds: int, logs: Mapping[str, Sequence[Log]]
) -> list[Task]:
    """Return all runs of a study, seed by seed, with one thread:
    the runs are what is shared out. `logs` are those of each cell."""
    tasks = list[Task]()
    for seed in range(1, seeds + 1):
        for name, settings in cells.items():
            changes = {"search.seed": seed, "simulation.threads": 1}
            changed = settings.changed(changes)
            tasks.append(Task(name, seed, changed, tuple(logs[name])))
    return tasks


def measures_of(task: Task, result: Result) -> Row:
    """Return the measures of one run (docs/studies.md)."""
    values = dict[str, float]()
    for name, value in result.get("measures", {}).items():
        values[name] = float(value)
    for name, value in result.get("theta", {}).items():
        values[f"value {name}"] = value
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
    """Open that many processes, one per core for 0; they end with this one, however it
    ends."""
    # threads of the simulation do not survive a fork
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(count or None, context, initializer=_end_with_parent)
    try:
        yield pool
    except BaseException:
        # a simulation takes no signal before its log's end, and shutdown would wait
        running = getattr(pool, "_processes", None) or {}
        for process in list(running.values()):
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
