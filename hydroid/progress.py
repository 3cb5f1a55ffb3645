"""How long work reports its progress."""

import logging
from collections.abc import Callable

NOTE = logging.INFO + 5
"""level of a log line that a user sees though nothing is wrong"""
logging.addLevelName(NOTE, "NOTE")

Progress = Callable[[str, int, int], None]
"""called with what is being done, how much of it is done, and how much there is"""


def no_progress(what: str, done: int, total: int) -> None:
    """Show nothing."""
