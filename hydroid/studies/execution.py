"""Performing the runs of a study: what is there is read, the rest goes to processes or to Dask.

Only the process that was started writes. The fits run in processes of their own, one thread each.
"""

import json
import logging
import multiprocessing
import os
import signal
import threading
from collections.abc import Generator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path

from hydroid.errors import HydroidError, RunError
from hydroid.files import write_atomic
from hydroid.progress import NOTE, Progress
from hydroid.studies.runs import Result, Task, perform

_log = logging.getLogger(__name__)


def run_all(tasks: Sequence[Task], folder: Path, executor: Executor, progress: Progress) -> list[Result]:
    """Return the result of every task, in order; what `folder`/runs has is read, the others are performed.

    A run that fails is a result too: {"failed": why}.

    Raises:
        RunError: a file cannot be written or is damaged, or a process of the executor died.
    """
    files = [folder / "runs" / f"{task.key()}.json" for task in tasks]
    results = {file: _read(file) for file in files if file.is_file()}
    missing = {file: task for file, task in zip(files, tasks, strict=True) if file not in results}
    known, total = len(results), len(results) + len(missing)
    if known and missing:
        _log.log(NOTE, "%d of %d runs found, goes on", known, total)
    progress("runs", known, total)
    futures = {executor.submit(perform, task): file for file, task in missing.items()}
    try:
        for done, future in enumerate(as_completed(futures), known + 1):
            file = futures.pop(future)
            results[file], lasting = _outcome(future, missing[file])
            if lasting:
                write_atomic(file, json.dumps(results[file], indent=1, allow_nan=False) + "\n")
            progress("runs", done, total)
    finally:
        for future in futures:
            future.cancel()
    return [results[file] for file in files]


def _outcome(future: Future[Result], task: Task) -> tuple[Result, bool]:
    """Return what a run came to, and whether it lasts: an error that is no fault of the input may pass."""
    try:
        return future.result(), True
    except BrokenProcessPool:
        hint = "the same command goes on from here; with less memory, use fewer processes"
        raise RunError("a process of the study was killed", hint=hint) from None
    except HydroidError as error:
        words, lasting = str(error), True
    except Exception as error:
        words, lasting = f"{type(error).__name__}: {error}", False
    _log.warning("%s, seed %d failed: %s", task.cell, task.seed, words)
    return {"failed": words}, lasting


def _read(file: Path) -> Result:
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        if content.keys() & {"theta", "failed"}:
            return content
        what = "is no result of a run"
    except (OSError, ValueError, AttributeError) as error:
        what = f"cannot be read ({error})"
    raise RunError(what, where=str(file), hint="remove it: the run is repeated")


@contextmanager
def processes(count: int = 0) -> Generator[Executor]:
    """Open that many processes, one per core for 0; they end with this one, however it ends."""
    context = multiprocessing.get_context("spawn")  # threads of the simulation do not survive a fork
    pool = ProcessPoolExecutor(count or os.cpu_count() or 1, context, initializer=_end_with_parent)
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
