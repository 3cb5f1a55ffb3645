"""Checkpoints of a fit: arrays by the name of what is under way, stored every few seconds.

A run folder keeps them in a file (`run.checkpoint`); elsewhere a plain dict will do.
"""

import time
from collections.abc import Callable, Generator, MutableMapping
from contextlib import contextmanager
from typing import Any

from numpy.typing import NDArray

SAVE_EVERY = 5.0
"""seconds between checkpoints: a lost one costs no more, and writing it is noise beside the work"""

Arrays = dict[str, NDArray[Any]]
Checkpoints = MutableMapping[str, Arrays]


@contextmanager
def saving(checkpoints: Checkpoints, name: str) -> Generator[Callable[[Callable[[], Arrays]], None]]:
    """Yield a function that takes how the newest state is stored.

    A state is stored every SAVE_EVERY seconds, and the last one where the block ends, also by an interrupt.
    """
    saved, pending = time.monotonic(), None

    def keep(state: Callable[[], Arrays]) -> None:
        nonlocal saved, pending
        pending = state
        if time.monotonic() - saved > SAVE_EVERY:
            checkpoints[name] = state()
            saved, pending = time.monotonic(), None

    try:
        yield keep
    finally:
        if pending is not None:
            checkpoints[name] = pending()
