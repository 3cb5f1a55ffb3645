"""How far a command is, and whether it is to stop.

A bar shows it on a terminal, plain lines elsewhere, and nothing in Python or with -q. A cluster's notice that
time is nearly up ends a run as Ctrl-C does: with a checkpoint.
"""

import math
import signal
import sys
import time
from contextvars import ContextVar
from types import FrameType
from typing import TYPE_CHECKING, Self

import typer

from hydroid.files import NOTICES

if TYPE_CHECKING:
    from hydroid.arrays import Array
    from hydroid.settings.fit import FitSettings

VISIBLE: ContextVar[bool] = ContextVar("visible", default=False)
"""whether progress is shown: the command line sets it"""

_stopped = False


def listen() -> None:
    """Turn the first of the notices into a KeyboardInterrupt: clusters repeat themselves."""
    for number in NOTICES:
        signal.signal(number, _stop)


def stopped() -> bool:
    """Whether a notice has come.

    Python drops an exception that is raised in a finalizer. Who asks here between two pieces of work does not
    miss the notice.
    """
    return _stopped


def _stop(number: int, frame: FrameType | None) -> None:
    global _stopped
    _stopped = True
    for notice in NOTICES:
        signal.signal(notice, signal.SIG_IGN)
    raise KeyboardInterrupt


class Progress:
    """Shows the progress of a command, as `hydroid.progress.Progress`; use it as a context."""

    def __init__(self) -> None:
        self._bar, self._shown = None, time.monotonic()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def __call__(self, what: str, done: float, total: float | None, text: str = "") -> None:
        """Show what is being done, how much of it is done, and how much there is."""
        if _stopped:
            raise KeyboardInterrupt
        if not VISIBLE.get():
            return
        line = f"{what}:" if total is None else f"{what} {done:.0f} of {total:.0f}"
        if sys.stderr.isatty():
            if self._bar is None:
                from rich.console import Console
                from rich.progress import Progress as Bar, TextColumn

                text_column, console = TextColumn("{task.fields[text]}"), Console(stderr=True)
                self._bar = Bar(*Bar.get_default_columns(), text_column, console=console, transient=True)
                self._bar.add_task("", total=None, text="")
                self._bar.start()
            self._bar.update(self._bar.task_ids[0], completed=done, total=total, description=line, text=text)
        elif time.monotonic() - self._shown > 30.0:  # seconds between plain lines
            self._shown = time.monotonic()
            typer.echo(f"{line} {text}".strip(), err=True)


class FitProgress(Progress):
    """Shows the progress of a fit with its settings, as `fitting.ladder.Watcher`.

    Its time is up `budget` seconds after it was made; None: never.
    """

    def __init__(self, settings: "FitSettings", budget: float | None = None) -> None:
        super().__init__()
        self._end = math.inf if budget is None else time.monotonic() + budget
        search, self._joints = settings.search, settings.arm.joint_names
        names = {"ga": "GA population", "nsga2": "NSGA-II population", "multistart": "multi-start start"}
        self._step = names[search.algorithm]
        self._total = 1 + getattr(search, search.algorithm).generations
        self._errors = dict[tuple[str, str], list[float]]()

    def _fallen(self, what: str, part: str, error: float) -> str:
        """Say how far the best error has fallen: as a part of the first one, since joints differ in size."""
        errors = self._errors.setdefault((what, part), [error])
        errors.append(error)
        return f"error at {100 * min(errors) / max(errors[0], 1e-12):.0f} % of the start's"

    def generation(self, row: "Array") -> bool:
        """Take a row of `fitting.search.HISTORY`; return whether time is up."""
        number, _, simulated, _, best, _ = map(float, row)
        text = f"{self._fallen(self._step, '', best)}, {simulated:.0f} simulations"
        self(self._step, number, self._total, text)
        return time.monotonic() > self._end

    def refining(self, name: str, simulated: int, rms: float) -> bool:
        """Take the name of a least squares, its number of simulations, and its rms error [rad] so far.

        Returns whether time is up.
        """
        alone = (f"joint {joint}" for k, joint in enumerate(self._joints, 1) if f" joint {k} " in name)
        what = next(alone, name.replace("refined", "refinement"))
        fallen = self._fallen(what, name.rpartition(" part ")[2], rms)
        self(what, simulated, None, f"{simulated} simulations, {fallen}")
        return time.monotonic() > self._end
