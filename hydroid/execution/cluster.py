"""Workers of a Dask cluster, on this machine or many; imported only where `--dask` asks for it.

Dask gives a killed worker's tasks to the others, and marks a task as the killer of workers after
`distributed.scheduler.allowed-failures` (3 unless the scheduler is configured otherwise) more tries than one.
"""

import logging
import pickle
import shutil
import threading
import time
import uuid
from collections.abc import Generator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from functools import partial
from importlib.metadata import version
from types import TracebackType
from typing import Any

from distributed import Client, Worker, get_worker, wait
from distributed.client import ClosedClientError
from distributed.diagnostics.plugin import WorkerPlugin
from distributed.scheduler import KilledWorker

from hydroid.errors import RunError, SettingsError
from hydroid.execution.executor import Answer, C, R, Work, answer, result
from hydroid.settings.simulation import ClusterSettings

CONNECT = 20.0
"""seconds in which a scheduler must answer"""
LOOK = 5.0
"""seconds between two looks at whether the scheduler is there: what it was told last may have got lost"""
REMIND = 60.0
"""seconds between two notes that there are no workers"""
CLOSE = 30.0
"""seconds for the jobs to end; those that are left then end with this process"""
SAME = ("hydroid", "mujoco", "numpy", "numba")
"""packages whose versions decide the bits of a result"""

_log = logging.getLogger(__name__)


class DaskCluster:
    """The workers of a Dask scheduler, as an `Executor`; use it as a context.

    Args:
        address: of a running scheduler, or `slurm`: jobs on this machine's Slurm, ended with the context.
        settings: of the jobs.

    Raises:
        RunError: no scheduler answers.
        SettingsError: there is no Slurm here.
    """

    def __init__(self, address: str, settings: ClusterSettings) -> None:
        self._cluster = _slurm(settings) if address == "slurm" else None
        try:
            self._client: Any = Client(self._cluster or address, timeout=CONNECT)
        except (OSError, ValueError) as error:
            hint = "start one with `dask scheduler` and give the address that it prints"
            words = " ".join(str(error).split())
            raise RunError(
                f"no Dask scheduler answers ({words})", where=f"--dask {address}", hint=hint
            ) from None
        self._kept = ("", "")  # key of the work that the workers have, and its name there

    def __enter__(self) -> "DaskCluster":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # the scheduler may be gone, at any point of this
        with suppress(Exception):
            self._forget()
        with suppress(Exception):
            self._client.close()
        if self._cluster is not None:
            with suppress(Exception):
                self._cluster.close(timeout=CLOSE)

    @property
    def workers(self) -> int:
        """Workers connected now; 1 where none is."""
        with self._reached():
            return max(1, len(self._client.nthreads()))

    def map(self, work: Work[C, R], chunks: Sequence[C]) -> list[R | None]:
        """Apply the work to every chunk, in order (see `Executor`)."""
        with self._reached():
            name = self._keep(work)
            answers = self._answers(name, chunks)
            # who only waited behind a killer was counted with it: once more, each alone
            for i in [i for i, answered in enumerate(answers) if answered is None]:
                answers[i] = self._answers(name, [chunks[i]])[0]
                if answers[i] is None:
                    _log.warning("a chunk has ended worker after worker and counts as failed")
        return [None if answered is None else result(answered) for answered in answers]

    @contextmanager
    def _reached(self) -> Generator[None]:
        """Make one error of the many that a scheduler leaves behind which is gone."""
        try:
            yield
        except Exception as error:
            lost = isinstance(error, OSError | CancelledError | ClosedClientError)
            if not lost and self._client.status == "running":
                raise
            words = " ".join(str(error).split()) or type(error).__name__
            raise RunError(
                f"the Dask scheduler is gone ({words})", hint="start it anew, and go on with --resume"
            ) from None

    def _answers(self, name: str, chunks: Sequence[Any]) -> list[Answer | None]:
        futures: Any = self._client.map(partial(_perform, name), chunks, pure=False)
        try:
            self._wait(futures)
            if all(future.status == "finished" for future in futures):
                return self._client.gather(futures)
            return [_taken(future) for future in futures]
        finally:
            with suppress(ClosedClientError):  # the scheduler is gone
                self._client.cancel(futures)

    def _wait(self, futures: Any) -> None:
        reminded = time.monotonic()
        while True:
            try:
                wait(futures, timeout=LOOK)
                return
            except TimeoutError:
                if self._client.status in ("closing", "closed"):
                    raise ClosedClientError("no answer") from None
                if time.monotonic() > reminded + REMIND:
                    reminded = time.monotonic()
                    if not self._client.nthreads():
                        _log.warning("the Dask scheduler has no workers; waiting for some")

    def _keep(self, work: Work[Any, Any]) -> str:
        """Give the work to all workers, those to come included; return its name there."""
        key, name = self._kept
        if key != work.key:
            self._forget()
            name = f"hydroid-{uuid.uuid4()}"
            self._client.register_plugin(_Kept(work.pickled), name=name)
            self._kept = (work.key, name)
        return name

    def _forget(self) -> None:
        _, name = self._kept
        self._kept = ("", "")
        if name:
            self._client.unregister_worker_plugin(name)


class _Kept(WorkerPlugin):
    """The work, as a worker keeps it: a plugin, which the scheduler also gives to workers that come later."""

    def __init__(self, pickled: bytes) -> None:
        self._pickled, self._versions = pickled, {name: version(name) for name in SAME}

    def setup(self, worker: Worker) -> None:
        """Make ready in a worker."""
        self._lock, self._function = threading.Lock(), None

    def apply(self, chunk: Any) -> Any:
        """Apply the work, one chunk at a time: a function need not bear to be called by several threads."""
        with self._lock:
            if self._function is None:
                self._refuse_others()
                self._function = pickle.loads(self._pickled)
            return self._function(chunk)

    def _refuse_others(self) -> None:
        for name, ours in self._versions.items():
            if version(name) != ours:
                raise RunError(
                    f"a Dask worker has {name} {version(name)}, here is {ours}",
                    hint="install the same everywhere: others need not give the same bits",
                )


def _perform(name: str, chunk: Any) -> Answer:
    """Answer a chunk in a worker."""
    kept: Any = get_worker().plugins[name]
    return answer(partial(kept.apply, chunk))


def _taken(future: Any) -> Answer | None:
    try:
        return future.result()
    except KilledWorker:
        return None


def _slurm(settings: ClusterSettings) -> Any:
    if shutil.which("sbatch") is None:
        raise SettingsError("there is no sbatch here", where="--dask slurm", hint="run on a Slurm machine")
    from dask_jobqueue.slurm import SLURMCluster

    cluster: Any = SLURMCluster(
        cores=settings.cores,
        processes=settings.cores,
        memory=settings.memory,
        walltime=settings.walltime,
        queue=settings.queue,
        log_directory="runs/slurm",
        scheduler_options={"dashboard": False, "dashboard_address": ":0"},  # no port that others want
    )
    cluster.adapt(minimum_jobs=settings.jobs, maximum_jobs=settings.jobs)  # a job that ends is replaced
    return cluster
