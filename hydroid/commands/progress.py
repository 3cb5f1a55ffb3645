"""How far a command is: a bar on a terminal, plain lines elsewhere, nothing in Python or with -q."""

import sys
import time
from collections.abc import Generator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, Self

import typer

from hydroid.commands import stopping

if TYPE_CHECKING:
    from hydroid.parameters import Array
    from hydroid.settings.fit import FitSettings

LINE_EVERY = 10.0
"""seconds between plain lines"""
DEGREES = 57.29577951308232
NAMES = {"ga": "GA", "nsga2": "NSGA-II", "cmaes": "CMA-ES", "multistart": "multi-start"}

_visible: ContextVar[bool] = ContextVar("visible", default=False)


@contextmanager
def shown(visible: bool) -> Generator[None]:
    """Show progress, as the command line does."""
    token = _visible.set(visible)
    try:
        yield
    finally:
        _visible.reset(token)


class Progress:
    """Shows the progress of a command, as `hydroid.progress.Progress`; use it as a context.

    Args:
        label: stands before each line.
    """

    def __init__(self, label: str = "") -> None:
        self._label, self._bar = label, None
        self._shown = time.monotonic()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def __call__(self, what: str, done: float, total: float | None, text: str = "") -> None:
        """Show what is being done, how much of it is done, and how much there is."""
        if stopping.asked():
            raise KeyboardInterrupt
        if not _visible.get():
            return
        if sys.stderr.isatty():
            self._draw(what, done, total, text)
        elif time.monotonic() - self._shown > LINE_EVERY:
            self._shown = time.monotonic()
            count = f"{done:.0f}" if total is None else f"{done:.0f} of {total:.0f}"
            typer.echo(f"{self._label} {what}: {count} {text}".strip(), err=True)

    def _draw(self, what: str, done: float, total: float | None, text: str) -> None:
        if self._bar is None:
            self._bar, self._task = _new_bar(self._label)
        self._bar.update(self._task, completed=done, total=total, what=what, text=text)


class FitProgress(Progress):
    """Shows the progress of a fit, as `fitting.fit.Watcher`.

    Args:
        settings: of the fit.
        label: stands before each line, where several runs follow each other.
    """

    def __init__(self, settings: "FitSettings", label: str) -> None:
        search = settings.search
        super().__init__(f"{label} {NAMES.get(search.name, search.name)}".strip())
        self._step = "start" if search.algorithm == "multistart" else "population"
        self._total = 1 + getattr(search, search.algorithm).generations
        self._scale, self._unit = (1.0, "") if settings.objective.relative else (DEGREES, " deg")
        self._began, self._before = time.monotonic(), -1.0

    def generation(self, row: "Array") -> None:
        """Take a row of `fitting.search.HISTORY`."""
        number, _, simulated, _, best, _ = map(float, row)
        if self._before < 0:  # a resumed run's rate counts from here
            self._before = simulated if number > 1 else 0.0
        rate = (simulated - self._before) / max(time.monotonic() - self._began, 1e-9)
        best_text = f"best {best * self._scale:.4g}{self._unit}"
        self(self._step, number, self._total, f"{best_text}, {rate:.0f} simulations/s")

    def refining(self, simulated: int, rms: float) -> None:
        """Take the number of simulations of the refinement, and the rms error [rad] so far."""
        self("refinement, simulations", simulated, None, f"rms error {rms * DEGREES:.4g} deg")


def _new_bar(label: str) -> tuple[Any, Any]:
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    bar = Bar(
        TextColumn("{task.description} {task.fields[what]} {task.completed:.0f}"),
        BarColumn(bar_width=20),
        TextColumn("{task.fields[text]}"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )
    bar.start()
    return bar, bar.add_task(label, total=None, what="", text="")
