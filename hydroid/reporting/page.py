"""A report as data: tables for readers and scripts, sections, charts, steps.

`page_file` writes it.
"""

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydroid.arrays import record
from hydroid.files import csv_text
from hydroid.findings import Finding
from hydroid.words import numbered, plain, three_digits

if TYPE_CHECKING:
    import rich.table

FIGURE_SPACE, POINT_SPACE = "\u2007", "\u2008"
"""blanks as wide as a digit and as a point"""
_NUMBER = re.compile(r"([-−]?\d+)(\.\d+)?(?= |$)")
SHORT = 20
"""letters of a cell up to which it stands in one line"""
Cell = str | int | float | None  # text, a count, a measured number, or nothing


class Given(float):
    """A number from the user, such as a bound: it is shown as given, not rounded to
    three digits."""


@record
class Table:
    """A table; each row has one cell per column of the header.

    The note stands below it. A narrow terminal leaves out `optional` columns, the least
    important first.
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
        """Return a table of rows by key.

        `columns` are the keys that are shown, and the columns' names.
        """
        cells = tuple(tuple(row.get(key) for key in columns) for row in rows)
        return cls(title, tuple(columns.values()), cells, note, optional)

    def csv(self) -> str:
        """Return header and rows with every bit of the numbers, without title and
        note."""
        return csv_text([self.header, *self.rows])

    def show(self) -> None:
        """Print the table within the width of the terminal or of COLUMNS.

        Elsewhere lines have any length.

        Columns of text wrap at words. Where that does not suffice, `optional` columns
        are named below it instead.
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

    def aligned(
        self, digit: str = FIGURE_SPACE, point: str = POINT_SPACE
    ) -> list[list[str]]:
        """Return `shown` with numbers under each other at the point.

        The blanks are as wide as a digit and a point. A column of text is aligned where
        each of its cells begins with a number.
        """
        columns = list[list[str]]()
        for i, right in enumerate(self.numeric):
            cells = [row[i] for row in self.shown]
            columns.append(_aligned(cells, digit, point, right=right))
        return [list(row) for row in zip(*columns, strict=True)]

    @cached_property
    def numeric(self) -> tuple[bool, ...]:
        """Columns that hold numbers only."""
        kinds = ({type(row[i]) for row in self.rows} for i in range(len(self.header)))
        return tuple(bool(kind) and str not in kind for kind in kinds)

    @cached_property
    def short(self) -> tuple[bool, ...]:
        """Columns of text whose cells are too short to be broken into lines."""
        columns = (
            zip(*self.shown, strict=True) if self.rows else [()] * len(self.header)
        )
        return tuple(max(map(len, column), default=0) <= SHORT for column in columns)

    def _rich(self, left_out: Sequence[str]) -> "rich.table.Table":
        """Return the table for a terminal; headers of numbers are broken into words."""
        from rich import box
        from rich.table import Table as RichTable
        from rich.text import Text

        note = (
            f"{self.note} Left out for width: {', '.join(left_out)}."
            if left_out
            else self.note
        )
        # Text, not str: rich would read [deg] as markup
        table = RichTable(
            title=Text(self.title),
            caption=Text(note) if note else None,
            box=box.SIMPLE_HEAD,
        )
        table.padding, table.pad_edge, table.show_edge = (0, 1, 0, 0), False, False
        table.title_justify = table.caption_justify = "left"
        kept = [i for i, name in enumerate(self.header) if name not in left_out]
        for i in kept:
            name, right = self.header[i], self.numeric[i]
            widest = max(map(len, (name, *(row[i] for row in self.shown))))
            table.add_column(
                Text(name.replace(" ", "\n") if right else name),
                justify="right" if right else "left",
                # rich wraps words where room is short, but never numbers
                no_wrap=right,
                # before that optional columns go
                min_width=None if right else min(widest, 18),
                overflow="fold",
            )
        for row in self.aligned(" ", " "):
            table.add_row(*(Text(row[i]) for i in kept))
        return table


