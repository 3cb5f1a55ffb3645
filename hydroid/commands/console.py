"""What a command prints: tables and lines, or JSON; log lines and errors."""

import json
import logging
import sys
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

import typer

from hydroid.progress import logging_to

if TYPE_CHECKING:
    from hydroid.commands.result import Printed

OPTIONS = {
    "search.algorithm": "--algorithm",
    "search.seed": "--seed",
    "simulation.threads": "--threads",
    "refinement": "--no-refinement",
    "joint_refinement": "--both-stages",
    "design.duration_s": "--duration",
    "design.joints": "--joints",
}
"""settings that have an option of their own"""


def show(result: "Printed", *, as_json: bool, verbose: bool = False) -> None:
    """Print a result: as JSON, or as tables and lines, with its details if `verbose`."""
    if as_json:
        _print_json(result.plain())
        return
    for line in [*(result.details if verbose else ()), *result.lines]:
        if isinstance(line, str):
            typer.echo(line)
        else:
            line.show()


def show_error(error: Any) -> None:
    """Print what the user can correct, in one line or as JSON, by the option that set what is wrong.

    The error is a `HydroidError`, or a wrong command line, which typer shows.
    """
    usage = hasattr(error, "format_message")
    what, where, hint = (error.format_message(), "", "") if usage else (error.what, error.where, error.hint)
    key = where.removeprefix("--set ")
    if key in OPTIONS and any(word.partition("=")[0] == OPTIONS[key] for word in sys.argv[1:]):
        where, what = OPTIONS[key], what.removeprefix(f"{key}: ")
    if "--json" in sys.argv[1:]:
        kind = "usage" if usage else type(error).__name__.removesuffix("Error").lower()
        _print_json({"error": {"kind": kind, "what": what, "where": where, "hint": hint}})
    elif usage:
        error.show()
    else:
        text = str(type(error)(what, where=where, hint=hint))
        typer.echo(f"hydroid: {' '.join(text.split())}", err=True)


def _print_json(content: dict[str, Any]) -> None:
    # the schema is the version of the keys (docs/json.md)
    typer.echo(json.dumps({"schema": 1} | content, ensure_ascii=False, allow_nan=False))


def log_lines(*, verbose: bool, quiet: bool) -> AbstractContextManager[None]:
    """Print warnings and notes of hydroid's loggers, nothing where quiet, every line where verbose.

    An error is not among them: it ends the command, which prints it.
    """
    handler = _Terminal()
    form = "%(asctime)s %(levelname)-7s %(message)s" if verbose else "hydroid: %(message)s"
    handler.setFormatter(logging.Formatter(form, datefmt="%Y-%m-%dT%H:%M:%S%z"))
    handler.addFilter(lambda record: verbose or (logging.INFO < record.levelno < logging.ERROR and not quiet))
    return logging_to(handler)


class _Terminal(logging.Handler):
    """Writes to what is stderr at that moment: a progress bar takes its place while it is drawn."""

    def emit(self, record: logging.LogRecord) -> None:
        typer.echo(self.format(record), err=True)
