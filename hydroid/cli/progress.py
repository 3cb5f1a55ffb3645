"""How far a fit is: a bar on a terminal, plain lines elsewhere, nothing with -q."""

import sys
import time
from typing import Any

import typer

from hydroid.cli import stopping
from hydroid.fitting.search import HISTORY
from hydroid.parameters import Array
from hydroid.settings.fit import FitSettings

LINE_EVERY = 10.0
"""seconds between plain lines"""


class Progress:
    """Watches a fit; use it as a context.

    Args:
        settings: the fit's settings; they say how many generations there are.
        label: what stands before the bar, where several runs follow each other.
        quiet: show nothing.
    """

    def __init__(self, settings: FitSettings, label: str, *, quiet: bool) -> None:
        search = settings.search
        names = {"ga": "GA", "nsga2": "NSGA-II", "cmaes": "CMA-ES", "multistart": "multi-start"}
        self._name = names.get(search.name, search.name)
        self._step = "start" if search.algorithm == "multistart" else "generation"
        self._total = 1 + getattr(search, search.algorithm).generations
        self._scale, self._unit = (1.0, "") if settings.objective.relative else (57.29577951308232, " deg")
        self._label, self._quiet = label, quiet
        self._bar: Any = None
        self._started = self._spoken = time.monotonic()
        self._first = 0.0  # simulations that a resumed run had made before

    def __enter__(self) -> "Progress":
        if not self._quiet and sys.stderr.isatty():
            self._bar, self._task = _bar(f"{self._label} {self._name}".strip(), self._total)
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def generation(self, row: Array) -> None:
        """Take a row of HISTORY."""
        _stop_if_asked()
        now = dict(zip(HISTORY, row, strict=True))
        elapsed = time.monotonic() - self._started
        if now["generation"] > 1 and self._first == 0:
            self._first = now["simulated"]  # a resumed run's rate counts from here
        rate = (now["simulated"] - (self._first if self._first > 0 else 0)) / max(elapsed, 1e-9)
        text = f"best {now['best'] * self._scale:.4g}{self._unit}, {rate:.0f} simulations/s"
        self._show(f"{self._step} {now['generation']:.0f} of {self._total}", text, now["generation"])

    def refining(self, simulated: int) -> None:
        """Take the number of simulations the refinement has made."""
        _stop_if_asked()
        self._show("refinement", f"{simulated} simulations", None)

    def _show(self, where: str, text: str, done: float | None) -> None:
        if self._bar is not None:
            self._bar.update(self._task, completed=done, what=where, text=text)
        elif not self._quiet and time.monotonic() - self._spoken > LINE_EVERY:
            self._spoken = time.monotonic()
            typer.echo(f"{self._label} {self._name}: {where}: {text}".strip(), err=True)


def _stop_if_asked() -> None:
    if stopping.asked():
        raise KeyboardInterrupt


def _bar(label: str, total: int) -> tuple[Any, Any]:
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    bar = Bar(
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        TextColumn("{task.fields[what]}: {task.fields[text]}"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
    )
    return bar, bar.add_task(label, total=total, what="starting", text="")
