"""What a command prints: tables and lines, or JSON; log lines and errors."""

import json
import logging
import math
import re
import sys
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol

import typer

if TYPE_CHECKING:
    from hydroid.errors import HydroidError
    from hydroid.report.table import Table

FLAGS = {
    "search.algorithm": "--algorithm",
    "search.pymoo.algorithm": "--algorithm",
    "search.seed": "--seed",
    "simulation.threads": "--threads",
    "refinement": "--no-refinement",
    "joint_refinement": "--joint",
    "design.duration_s": "--duration",
    "design.joints": "--joints",
    "design.criterion": "--criterion",
}
"""settings that have an option of their own"""

PYMOO = "search.pymoo.algorithm"
"""setting whose values --algorithm gives as pymoo:NAME"""

FORMER_OPTIONS = {"--gif": "`hydroid render RUN -o arm.gif`"}
"""options of earlier versions, and what became of them"""

SCHEMA = 1
"""version of the JSON (docs/json.md)"""


class Printed(Protocol):
    """How to print (`options.Output`)."""

    json: bool
    quiet: bool


def show(output: Printed, content: Callable[[], Mapping[str, Any]], lines: "Iterable[Table | str]") -> None:
    """Print a result: as JSON, as tables and lines, or not at all."""
    if output.json:
        typer.echo(json.dumps({"schema": SCHEMA} | dict(content()), ensure_ascii=False, allow_nan=False))
    elif not output.quiet:
        for line in lines:
            if isinstance(line, str):
                typer.echo(line)
            else:
                line.show()


def rows(table: "Table", *keys: str) -> list[dict[str, Any]]:
    """Return a table's rows by key for JSON, which has no NaN or infinity: these become null."""
    return [dict(zip(keys, map(_plain, row), strict=True)) for row in table.rows]


def _plain(cell: object) -> object:
    return None if isinstance(cell, float) and not math.isfinite(cell) else cell


def wants_json() -> bool:
    """Return whether the command line asks for JSON, also where it is otherwise wrong."""
    return "--json" in sys.argv[1:]


def show_error(error: "HydroidError") -> None:
    """Print what the user can mend: one line, or JSON."""
    where, what = _in_flags(error)
    if wants_json():
        kind = type(error).__name__.removesuffix("Error").lower()
        _show_json_error(kind, what, where, error.hint)
        return
    text = str(type(error)(what, where=where, hint=error.hint))
    typer.echo(f"hydroid: {' '.join(text.split())}", err=True)


def show_usage_error(error: Any) -> None:
    """Print a wrong command line, as click does or as JSON."""
    if wants_json():
        _show_json_error("usage", str(error.format_message()), "", "")
    else:
        error.show()
        if now := FORMER_OPTIONS.get(getattr(error, "option_name", "")):
            typer.echo(f"{error.option_name} is now {now}", err=True)


def _show_json_error(kind: str, what: str, where: str, hint: str) -> None:
    content = {"kind": kind, "what": what, "where": where, "hint": hint}
    typer.echo(json.dumps({"schema": SCHEMA, "error": content}, ensure_ascii=False))


def _in_flags(error: "HydroidError") -> tuple[str, str]:
    """Return where and what is wrong, with the option's name where a setting came from one."""
    key = error.where.removeprefix("--set ")
    flag = FLAGS.get(key, "")
    if flag and any(a == flag or a.startswith(f"{flag}=") for a in sys.argv[1:]):
        what = error.what.removeprefix(f"{key}: ")
        return flag, re.sub(r"'(\w+)'", r"pymoo:\1", what) if key == PYMOO else what
    return error.where, error.what


@contextmanager
def log_lines(*, verbose: bool, quiet: bool) -> Generator[None]:
    """Print warnings and notes of hydroid's loggers, nothing where quiet, every line where verbose.

    An error is not among them: it ends the command, which prints it.
    """
    handler = _Terminal()
    form = "%(asctime)s %(levelname)-7s %(message)s" if verbose else "hydroid: %(message)s"
    handler.setFormatter(logging.Formatter(form, datefmt="%Y-%m-%dT%H:%M:%S%z"))
    handler.addFilter(lambda record: verbose or (logging.INFO < record.levelno < logging.ERROR and not quiet))
    logger = logging.getLogger("hydroid")
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.setLevel(level)
        logger.removeHandler(handler)


class _Terminal(logging.Handler):
    """Writes to what is stderr at that moment: a progress bar takes its place while it is drawn."""

    def emit(self, record: logging.LogRecord) -> None:
        typer.echo(self.format(record), err=True)
