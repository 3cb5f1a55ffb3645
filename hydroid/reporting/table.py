"""A table for readers (terminal, page) and for scripts (CSV, JSON)."""

import csv
import io
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from hydroid.arrays import Array
from hydroid.words import number, plain

if TYPE_CHECKING:
    import rich.table

Cell = str | int | float | None
"""text, a count, a measured number, or nothing"""


class Given(float):
    """A number from the user, such as a bound: it is shown as given, not rounded to four digits."""


@dataclass(frozen=True)
class Table:
    """A table; each row has one cell per column of the header.

    Attributes:
        title: above the table.
        header: names of the columns.
        rows: the cells.
        note: below the table.
        optional: columns that a narrow terminal leaves out, the least important first.
    """

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""
    optional: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        title: str,
        columns: Mapping[str, str],
        rows: Iterable[Mapping[str, Any]],
        note: str = "",
        optional: tuple[str, ...] = (),
    ) -> "Table":
        """Return a table of rows by key; `columns` are the keys that are shown, and the columns' names."""
        cells = tuple(tuple(row.get(key) for key in columns) for row in rows)
        return cls(title, tuple(columns.values()), cells, note, optional)

    def csv(self) -> str:
        """Return header and rows with every bit of the numbers, without title and note."""
        buffer = io.StringIO()
        csv.writer(buffer, lineterminator="\n").writerows([self.header, *self.rows])
        return buffer.getvalue()

    def show(self) -> None:
        """Print the table within the width of the terminal or of COLUMNS; elsewhere lines have any length.

        Columns of text wrap at words. Where that does not suffice, `optional` columns are left out and named
        below the table.
        """
        from rich.console import Console

        console, endless = Console(), Console(width=1000)
        limited = console.is_terminal or os.environ.get("COLUMNS", "").isdigit()
        width = console.width if limited else endless.width
        table, needed = self._rich(()), 0
        for left_out in range(len(self.optional) + 1):
            table = self._rich(self.optional[:left_out])
            needed = table.__rich_measure__(endless, endless.options).minimum
            if needed <= width:
                break
        # width and height, or rich may take 80 columns for granted
        Console(width=max(width, needed), height=1).print(table)

    @property
    def shown(self) -> list[list[str]]:
        """The text of each cell for a reader."""
        return [[shown(cell) for cell in row] for row in self.rows]

    @cached_property
    def numeric(self) -> tuple[bool, ...]:
        """Columns that hold numbers only."""
        columns = list(zip(*self.rows, strict=True)) or [()] * len(self.header)
        kinds = ({type(cell) for cell in column if cell is not None} for column in columns)
        return tuple(bool(kind) and str not in kind for kind in kinds)

    def _rich(self, left_out: Sequence[str]) -> "rich.table.Table":
        """Return the table for a terminal; headers of numbers are broken into words."""
        from rich import box
        from rich.table import Table as RichTable
        from rich.text import Text

        note = f"{self.note} Left out for width: {', '.join(left_out)}." if left_out else self.note
        # Text, not str: rich would read [deg] as markup
        table = RichTable(title=Text(self.title), caption=Text(note) if note else None, box=box.SIMPLE_HEAD)
        table.padding, table.pad_edge, table.show_edge = (0, 1, 0, 0), False, False
        table.title_justify = table.caption_justify = "left"
        kept = [i for i, name in enumerate(self.header) if name not in left_out]
        for i in kept:
            name, right = self.header[i], self.numeric[i]
            widest = max(map(len, (name, *(row[i] for row in self.shown))))
            table.add_column(
                Text(name.replace(" ", "\n") if right else name),
                justify="right" if right else "left",
                no_wrap=right,  # rich wraps words where room is short, but never numbers
                min_width=None if right else min(widest, 18),  # before that optional columns go
                overflow="fold",
            )
        for row in self.shown:
            table.add_row(*(Text(row[i]) for i in kept))
        return table


def numbers_csv(header: Sequence[str], rows: Array) -> str:
    """Return an array of shape (n, m) as CSV with every bit of the numbers."""
    return Table("", tuple(header), tuple(map(tuple, rows.tolist()))).csv()


def shown(cell: Cell) -> str:
    """Return the text of a cell for a reader."""
    if isinstance(cell, float):
        return plain(cell) if isinstance(cell, Given) else number(cell)
    return "" if cell is None else str(cell)
