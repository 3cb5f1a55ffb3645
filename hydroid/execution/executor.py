"""The one interface behind `--workers` and `--dask`: a function, chunks in, results out in their order."""

import hashlib
import pickle
import traceback
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, Generic, Protocol, TypeVar

from hydroid.errors import HydroidError

C = TypeVar("C")
R = TypeVar("R")

TRIES = 3
"""workers that a chunk may take down with it before it counts as failed"""


class Work(Generic[C, R]):
    """A function that workers apply to chunks: each gets it once, and keeps it until it gets another.

    Args:
        function: chunk -> result; both, and the function with all that it holds, can be pickled.
    """

    def __init__(self, function: Callable[[C], R]) -> None:
        self.pickled = pickle.dumps(function)

    @cached_property
    def key(self) -> str:
        """What tells it from other work: a hash of its content."""
        return hashlib.sha256(self.pickled).hexdigest()


class Executor(Protocol):
    """Spreads chunks over workers that may die at any time."""

    @property
    def workers(self) -> int:
        """Workers there are now, at least 1: into so many chunks a population is best cut."""
        ...

    def map(self, work: Work[C, R], chunks: Sequence[C]) -> list[R | None]:
        """Apply the work to every chunk; return the results in the chunks' order.

        A chunk whose worker died is given to another one. None stands for a chunk that has killed TRIES
        workers one after the other.

        Raises:
            HydroidError: the function raised it, or no worker can be started or reached.
            RuntimeError: the function raised anything else; its traceback is the message.
        """
        ...


Answer = tuple[bool, Any]
"""what a worker sends back: True and a result, or False and an error"""


def answer(function: Callable[[], Any]) -> Answer:
    """Call the function in a worker."""
    try:
        return True, function()
    except HydroidError as error:
        return False, error
    except Exception:  # its class may be unknown to the parent, and its traceback would be lost
        return False, RuntimeError(f"in a worker:\n{traceback.format_exc()}")


def result(answered: Answer) -> Any:
    """Take a worker's answer: return the result, or raise the error."""
    good, value = answered
    if not good:
        raise value
    return value
