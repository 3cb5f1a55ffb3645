"""One process a run folder: a lock that the system takes back when its process dies, however it dies."""

import errno
import logging
import os
import socket
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from hydroid.errors import RunError

try:
    import fcntl
except ImportError:  # Windows has none
    fcntl = None

LOCK = ".lock"
"""name of the lock's file; it stays, what counts is whether a process holds it"""

_log = logging.getLogger(__name__)


@contextmanager
def locked(folder: Path) -> Generator[None]:
    """Hold a folder, which is made if it is not there, against all other processes.

    The lock is `flock`'s. A file that merely exists, with a process's number in it, would outlive a killed
    process, and on a cluster nobody can tell whether that number lives on another machine. Linux passes the
    lock on to NFS's server (since 2.6.12) and to Lustre's where it is mounted with `flock`, so that it holds
    between machines; with `localflock`, or NFS's `nolock`, it holds on one machine only. On a file system
    that has no locks there is none, but a warning.

    Raises:
        RunError: another process holds it, or nothing can be written there.
    """
    path = folder / LOCK
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = path.open("a+b", buffering=0)  # for writing: NFS grants no exclusive lock otherwise
    except OSError as error:
        raise RunError(f"cannot be written ({error.strerror})", where=str(folder)) from None
    with file:  # to close it ends the lock
        _take(file, folder)
        yield


def _take(file: IO[bytes], folder: Path) -> None:
    if fcntl is None:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
            hint = "wait for it to end, or choose another --out"
            raise RunError(f"is in use by {_holder(file)}", where=str(folder), hint=hint) from None
        _log.warning("%s: no lock on this file system (%s); let no two runs use it", folder, error.strerror)
        return
    try:
        file.truncate(0)
        file.write(f"process {os.getpid()} on {socket.gethostname()}".encode())
    except OSError as error:
        raise RunError(f"cannot be written ({error.strerror})", where=str(folder)) from None


def _holder(file: IO[bytes]) -> str:
    file.seek(0)
    return file.read(200).decode(errors="replace").strip() or "another process"
