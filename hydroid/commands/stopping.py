"""A cluster's notice that time is nearly up ends a run as Ctrl-C does: with a checkpoint."""

import signal
from types import FrameType

NOTICES = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGUSR1") if hasattr(signal, name))

_asked = False


def listen() -> None:
    """Turn the first of the notices into a KeyboardInterrupt: clusters repeat themselves."""
    for number in NOTICES:
        signal.signal(number, _stop)


def asked() -> bool:
    """Whether a notice has come.

    Python drops an exception that is raised in a finalizer. Who asks here between two pieces of work does not
    miss the notice.
    """
    return _asked


def _stop(number: int, frame: FrameType | None) -> None:
    global _asked
    _asked = True
    for notice in NOTICES:
        signal.signal(notice, signal.SIG_IGN)
    raise KeyboardInterrupt
