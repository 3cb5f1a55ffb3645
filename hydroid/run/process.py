"""The process that works on a run folder: its lock, and what it says in `run.log`.

The lock is one that the system takes back when its process dies, however it dies.
"""

import errno
import logging
import os
import platform
import shlex
import socket
import sys
from collections.abc import Generator
from contextlib import contextmanager, suppress
from io import FileIO
from pathlib import Path

from hydroid.errors import RunError
from hydroid.files import writing
from hydroid.parallel.workers import VERSIONS
from hydroid.progress import LOGGER, logging_to

try:
    import fcntl
except ImportError:  # Windows has none
    fcntl = None

# name of the lock's file; it stays, what counts is whether a process holds it
LOCK = ".lock"


@contextmanager
def locked(folder: Path) -> Generator[None]:
    """Hold a folder, which is made if it is not there, against all other processes.

    The lock is `flock`'s. A file that merely exists, with a process's number in it,
    would outlive a killed process, and on a cluster nobody can tell whether that number
    lives on another machine. Linux passes the lock on to NFS's server (since 2.6.12)
    and to Lustre's where it is mounted with `flock`, so that it holds between machines;
    with `localflock`, or NFS's `nolock`, it holds on one machine only. On a file system
    that has no locks there is none, but a warning.

    Raises RunError: another process holds the folder.
    """
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        # for writing: NFS grants no exclusive lock otherwise
        file = (folder / LOCK).open("a+b", buffering=0)
        if fcntl is not None:
            _lock(file, folder)
    with file:  # to close it ends the lock
        yield


def _lock(file: FileIO, folder: Path) -> None:
    """Lock an open file, and write into it who holds it."""
    assert fcntl is not None
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
            file.seek(0)
            written = file.read(200).decode(errors="replace").strip()
            # empty for the moment in which the other process writes who it is
            holder = written or "another process"
            hint = "wait for it to end, or choose another --out"
            raise RunError(f"is in use by {holder}", folder, hint) from None
        words = "%s: no lock on this file system (%s); let no two runs use it"
        LOGGER.warning(words, folder, error.strerror)
        return
    file.truncate(0)
    file.write(f"process {os.getpid()} on {socket.gethostname()}".encode())


@contextmanager
def run_log(file: Path) -> Generator[None]:
    """Write what hydroid's loggers say, INFO and above, to a file as well."""
    with writing(file):
        handler = _File(file, encoding="utf-8")
    with logging_to(handler):
        yield


def log_start() -> None:
    """Log what runs, where, with what."""
    versions = ", ".join(f"{name} {version}" for name, version in VERSIONS.items())
    LOGGER.info("%s, Python %s", versions, platform.python_version())
    command = shlex.join(sys.argv)
    LOGGER.info("process %d on %s: %s", os.getpid(), socket.gethostname(), command)


class _File(logging.FileHandler):
    """A log that falls silent where it cannot be written: no run ends for it."""

    def format(self, record: logging.LogRecord) -> str:
        # one line each, so that a program can read it
        return " ".join(super().format(record).splitlines())

    def handleError(self, record: logging.LogRecord) -> None:
        pass

    def close(self) -> None:
        with suppress(OSError):  # it writes what is left
            super().close()
