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

import numpy as np

from hydroid.errors import RunError
from hydroid.fitting.fit import Fit
from hydroid.log import Log, LogFinding
from hydroid.settings.fit import FitSettings

LINE = logging.Formatter("%(asctime)s %(levelname)-7s %(message)s", datefmt="%Y-%m-%dT%H:%M:%S%z")
"""how an event is written"""

_log = logging.getLogger(__name__)


@contextmanager
def run_log(file: Path) -> Generator[None]:
    """Write what hydroid's loggers say, INFO and above, to a file as well.

    Raises:
        RunError: it cannot be written.
    """
    logger = logging.getLogger("hydroid")
    try:
        handler = _File(file, encoding="utf-8")
    except OSError as error:
        raise RunError(f"cannot be written ({error.strerror})", where=str(file)) from None
    handler.setFormatter(LINE)
    level = logger.level
    logger.setLevel(logging.INFO)
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
        handler.close()


def log_start(settings: FitSettings, logs: Sequence[Log], findings: Sequence[LogFinding]) -> None:
    """Log what runs, where, with what."""
    names = ("hydroid", "mujoco", "numpy", "numba")
    versions = ", ".join(f"{name} {version(name)}" for name in names)
    _log.info("%s, Python %s", versions, platform.python_version())
    _log.info("process %d on %s: %s", os.getpid(), socket.gethostname(), shlex.join(sys.argv))
    search = settings.search
    _log.info(
        "stage %s, search %s, seed %d; settings in config.yaml", settings.stage, search.name, search.seed
    )
    _log.info("logs: %s", ", ".join(log.source for log in logs))
    for finding in findings:
        _log.info("%s: %s", finding.level, finding)


def log_end(fit: Fit, seconds: float) -> None:
    """Log how a fit ended."""
    simulated, diverged = fit.history[-1, 2:4]
    _log.info("search: %d parameter sets simulated, %d of them diverged", simulated, diverged)
    _log.info("done in %.0f s: %s, rms error %.6g deg", seconds, fit.final, np.rad2deg(fit.best.rms))


class _File(logging.FileHandler):
    """A log that falls silent where it cannot be written: no run ends for it."""

    def format(self, record: logging.LogRecord) -> str:
        return " ".join(super().format(record).splitlines())

    def handleError(self, record: logging.LogRecord) -> None:
        pass