def _aligned(cells: list[str], digit: str, point: str, *, right: bool) -> list[str]:
    """Return the cells of a column, which stands at the `right` or left, with their
    numbers at the point.
    """
    numbers = [_NUMBER.match(cell) for cell in cells]
    if not right and any(
        cell and not number for cell, number in zip(cells, numbers, strict=True)
    ):
        return cells
    parts = [number.groups("") if number else ("", "") for number in numbers]
    widest = max((len(whole) for whole, _ in parts), default=0)
    longest = max((len(rest) for _, rest in parts), default=0)
    result = list[str]()
    for cell, (whole, rest) in zip(cells, parts, strict=True):
        if not right:
            result.append(digit * (widest - len(whole)) + cell if cell else cell)
        elif rest or not longest:
            result.append(cell + digit * (longest - len(rest)))
        else:
            result.append(cell + point + digit * (longest - 1) if whole else cell)
    return result


def shown(cell: Cell) -> str:
    """Return the text of a cell for a reader."""
    if isinstance(cell, float):
        return plain(cell) if isinstance(cell, Given) else three_digits(cell)
    return "" if cell is None else str(cell)


@record
class Plot:
    """A figure: its name on the page, what it shows in words, and the function that
    makes it.

    That returns a `Chart`, which the page shows with buttons to zoom it if `zoom`, or a
    `MovingArm`. Of several figures of which a reader sees one at a time, `button`
    chooses it. The button stands in a `row` and a `column`, where these are given; its
    `state` (`good`, `fair`, `bad`) gives the colour.
    """

    name: str
    caption: str
    draw: Callable[[], Any]
    zoom: bool = False
    button: str = ""
    row: str = ""
    column: str = ""
    state: str = ""


@record
class Section:
    """A heading with text, points to note, tables by file name, and figures.

    Folded sections open on demand.

    Of the figures `beside`, which a note explains, the one of the row of the chosen tab
    is shown. A folded section says its `answer` beside its heading, and stands on paper
    if it is `printed`. `steps` are findings that say what to do and what it would
    bring; their number `command` does it. `cards` are small tables side by side.
    """

    title: str
    text: str = ""
    points: tuple[str, ...] = ()
    tables: Mapping[str, Table] = field(default_factory=dict[str, Table])
    cards: Mapping[str, Table] = field(default_factory=dict[str, Table])
    plots: tuple[Plot, ...] = ()
    tabs: tuple[Plot, ...] = ()
    beside: tuple[Plot, ...] = ()
    beside_note: str = ""
    steps: tuple[Finding, ...] = ()
    folded: bool = False
    answer: str = ""
    printed: bool = False


@record
class Page:
    """A report: the answer in a sentence, `lead`, and its sections.

    Its file has the `name`, and an ending.

    `warnings` must be read before using the answer, and stand behind the first section.
    What the page was `made_from` and `versions` of the software stand at the foot.
    `data` are further files by name, such as CSV for scripts; `files` are tables that
    stand in files alone, in place of shorter ones of their names.
    """

    name: str
    title: str
    lead: str
    sections: tuple[Section, ...]
    warnings: tuple[str, ...]
    versions: Mapping[str, str] = field(default_factory=dict[str, str])
    data: Mapping[str, str] = field(default_factory=dict[str, str])
    files: Mapping[str, Table] = field(default_factory=dict[str, Table])
    made_from: tuple[str, ...] = ()

    @property
    def plots(self) -> Iterator[Plot]:
        """All figures."""
        for section in self.sections:
            yield from (*section.plots, *section.tabs, *section.beside)

    @property
    def tables(self) -> dict[str, Table]:
        """All tables by file name."""
        tables = dict[str, Table]()
        for section in self.sections:
            tables |= {**section.tables, **section.cards}
        return tables | dict(self.files)


def log_names(sources: Iterable[str]) -> dict[str, str]:
    """Return short names of logs, all different, by their sources."""
    sources = list(sources)
    return dict(
        zip(
            sources,
            numbered(short_name(Path(s).name or s) for s in sources),
            strict=True,
        )
    )


def short_name(name: str) -> str:
    """Return a name with unprintable characters replaced and the middle of one over 40
    letters left out.
    """
    text = "".join(c if c.isprintable() else "?" for c in name)
    return text if len(text) <= 40 else f"{text[:19]}…{text[-20:]}"
