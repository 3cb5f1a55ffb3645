"""A cluster's notice that time is nearly up ends a run as Ctrl-C does: with a checkpoint."""

import signal
from types import FrameType

NOTICES = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGUSR1") if hasattr(signal, name))

_asked = False
_interrupt: KeyboardInterrupt | None = None


def listen() -> None:
    """Turn the notices into KeyboardInterrupt, the first of them: clusters repeat themselves."""
    for number in NOTICES:
        signal.signal(number, _stop)


def asked() -> bool:
    """Whether a notice has come.

    An exception that is raised in the middle of anything may be lost there: Python drops what is raised in a
    finalizer. Who asks here between two pieces of work does not miss it.
    """
    return _asked


def remember(stop: KeyboardInterrupt) -> None:
    """Keep what ended a command, which typer turns into an exit status."""
    global _interrupt
    _interrupt = stop


def kept() -> str:
    """Return what remains of a stopped fit or study, to follow the word `stopped`."""
    kept = getattr(_interrupt, "kept", None)
    if kept is None:
        return ""
    return f"; {kept}" if kept else "; nothing was written"


def _stop(number: int, frame: FrameType | None) -> None:
    global _asked
    _asked = True
    for each in NOTICES:
        signal.signal(each, signal.SIG_IGN)
    raise KeyboardInterrupt
