"""`run.log`: one line an event, with time and level, appended by every process that works on the run."""

import logging
import os
import platform
import shlex
import socket
import sys
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

from hydroid.errors import RunError
from hydroid.log import Log
from hydroid.progress import logging_to
from hydroid.settings.fit import FitSettings

_log = logging.getLogger(__name__)


@contextmanager
def run_log(file: Path) -> Generator[None]:
    """Write what hydroid's loggers say, INFO and above, to a file as well.

    Raises:
        RunError: it cannot be written.
    """
    try:
        handler = _File(file, encoding="utf-8")
    except OSError as error:
        raise RunError(f"cannot be written ({error.strerror})", where=str(file)) from None
    form = "%(asctime)s %(levelname)-7s %(message)s"
    handler.setFormatter(logging.Formatter(form, datefmt="%Y-%m-%dT%H:%M:%S%z"))
    with logging_to(handler):
        yield


def log_start(settings: FitSettings, logs: Sequence[Log]) -> None:
    """Log what runs, where, with what."""
    versions = ", ".join(f"{name} {version(name)}" for name in ("hydroid", "mujoco", "numpy", "numba"))
    _log.info("%s, Python %s", versions, platform.python_version())
    _log.info("process %d on %s: %s", os.getpid(), socket.gethostname(), shlex.join(sys.argv))
    search = f"search {settings.search.algorithm}, seed {settings.search.seed}"
    _log.info("stage %s, %s; settings in config.yaml", settings.stage, search)
    _log.info("logs: %s", ", ".join(log.source for log in logs))


class _File(logging.FileHandler):
    """A log that falls silent where it cannot be written: no run ends for it."""

    def format(self, record: logging.LogRecord) -> str:
        return " ".join(super().format(record).splitlines())

    def handleError(self, record: logging.LogRecord) -> None:
        pass
