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

FIGURE_SPACE = "\u2007"
"""blank as wide as a digit"""
POINT_SPACE = "\u2008"
"""blank as wide as a point"""
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

        console = Console()
        endless = Console(width=1000)
        width = endless.width
        if console.is_terminal or os.environ.get("COLUMNS", "").isdigit():
            width = console.width
        table = self._rich(())
        needed = 0
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
        for cells, numeric in zip(self._shown_columns, self.numeric, strict=True):
            if numeric:
                columns.append(_aligned_right(cells, digit, point))
            else:
                columns.append(_aligned_left(cells, digit))
        return [list(row) for row in zip(*columns, strict=True)]

    @property
    def _shown_columns(self) -> list[list[str]]:
        """The text of each cell for a reader, by columns."""
        cells = self.shown
        return [[row[i] for row in cells] for i in range(len(self.header))]

    @cached_property
    def numeric(self) -> tuple[bool, ...]:
        """Columns that hold numbers only."""
        return tuple(self._is_numeric(i) for i in range(len(self.header)))

    def _is_numeric(self, column: int) -> bool:
        kinds = {type(row[column]) for row in self.rows}
        return bool(kinds) and str not in kinds

    @cached_property
    def short(self) -> tuple[bool, ...]:
        """Columns of text whose cells are too short to be broken into lines."""
        columns = self._shown_columns
        return tuple(max(map(len, cells), default=0) <= SHORT for cells in columns)

    def _rich(self, left_out: Sequence[str]) -> "rich.table.Table":
        """Return the table for a terminal; headers of numbers are broken into words."""
        from rich import box
        from rich.table import Table as RichTable
        from rich.text import Text

        note = self.note
        if left_out:
            note = f"{note} Left out for width: {', '.join(left_out)}."
        # Text, not str: rich would read [deg] as markup
        table = RichTable(
            title=Text(self.title),
            caption=Text(note) if note else None,
            box=box.SIMPLE_HEAD,
            padding=(0, 1, 0, 0),
            pad_edge=False,
            show_edge=False,
            title_justify="left",
            caption_justify="left",
        )
        kept = [i for i, name in enumerate(self.header) if name not in left_out]
        columns = self._shown_columns
        for i in kept:
            name = self.header[i]
            if self.numeric[i]:
                # rich wraps words where room is short, but numbers must not wrap
                title = Text(name.replace(" ", "\n"))
                table.add_column(title, justify="right", no_wrap=True, overflow="fold")
                continue
            widest = max(len(text) for text in [name, *columns[i]])
            # text narrower than this is worth less than an optional column
            least = min(widest, 18)
            table.add_column(Text(name), min_width=least, overflow="fold")
        for row in self.aligned(" ", " "):
            table.add_row(*(Text(row[i]) for i in kept))
        return table


def _number_parts(cell: str) -> tuple[str, str]:
    """Return the digits of a number before and from the point on, with which a cell
    begins; both empty: it begins with none."""
    number = _NUMBER.match(cell)
    if number is None:
        return "", ""
    whole, fraction = number.groups("")
    return whole, fraction


def _aligned_right(cells: Sequence[str], digit: str, point: str) -> list[str]:
    """Return the cells of a column of numbers, which stands at the right, with their
    points below each other."""
    parts = [_number_parts(cell) for cell in cells]
    longest = max((len(fraction) for _, fraction in parts), default=0)
    aligned = list[str]()
    for cell, (whole, fraction) in zip(cells, parts, strict=True):
        blanks = ""
        if fraction or not longest:
            blanks = digit * (longest - len(fraction))
        elif whole:
            blanks = point + digit * (longest - 1)
        aligned.append(cell + blanks)
    return aligned


def _aligned_left(cells: Sequence[str], digit: str) -> list[str]:
    """Return the cells of a column of text, which stands at the left, with the numbers
    at their beginnings below each other; unchanged where a cell begins with none."""
    wholes = [_number_parts(cell)[0] for cell in cells]
    widest = max((len(whole) for whole in wholes), default=0)
    aligned = list[str]()
    for cell, whole in zip(cells, wholes, strict=True):
        if not cell:
            aligned.append(cell)
        elif not whole:
            return list(cells)
        else:
            aligned.append(digit * (widest - len(whole)) + cell)
    return aligned


def shown(cell: Cell) -> str:
    """Return the text of a cell for a reader."""
    if isinstance(cell, float):
        if isinstance(cell, Given):
            return plain(cell)
        return three_digits(cell)
    if cell is None:
        return ""
    return str(cell)


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
    make: Callable[[], Any]
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

    @property
    def chosen(self) -> Plot | None:
        """The tab that is open at first: where some rows have a figure beside them, the
        first tab of such a row."""
        rows = {plot.row for plot in self.beside}
        with_figure = (tab for tab in self.tabs if tab.row in rows)
        return next(with_figure, self.tabs[0] if self.tabs else None)


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
    names = [short_name(Path(source).name or source) for source in sources]
    return dict(zip(sources, numbered(names), strict=True))


def short_name(name: str) -> str:
    """Return a name with unprintable characters replaced and the middle of one over 40
    letters left out.
    """
    text = "".join(c if c.isprintable() else "?" for c in name)
    if len(text) <= 40:
        return text
    return f"{text[:19]}…{text[-20:]}"
