"""One line that says how far a study is: rewritten on a terminal, now and then a new one elsewhere."""

import sys
import time

import typer

LINE_EVERY = 10.0
"""seconds between lines where they stay"""


class Line:
    """Told by a study how far it is; use it as a context.

    Args:
        quiet: show nothing.
    """

    def __init__(self, *, quiet: bool) -> None:
        self._quiet, self._rewrites = quiet, sys.stderr.isatty()
        self._spoken, self._shown = time.monotonic(), False

    def __enter__(self) -> "Line":
        return self

    def __exit__(self, *_: object) -> None:
        if self._shown and self._rewrites:
            typer.echo("\r\033[K", nl=False, err=True)

    def __call__(self, what: str, done: int, total: int) -> None:
        """Take what is being done, how much of it is done, and how much there is."""
        now = time.monotonic()
        if self._quiet or now - self._spoken < (0.2 if self._rewrites else LINE_EVERY):
            return
        self._spoken, self._shown = now, True
        text = f"{what}: {done} of {total}"
        typer.echo(f"\r\033[K{text}" if self._rewrites else text, nl=not self._rewrites, err=True)
