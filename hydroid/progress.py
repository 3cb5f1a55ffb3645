"""How long work reports its progress."""

from collections.abc import Callable

Progress = Callable[[str, int, int], None]
"""called with what is being done, how much of it is done, and how much there is"""


def no_progress(what: str, done: int, total: int) -> None:
    """Show nothing."""
