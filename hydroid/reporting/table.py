"""A table for readers (terminal, Markdown, LaTeX, page) and for scripts (CSV, JSON)."""

import csv
import io
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from hydroid.parameters import Array
from hydroid.words import number, plain

if TYPE_CHECKING:
    import rich.table

Cell = str | int | float | None
"""Text, a count, a measured number, or nothing."""

_UNLIMITED = 1000
_TEXT_WIDTH = 18
"""width below which a column of text is not squeezed while optional columns can be left out"""


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
        cls, title: str, rows: Iterable[Mapping[str, Cell]], note: str = "", optional: tuple[str, ...] = ()
    ) -> "Table":
        """Return a table of rows by column name, of which there is at least one."""
        first, *others = rows
        return cls(
            title, tuple(first), tuple(tuple(row.values()) for row in (first, *others)), note, optional
        )

    def csv(self) -> str:
        """Return header and rows with every bit of the numbers, without title and note."""
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        writer.writerow(self.header)
        # a Given is a float: its repr would be its class's
        writer.writerows(
            [repr(float(cell)) if isinstance(cell, float) else cell for cell in row] for row in self.rows
        )
        return buffer.getvalue()

    def markdown(self) -> str:
        """Return title, pipe table and note; numbers are right-aligned."""
        lines = [map(_markdown, self.header), ("---:" if right else "---" for right in self.numeric)]
        lines += [[_markdown(shown(cell)) for cell in row] for row in self.rows]
        body = "\n".join(f"| {' | '.join(line)} |" for line in lines)
        note = f"\n\n{_markdown(self.note)}" if self.note else ""
        return f"**{_markdown(self.title)}**\n\n{body}{note}\n"

    def latex(self) -> str:
        """Return a `table` environment that needs no package."""
        columns = "".join("r" if right else "l" for right in self.numeric)
        head, *rows = (
            " & ".join(_latex(shown(cell)) for cell in row) + r" \\" for row in (self.header, *self.rows)
        )
        lines = [
            *(r"\begin{table}", r"\centering", rf"\caption{{{_latex(self.title)}}}"),
            *(rf"\begin{{tabular}}{{{columns}}}", r"\hline", head, r"\hline", *rows, r"\hline"),
            r"\end{tabular}",
            *([r"\par\smallskip\footnotesize " + _latex(self.note)] if self.note else []),
            r"\end{table}",
        ]
        return "\n".join(lines) + "\n"

    def show(self) -> None:
        """Print the table within the width of the terminal or of COLUMNS; elsewhere lines have any length.

        Columns of text wrap at words. Where that does not suffice, `optional` columns are left out and named
        below the table.
        """
        from rich.console import Console

        console = Console()
        limited = console.is_terminal or os.environ.get("COLUMNS", "").isdigit()
        width = console.width if limited else _UNLIMITED
        left_out = 0
        while left_out < len(self.optional) and self._least_width(left_out) > width:
            left_out += 1
        # width and height, or rich may take 80 columns for granted
        console = Console(width=max(width, self._least_width(left_out)), height=1)
        console.print(self._rich(left_out, console.width))

    def records(self) -> list[dict[str, str | int | float | None]]:
        """Return rows by column name for JSON, which has no NaN or infinity: these become None."""
        return [
            {
                name: None if isinstance(c, float) and not math.isfinite(c) else c
                for name, c in zip(self.header, row, strict=True)
            }
            for row in self.rows
        ]

    @cached_property
    def numeric(self) -> tuple[bool, ...]:
        """Columns that hold numbers only."""
        columns = zip(*self.rows, strict=True) if self.rows else ((None,) for _ in self.header)
        return tuple(
            any(isinstance(c, int | float) for c in column) and not any(isinstance(c, str) for c in column)
            for column in columns
        )

    def _rich(self, left_out: int, width: int) -> "rich.table.Table":
        """Return the table for a terminal without the first columns of `optional`."""
        from rich import box
        from rich.table import Table as RichTable
        from rich.text import Text

        missing = self.optional[:left_out]
        note = f"{self.note} Left out for width: {', '.join(missing)}." if missing else self.note
        # Text, not str: rich would read [deg] as markup
        table = RichTable(title=Text(self.title), caption=Text(note) if note else None, box=box.SIMPLE_HEAD)
        table.padding, table.pad_edge, table.show_edge = (0, 1, 0, 0), False, False
        table.title_justify = table.caption_justify = "left"
        kept = [i for i, name in enumerate(self.header) if name not in missing]
        tight = sum(self._width(i, wrap=False) for i in kept) + 2 * len(kept) > width
        for i in kept:
            name, right = self.header[i], self.numeric[i]
            header = Text(name.replace(" ", "\n") if right and tight else name)
            # rich wraps words where room is short, but never numbers
            least = max(
                self._width(i, wrap=True), 0 if right else min(self._width(i, wrap=False), _TEXT_WIDTH)
            )
            table.add_column(
                header, justify="right" if right else "left", no_wrap=right, min_width=least, overflow="fold"
            )
        for row in self.rows:
            table.add_row(*(Text(shown(row[i])) for i in kept))
        return table

    def _least_width(self, left_out: int) -> int:
        """Return the width at which words and numbers are whole and text does not stand word by word."""
        kept = [i for i, name in enumerate(self.header) if name not in self.optional[:left_out]]
        room = (0 if self.numeric[i] else min(self._width(i, wrap=False), _TEXT_WIDTH) for i in kept)
        return sum(max(self._width(i, wrap=True), r) + 2 for i, r in zip(kept, room, strict=True))

    def _width(self, i: int, *, wrap: bool) -> int:
        """Return the width of a column, with text and header on one line or wrapped at words."""
        words = (self.header[i], *(shown(row[i]) for row in self.rows if not self.numeric[i]))
        numbers = (shown(row[i]) for row in self.rows if self.numeric[i])
        texts = [word for text in words for word in text.split()] if wrap else words
        return max(map(len, (*texts, *numbers)), default=0)


def numbers_csv(header: Sequence[str], rows: Array) -> str:
    """Return an array of shape (n, m) as CSV with every bit of the numbers."""
    return Table("", tuple(header), tuple(tuple(map(float, row)) for row in rows)).csv()


def shown(cell: Cell) -> str:
    """Return the text of a cell for a reader."""
    if cell is None:
        return ""
    if isinstance(cell, Given):
        return plain(cell)
    return number(cell) if isinstance(cell, float) else str(cell)


_MARKDOWN = {ord(c): f"\\{c}" for c in r"\`*_<>|&$~"} | {ord(c): " " for c in "\r\n"}
_LATEX = str.maketrans(
    {c: f"\\{c}" for c in "&%$#_{}"}
    | {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
    | {"<": r"\textless{}", ">": r"\textgreater{}", "|": r"\textbar{}"}
    | {"·": r"\(\cdot\)", "²": r"\(^2\)", "×": r"\(\times\)", "–": "--", "\n": " ", "\r": " "}
)


def _markdown(text: str) -> str:
    # ]( and ][ make a link of a bracket
    return text.translate(_MARKDOWN).replace("](", r"\](").replace("][", r"\][")


def _latex(text: str) -> str:
    safe = text.translate(_LATEX)
    # [ or * after a line break \\ would be its option
    return f"{{{safe[0]}}}{safe[1:]}" if safe.startswith(("[", "*")) else safe
