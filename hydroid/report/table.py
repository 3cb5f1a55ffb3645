"""A table and its four faces: CSV for scripts, Markdown, LaTeX, and the terminal."""

import csv
import io
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import rich.table


class Given(float):
    """A number that the user has given, such as a bound: shown as given, not rounded to four digits."""


Cell = str | int | float | None
"""Text, count, measured number, or nothing."""


_NO_LIMIT = 1000


@dataclass(frozen=True)
class Table:
    """A table; each row has a cell for each column of the header."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""

    def csv(self) -> str:
        """Header and rows, numbers to their last bit; title and note are for readers and left out."""
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        writer.writerow(self.header)
        writer.writerows([exact(cell) for cell in row] for row in self.rows)
        return buffer.getvalue()

    def markdown(self) -> str:
        """Title, pipe table, note; numbers right-aligned."""
        ruler = ["---:" if right else "---" for right in self.numeric]
        lines = [[_markdown(name) for name in self.header], ruler]
        lines += [[_markdown(shown(cell)) for cell in row] for row in self.rows]
        body = "\n".join(f"| {' | '.join(line)} |" for line in lines)
        note = f"\n\n{_markdown(self.note)}" if self.note else ""
        return f"**{_markdown(self.title)}**\n\n{body}{note}\n"

    def latex(self) -> str:
        """A `table` environment that needs no package."""
        columns = "".join("r" if right else "l" for right in self.numeric)
        rows = [" & ".join(_latex(shown(cell)) for cell in row) + r" \\" for row in self.rows]
        note = [r"\par\smallskip\footnotesize " + _latex(self.note)] if self.note else []
        head = " & ".join(map(_latex, self.header)) + r" \\"
        lines = [
            r"\begin{table}",
            r"\centering",
            rf"\caption{{{_latex(self.title)}}}",
            rf"\begin{{tabular}}{{{columns}}}",
            *(r"\hline", head, r"\hline", *rows, r"\hline"),
            r"\end{tabular}",
            *note,
            r"\end{table}",
        ]
        return "\n".join(lines) + "\n"

    def rich_table(self, narrow: bool = False) -> "rich.table.Table":
        """The table for a terminal; a narrow one has less space between columns and headers word by word."""
        from rich import box
        from rich.table import Table as RichTable
        from rich.text import Text

        # Text, not str: rich would read [deg] as markup
        caption = Text(self.note) if self.note else None
        table = RichTable(title=Text(self.title), caption=caption, box=box.SIMPLE_HEAD)
        table.padding, table.pad_edge, table.show_edge = (0, 0 if narrow else 1, 0, 0), False, False
        table.title_justify = table.caption_justify = "left"
        for name, right in zip(self.header, self.numeric, strict=True):
            header = Text(name.replace(" ", "\n") if right and narrow else name)
            # where room is short rich takes it from columns that may wrap: never from numbers
            table.add_column(header, justify="right" if right else "left", overflow="fold", no_wrap=right)
        for row in self.rows:
            table.add_row(*(Text(shown(cell)) for cell in row))
        return table

    def show(self) -> None:
        """Print the table: as wide as the terminal where it fits, and on lines of any length elsewhere."""
        from rich.console import Console

        console = Console()
        width = console.width if console.is_terminal else _NO_LIMIT
        narrow = width < sum(self._widths(len)) + 2 * len(self.header)
        if narrow:
            width = max(width, sum(self._widths(_longest_word)) + len(self.header))
        # width and height, or rich may take 80 columns for granted
        Console(width=width, height=1).print(self.rich_table(narrow))

    def records(self) -> list[dict[str, str | int | float | None]]:
        """Rows by column name for JSON, which has no NaN or infinity: these become None."""
        return [
            {
                name: None if isinstance(c, float) and not math.isfinite(c) else c
                for name, c in zip(self.header, row, strict=True)
            }
            for row in self.rows
        ]

    @property
    def numeric(self) -> tuple[bool, ...]:
        """Columns that hold numbers only."""
        columns = zip(*self.rows, strict=True) if self.rows else ((None,) for _ in self.header)
        return tuple(
            any(isinstance(c, int | float) for c in column) and not any(isinstance(c, str) for c in column)
            for column in columns
        )

    def _widths(self, measure: Callable[[str], int]) -> list[int]:
        """Width of each column where `measure` says what a header, or a cell of words, needs."""
        return [
            max([measure(name), *((len if right else measure)(shown(row[i])) for row in self.rows)])
            for i, (name, right) in enumerate(zip(self.header, self.numeric, strict=True))
        ]


def _longest_word(text: str) -> int:
    return max(map(len, text.split()), default=0)


def shown(cell: Cell) -> str:
    """Return the text of a cell for a reader."""
    if cell is None:
        return ""
    if isinstance(cell, Given):
        return plain(cell)
    return number(cell) if isinstance(cell, float) else str(cell)


def exact(cell: Cell) -> str:
    """Return the text of a cell from which the same number is read back."""
    if cell is None:
        return ""
    return repr(float(cell)) if isinstance(cell, float) else str(cell)


def known(value: float) -> float | None:
    """A number, or nothing where it is NaN; one without limit stays."""
    return None if math.isnan(value) else float(value)


def number(value: float) -> str:
    """Four significant digits, no exponent between 0.0001 and ten million; a dash where it is not finite."""
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    scientific = f"{value:.3e}"
    exponent = int(scientific.partition("e")[2])  # of the rounded value: 0.99999 is 1.000, not 1.0000
    return f"{float(scientific):.{max(0, 3 - exponent)}f}" if -4 <= exponent < 7 else scientific


def plain(value: float) -> str:
    """Six significant digits, without zeros that say nothing."""
    if not math.isfinite(value):
        return "–"
    text = f"{value:.6g}"
    return f"{float(text):.0f}" if "e+" in text and abs(value) < 1e9 else text


_MARKDOWN = {ord(c): f"\\{c}" for c in r"\`*_<>|&$~"} | {ord(c): " " for c in "\r\n"}
_LATEX = str.maketrans(
    {c: f"\\{c}" for c in "&%$#_{}"}
    | {
        "\\": r"\textbackslash{}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "<": r"\textless{}",
        ">": r"\textgreater{}",
        "|": r"\textbar{}",
        "·": r"\(\cdot\)",
        "²": r"\(^2\)",
        "×": r"\(\times\)",
        "–": "--",
        "\n": " ",
        "\r": " ",
    }
)


def _markdown(text: str) -> str:
    # ]( is what makes a link of a bracket
    return text.translate(_MARKDOWN).replace("](", r"\](").replace("][", r"\][")


def _latex(text: str) -> str:
    safe = text.translate(_LATEX)
    return (
        f"{{{safe[0]}}}{safe[1:]}" if safe.startswith(("[", "*")) else safe
    )  # else an option of the \\ before it
