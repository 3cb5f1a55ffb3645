"""What a command returns, and how a terminal, JSON and a notebook show it; log lines
and errors."""

import json
import logging
import os
import shlex
import sys
from collections.abc import Generator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from shutil import which
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import typer

from hydroid.errors import HydroidError, RunError
from hydroid.files import Plain, fill_template
from hydroid.progress import logging_to
from hydroid.words import printable

if TYPE_CHECKING:
    from hydroid.reporting.page import Page, Table

OPTIONS = {
    "search.algorithm": "--algorithm",
    "search.seed": "--seed",
    "simulation.threads": "--threads",
    "refinement": "--no-refinement",
    "design.duration_s": "--duration",
    "design.joints": "--joints",
}
"""settings that have an option of their own"""

T_co = TypeVar("T_co", covariant=True)


@dataclass(frozen=True, eq=False, repr=False)
class Printed:
    """A result that prints itself.

    Attributes:
        lines: what a terminal and a notebook show: tables and sentences.
        content: what JSON holds (docs/json.md): mappings, lists, text and finite
            numbers.
        details: further lines that -v adds.
    """

    lines: "Sequence[Table | str]"
    content: Mapping[str, Any]
    details: "Sequence[Table | str]" = field(default=(), kw_only=True)
    exit_status = 0

    def plain(self) -> Plain:
        """Return what JSON holds."""
        return dict(self.content)

    def __repr__(self) -> str:
        text = next((line for line in self.lines if isinstance(line, str)), "")
        return f"<{type(self).__name__}: {text}>"

    def _repr_html_(self) -> str:
        return fill_template(
            "commands/notebook.html.j2", lines=(*self.lines, *self.details)
        )


@dataclass(frozen=True, eq=False, repr=False)
class Result(Printed, Generic[T_co]):
    """The result of a command.

    Attributes:
        result: the numbers.
        page: the report, with its tables by name in `page.tables`, of a command that
            has one.
        exit_status: of the command; 0 for success.
    """

    result: T_co
    page: "Page | None" = None
    exit_status: int = 0


def written(report: "Page | Mapping[str, Table]", out: str | Path | None) -> list[str]:
    """Write a report, or tables by name, to a folder, if there is one; return the last
    file."""
    if out is None:
        return []
    from hydroid.reporting.page_file import write_page, write_tables

    write = write_tables if isinstance(report, Mapping) else write_page
    return [str(write(report, Path(out)))]  # pyright: ignore[reportArgumentType]


def show(result: Printed, *, as_json: bool, verbose: bool = False) -> None:
    """Print a result: as JSON, or as tables and lines, with its details if
    `verbose`."""
    with _printing():
        if as_json:
            _print_json(result.plain())
        else:
            _print_lines(result, verbose=verbose)


@contextmanager
def _printing() -> Generator[None]:
    """Turn what keeps the output from being written, such as a full disk,
    into a RunError; a reader that has left is none."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        what = f"cannot be written ({error.strerror})"
        raise RunError(what, "the output") from None


def _print_lines(result: Printed, *, verbose: bool) -> None:
    details = result.details if verbose else ()
    for line in (*details, *result.lines):
        if not isinstance(line, str):
            line.show()
            continue
        if line.lstrip().startswith("hydroid "):
            # a command to be pasted: as this shell finds it
            line = line.replace("hydroid", program(), 1)
        typer.echo(printable(line))


def tell(line: str) -> None:
    """Print a line on stderr; where it cannot be written, as on a full disk,
    the work goes on without it."""
    with suppress(OSError):
        typer.echo(printable(line), err=True)


def program() -> str:
    """Return hydroid as the user typed it, where a shell does not find it by its
    name."""
    typed = sys.argv[0]
    is_other = Path(typed).stem == "hydroid" and which("hydroid") != os.path.abspath(
        typed
    )
    if is_other:
        return shlex.quote(typed)
    return "hydroid"


def show_error(error: Any) -> None:
    """Print a `HydroidError`, or typer's, in one line or as JSON,
    by the option that set what is wrong."""
    is_usage = hasattr(error, "format_message")
    if is_usage:
        text = error.format_message().rstrip(".")
        hint = f"see {error.ctx.command_path} --help"
        error = HydroidError(text[:1].lower() + text[1:], hint=hint)
    what = error.what
    where = error.where
    key = where.removeprefix("--set ")
    if key in OPTIONS and _is_given(OPTIONS[key]):
        where = OPTIONS[key]
        what = what.removeprefix(f"{key}: ")
    if "--json" in sys.argv[1:]:
        kind = "usage"
        if not is_usage:
            kind = type(error).__name__.removesuffix("Error").lower()
        parts = {"kind": kind, "what": what, "where": where, "hint": error.hint}
        with suppress(OSError):
            _print_json({"error": parts})
            return
    text = str(type(error)(what, where, error.hint))
    tell(f"hydroid: {' '.join(text.split())}")


def _is_given(option: str) -> bool:
    """Return whether the command line has an option."""
    return any(word.partition("=")[0] == option for word in sys.argv[1:])


def _print_json(content: Plain) -> None:
    # the schema is the version of the keys (docs/json.md)
    typer.echo(json.dumps({"schema": 1} | content, ensure_ascii=False, allow_nan=False))


def log_lines(*, verbose: bool, quiet: bool) -> AbstractContextManager[None]:
    """Print hydroid's warnings and notes, all lines if verbose;
    errors are printed where a command ends."""

    def is_shown(line: logging.LogRecord) -> bool:
        is_for_users = logging.INFO < line.levelno < logging.ERROR
        return verbose or (is_for_users and not quiet)

    handler = _Terminal()
    handler.addFilter(is_shown)
    return logging_to(handler, "" if verbose else "hydroid: %(message)s")


class _Terminal(logging.Handler):
    """Writes to what is stderr at that moment: a progress bar takes its place while it
    is drawn."""

    def emit(self, record: logging.LogRecord) -> None:
        tell(self.format(record))
