"""How far a command is, and whether it is to stop.

A bar shows it on a terminal, plain lines elsewhere, and nothing in Python or with -q. A
cluster's notice that time is nearly up ends a run as Ctrl-C does: with a checkpoint.
"""

import math
import signal
import sys
import time
from contextvars import ContextVar
from types import FrameType
from typing import TYPE_CHECKING, Any, Self

from hydroid.commands.console import tell
from hydroid.files import NOTICES
from hydroid.words import printable

if TYPE_CHECKING:
    from hydroid.arrays import Array
    from hydroid.fitting.step import Step
    from hydroid.settings.fit import FitSettings

BETWEEN_LINES = 30.0
"""time between lines of progress where there is no terminal [s]"""
VISIBLE: ContextVar[bool] = ContextVar("visible", default=False)
"""whether progress is shown: the command line sets it"""

_stopped = False


def listen() -> None:
    """Note Ctrl-C, and turn the first of a cluster's notices into it: clusters repeat
    themselves.

    One that is ignored from the start, as `nohup` has it, stays ignored.
    """
    for number in (signal.SIGINT, *NOTICES):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _stop)


def stopped() -> bool:
    """Whether Ctrl-C or a notice has come.

    Python drops an exception that is raised in a finalizer, and a library that is
    being imported may make an ImportError of it. Who asks here does not miss it.
    """
    return _stopped


def _stop(number: int, frame: FrameType | None) -> None:
    global _stopped
    _stopped = True
    # Ctrl-C may be pressed again
    if number != signal.SIGINT:
        for notice in NOTICES:
            signal.signal(notice, signal.SIG_IGN)
    raise KeyboardInterrupt


class Progress:
    """Shows the progress of a command, as `hydroid.progress.Progress`; use it as a
    context."""

    def __init__(self) -> None:
        self._bar: Any = None
        self._shown = time.monotonic()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def __call__(
        self, what: str, done: float, total: float | None, text: str = ""
    ) -> None:
        """Show what is being done, how much of it is done, and how much there is."""
        if _stopped:
            raise KeyboardInterrupt
        if not VISIBLE.get():
            return
        line = f"{what}:" if total is None else f"{what} {done:.0f} of {total:.0f}"
        line = printable(f"{line} {text}".strip())
        if sys.stderr.isatty():
            self._move_bar(line, done, total)
        elif time.monotonic() - self._shown > BETWEEN_LINES:
            self._shown = time.monotonic()
            tell(line)

    def _move_bar(self, line: str, done: float, total: float | None) -> None:
        from rich.markup import escape

        if self._bar is None:
            from rich.console import Console
            from rich.progress import Progress as Bar

            # the line last: its length varies
            columns = reversed(Bar.get_default_columns())
            self._bar = Bar(*columns, console=Console(stderr=True), transient=True)
            self._bar.add_task("", total=None)
            self._bar.start()
        task = self._bar.tasks[0]
        # `update` takes None for no change
        task.total = total
        # a joint may be called [/b]
        self._bar.update(task.id, completed=done, description=escape(line))


class FitProgress(Progress):
    """Shows the progress of a fit with its settings, as `fitting.watcher.Watcher`.

    Its time is up `budget` seconds after it was made; None: never.
    """

    def __init__(self, settings: "FitSettings", budget: float | None = None) -> None:
        super().__init__()
        self._begun = time.monotonic()
        self._end = math.inf if budget is None else self._begun + budget
        self._settings = settings
        search = settings.search
        self._total = 1 + getattr(search, search.algorithm).generations

    def generation(self, row: "Array") -> bool:
        """Take a row of `fitting.search.HISTORY`; return whether time is up."""
        self("generation", row[0], self._total, f"({row[2]:.0f} simulations)")
        return time.monotonic() > self._end

    def refining(self, step: "Step", simulated: int, rms: float) -> bool:
        """Take a step of the fit, its number of simulations, and its rms error [rad] so
        far; return whether time is up.

        How many steps there will be shows only as the fit goes on, so none are counted.
        """
        from hydroid.units import display

        arm = self._settings.arm
        joints = (step.joint,) if step.joint else self._settings.outputs
        about = "all joints"
        if len(joints) == 1:
            about = arm.joint_names[joints[0] - 1]
        all_slide = {*joints} <= {*arm.slides}
        error = display(slides=all_slide).way(math.degrees(rms))
        text = f"rms error {error}, {simulated} simulations"
        self(f"{self._since_begun()}, {_model(step)}, {about}", simulated, None, text)
        return time.monotonic() > self._end

    def _since_begun(self) -> str:
        """Return the time that the fit has taken, as 1:05 (min:s)."""
        minutes, seconds = divmod(int(time.monotonic() - self._begun), 60)
        return f"{minutes}:{seconds:02d}"


def _model(step: "Step") -> str:
    """Return which model a step of a fit refines, and from where."""
    words = f"start {step.start}" if step.model == "start" else step.estimate
    if step.numbers:
        words += " from nine numbers"
    return words
