"""What a command returns: numbers that print themselves in a terminal, as JSON and in a notebook."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

if TYPE_CHECKING:
    from hydroid.reporting.page import Page
    from hydroid.reporting.table import Table

T_co = TypeVar("T_co", covariant=True)


@dataclass(frozen=True, eq=False, repr=False)
class Printed:
    """What prints itself.

    Attributes:
        lines: what a terminal and a notebook show: tables and sentences.
        content: what JSON holds (docs/json.md): mappings, lists, text and finite numbers.
        details: further lines that -v adds.
    """

    lines: "Sequence[Table | str]"
    content: Mapping[str, Any]
    details: "Sequence[Table | str]" = field(default=(), kw_only=True)
    exit_status = 0

    def plain(self) -> dict[str, Any]:
        """Return what JSON holds."""
        return dict(self.content)

    def __repr__(self) -> str:
        text = next((line for line in self.lines if isinstance(line, str)), "")
        return f"<{type(self).__name__}: {text}>"

    def _repr_html_(self) -> str:
        return "".join(_html(line) for line in (*self.lines, *self.details))


@dataclass(frozen=True, eq=False, repr=False)
class Result(Printed, Generic[T_co]):
    """The result of a command.

    Attributes:
        result: the numbers.
        page: the report, with its tables by name in `page.tables`, of a command that has one.
        exit_status: of the command; 0 for success.
    """

    result: T_co
    page: "Page | None" = None
    exit_status: int = 0


def written(report: "Page | Mapping[str, Table]", out: str | Path | None) -> list[str]:
    """Write a report, or tables by name, to a folder, if there is one; return the file that is written last.

    Raises:
        RunError: the folder cannot be written.
    """
    if out is None:
        return []
    from hydroid.reporting.page_file import write_page, write_tables

    write = write_tables if isinstance(report, Mapping) else write_page
    return [*map(str, write(report, Path(out))[-1:])]  # pyright: ignore[reportArgumentType]


def _html(line: "Table | str") -> str:
    if isinstance(line, str):
        return f"<p>{escape(line)}</p>"
    from hydroid.reporting.table import shown

    def row(kind: str, cells: Sequence[str]) -> str:
        return f"<tr>{''.join(f'<{kind}>{escape(cell)}</{kind}>' for cell in cells)}</tr>"

    body = "".join(row("td", [*map(shown, cells)]) for cells in line.rows)
    return f"<table><caption>{escape(line.title)}</caption>{row('th', line.header)}{body}</table>"
