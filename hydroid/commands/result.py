"""What a command returns: numbers that print themselves in a terminal, as JSON and in a notebook."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from hydroid.reporting.page import Page
    from hydroid.reporting.table import Table


class Printed(ABC):
    """Knows how it is printed."""

    @abstractmethod
    def lines(self) -> "list[Table | str]":
        """Return what a terminal shows: tables and sentences."""

    @abstractmethod
    def plain(self) -> dict[str, Any]:
        """Return what JSON holds (docs/json.md): mappings, lists, text and finite numbers."""

    @property
    def exit_status(self) -> int:
        """Of the command: 0 for success."""
        return 0

    def __repr__(self) -> str:
        text = next((line for line in self.lines() if isinstance(line, str)), "")
        return f"<{type(self).__name__}: {text}>"

    def _repr_html_(self) -> str:
        """Return what a notebook shows."""
        return "".join(
            f"<p>{escape(line)}</p>" if isinstance(line, str) else _html(line) for line in self.lines()
        )


@dataclass(frozen=True, eq=False, repr=False)
class Result(Printed):
    """The result of a command that writes a report.

    Attributes:
        result: the numbers.
        page: the report, with its tables by name in `page.tables`.
        out: the folder of the report; None: nothing is written.
    """

    result: Any
    page: "Page"
    out: Path | None

    @property
    def table(self) -> "Table":
        """The first table of the report."""
        return next(iter(self.page.tables.values()))

    @property
    def written(self) -> list[str]:
        """The report's file, if there is one."""
        return [] if self.out is None else [str(self.out / f"{self.page.name}.html")]

    def write(self) -> Self:
        """Write the report.

        Raises:
            RunError: the folder cannot be written.
        """
        if self.out is not None:
            from hydroid.reporting.page_file import write_page

            write_page(self.page, self.out)
        return self


@dataclass(frozen=True, eq=False, repr=False)
class Files(Printed):
    """Files that a command has written.

    Attributes:
        content: what JSON holds of them.
        text: what a terminal shows.
    """

    content: Mapping[str, Any]
    text: tuple[str, ...] = ()

    def lines(self) -> "list[Table | str]":
        """Return the text."""
        return [*self.text]

    def plain(self) -> dict[str, Any]:
        """Return the content."""
        return dict(self.content)


def as_path(out: str | Path | None) -> Path | None:
    """Return the folder or file to write to."""
    return None if out is None else Path(out)


def rows(table: "Table", *keys: str) -> list[dict[str, Any]]:
    """Return a table's rows by key."""
    return [dict(zip(keys, row.values(), strict=True)) for row in table.records()]


def _html(table: "Table") -> str:
    from hydroid.reporting.table import shown

    cells = "".join(f"<th>{escape(name)}</th>" for name in table.header)
    body = "".join(
        f"<tr>{''.join(f'<td>{escape(shown(cell))}</td>' for cell in row)}</tr>" for row in table.rows
    )
    return f"<table><caption>{escape(table.title)}</caption><tr>{cells}</tr>{body}</table>"
