"""How work reports its progress: calls while it runs, and lines of its loggers."""

import logging
from collections.abc import Callable, Generator
from contextlib import contextmanager

NOTE = logging.INFO + 5  # level of a log line that a user sees though nothing is wrong
logging.addLevelName(NOTE, "NOTE")
LOGGER = logging.getLogger("hydroid")

Progress = Callable[[str, int, int], None]
"""called with what is being done, how much of it is done, and how much there is"""


def no_progress(what: str, done: int, total: int) -> None:
    """Show nothing."""


@contextmanager
def logging_to(handler: logging.Handler, form: str = "") -> Generator[None]:
    """Let a handler take the lines of hydroid's loggers, INFO and above,
    in a form or with their times."""
    form = form or "%(asctime)s %(levelname)-7s %(message)s"
    handler.setFormatter(logging.Formatter(form, datefmt="%Y-%m-%dT%H:%M:%S%z"))
    level = LOGGER.level
    LOGGER.addHandler(handler)
    LOGGER.setLevel(logging.INFO)
    try:
        yield
    finally:
        LOGGER.setLevel(level)
        LOGGER.removeHandler(handler)
        handler.close()
