"""Processes of this machine: each has a pipe of its own, so that one that dies takes nothing else with it.

`concurrent.futures.ProcessPoolExecutor` ends whole when one of its processes is killed, and does not tell
which chunk that one had. Here the end of a worker's pipe tells both.
"""

import logging
import multiprocessing
import pickle
import signal
from collections import deque
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from functools import partial
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from types import TracebackType
from typing import Any

from hydroid.errors import RunError
from hydroid.execution.executor import TRIES, Answer, C, R, Work, answer, result

_log = logging.getLogger(__name__)
_context = multiprocessing.get_context("spawn")  # to fork a process that has threads is not safe


class LocalPool:
    """Worker processes, as an `Executor`; use it as a context, which ends them.

    Args:
        workers: how many; they start at once, and are waited for where they are needed.
    """

    def __init__(self, workers: int) -> None:
        # None: ended, and started again when there is a chunk for it
        self._pool: list[_Worker | None] = [_Worker() for _ in range(workers)]

    def __enter__(self) -> "LocalPool":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for place in range(self.workers):
            self._end(place)

    @property
    def workers(self) -> int:
        """Number of processes."""
        return len(self._pool)

    def map(self, work: Work[C, R], chunks: Sequence[C]) -> list[R | None]:
        """Apply the work to every chunk, in order (see `Executor`)."""
        results: list[R | None] = [None] * len(chunks)
        waiting = deque(range(len(chunks)))
        killed = [0] * len(chunks)
        busy: dict[_Worker, tuple[int, int]] = {}  # place in the pool, chunk
        try:
            while waiting or busy:
                taken = {place for place, _ in busy.values()}
                for place in range(self.workers):
                    if waiting and place not in taken:
                        chunk = waiting.popleft()
                        busy[self._begin(place, work, chunks[chunk])] = (place, chunk)
                for worker in _answered(busy):
                    place, chunk = busy.pop(worker)
                    try:
                        answered = worker.answer()
                    except (EOFError, OSError):
                        killed[chunk] += 1
                        _log.warning("worker process %d died (%s)", worker.pid, self._end(place))
                        if killed[chunk] < TRIES:
                            waiting.append(chunk)
                        else:
                            _log.warning("its chunk has ended %d workers and counts as failed", TRIES)
                    else:
                        results[chunk] = result(answered)
        finally:  # after an interrupt or an error: a worker that computes on would answer the next call
            for place, _ in busy.values():
                self._end(place)
        return results

    def _begin(self, place: int, work: Work[C, R], chunk: C) -> "_Worker":
        """Give a chunk to the worker there, or to a new one where there is none or it died idle."""
        worker = self._pool[place]
        if worker is not None:
            try:
                worker.begin(work, chunk)
                return worker
            except OSError:
                _log.warning("worker process %d died (%s)", worker.pid, self._end(place))
        worker = self._pool[place] = _Worker()
        worker.begin(work, chunk)
        return worker

    def _end(self, place: int) -> str:
        worker, self._pool[place] = self._pool[place], None
        return "" if worker is None else worker.end()


class _Worker:
    """One process, and this end of its pipe."""

    def __init__(self) -> None:
        self.pipe, theirs = _context.Pipe()
        self._process = _context.Process(target=_serve, args=(theirs,), daemon=True)
        with _signals_blocked():
            self._process.start()
        theirs.close()  # the process holds the only other end: when it dies, the pipe ends
        self._key: str | None = None
        self._started = False

    @property
    def pid(self) -> int:
        return self._process.pid or 0

    def begin(self, work: Work[Any, Any], chunk: Any) -> None:
        """Send a chunk, and the work where the process has another."""
        if not self._started:
            self._welcome()
        self.pipe.send((None if self._key == work.key else work.pickled, chunk))
        self._key = work.key

    def answer(self) -> Answer:
        """Take the answer to the last chunk; EOFError or OSError: the process has died."""
        return self.pipe.recv()

    def end(self) -> str:
        """Kill the process, which holds nothing worth a farewell; return how it ended."""
        self._process.kill()
        self._process.join()
        self.pipe.close()
        code = self._process.exitcode or 0
        return signal.Signals(-code).name if code < 0 else f"exit status {code}"

    def _welcome(self) -> None:
        """Wait until the process has started; one that cannot must not be replaced for ever."""
        try:
            self.pipe.recv()
        except (EOFError, OSError):
            self._process.join()
            hint = "its own words stand above; without --workers none is needed"
            raise RunError(f"a worker process did not start ({self.end()})", hint=hint) from None
        self._started = True


def _answered(workers: dict[_Worker, tuple[int, int]]) -> list[_Worker]:
    """Wait until some of the workers have answered or died; return these."""
    ready = wait([worker.pipe for worker in workers])
    return [worker for worker in workers if worker.pipe in ready]


@contextmanager
def _signals_blocked() -> Generator[None]:
    """Processes started in here never see Ctrl-C or a cluster's notices: their parent ends them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # else started in here, and it unblocks what it finds blocked
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM, signal.SIGUSR1})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _serve(pipe: Connection) -> None:
    """What a worker process does until its pipe ends, as it does when the other end's process dies."""
    kept: Any = None

    def apply(pickled: bytes | None, chunk: Any) -> Any:
        nonlocal kept
        kept = kept if pickled is None else pickle.loads(pickled)
        return kept(chunk)

    try:
        pipe.send("ready")
        while True:
            pipe.send(answer(partial(apply, *pipe.recv())))
    except (EOFError, OSError):
        return
