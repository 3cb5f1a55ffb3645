"""The layout of a CSV file, recognised by its first lines: separator, names, units.

Loggers write a preamble above the names, or a row of units below them. The data begin
with the first line that has a number in the first column of numbers, and half as many
as most lines; the names stand above it. A line below the names is left out only if it
holds no number: any other fault there is a fault of the data.
"""

import csv
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

from hydroid.arrays import record
from hydroid.errors import LogError
from hydroid.log.table import clock, number
from hydroid.units import bare, unit_of
from hydroid.words import listed

_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")
SEPARATORS = "\t;,| "
# a longer cell is no number, which is said, with its place
csv.field_size_limit(2**31 - 1)

Rows = Mapping[int, Sequence[str]]
"""cells of lines, by the number of the line [1-based]"""


@record
class CsvLayout:
    """How the lines of a CSV file are read.

    Attributes:
        separator: between the cells of a line.
        header: line of the names [1-based].
        names: of the columns, in order; "" for one without.
        width: how many cells a line has: as many as names, or fewer.
        text_lines: lines of text below the names, which hold no data.
        units: that a line below the names gives to columns, by name.
        remarks: what is left out, and what is unusual.
        quoted_commas: whether commas within quotes are decimal ones, where others part
            the cells.
    """

    separator: str
    header: int
    names: Sequence[str]
    width: int
    text_lines: Sequence[int]
    units: Mapping[str, str]
    remarks: Sequence[str]
    quoted_commas: bool = False

    def has_decimal_commas(self, line: str) -> bool:
        """Return whether a line holds commas that part no cells."""
        if self.separator == ",":
            return self.quoted_commas and '"' in line
        return "," in line

    def cells(self, line: str) -> list[str]:
        """Return as many cells of a line as there are names.

        All are empty where the line has fewer or more, as a torn one has.
        """
        # not by has_decimal_commas(): a call takes longer, and every line comes here
        if self.separator != "," and "," in line:
            line = line.replace(",", ".")
        cells = split(line, self.separator)
        if self.quoted_commas:
            cells = [cell.replace(",", ".") for cell in cells]
        count = len(self.names)
        if len(cells) == self.width < count:
            return cells + [""] * (count - self.width)
        if len(cells) < count or any(cells[count:]):
            return [""] * count
        return cells[:count]


def find_csv_layout(sample: Mapping[int, str], path: Path) -> CsvLayout:
    """Return the layout of a file from its first lines with content, by their numbers.

    Raises LogError: no line holds names, or there is one column only.
    """
    separator = _find_separator([*sample.values()])
    rows = {line: split(text, separator) for line, text in sample.items()}
    header, text_lines = _find_header(rows)
    names = rows[header]
    _refuse_no_names(names, header, path)

    remarks = list[str]()
    if next(iter(sample)) < header:
        above = f"the names are in line {header}; what stands above is left out"
        remarks.append(above)
    units = dict[str, str]()
    for line in text_lines:
        remarks.append(f"line {line} is text and left out")
        if _are_units(rows[line]):
            units.update(zip(names, map(bare, rows[line]), strict=True))

    data = [rows[k] for k in rows if k > header and k not in text_lines]
    width = _usual_width(data, len(names))
    if width < len(names):
        nameless = listed(names[width:], 3)
        remarks.append(f"lines hold {width} cells: {nameless} has none")
    elif width > len(names):
        remarks.append("the first column has no name")
        names = ["", *names]
    return CsvLayout(
        separator=separator,
        header=header,
        names=names,
        width=width,
        text_lines=text_lines,
        units=units,
        remarks=remarks,
        quoted_commas=separator == "," and _have_quoted_commas(data),
    )


def _have_quoted_commas(rows: Sequence[Sequence[str]]) -> bool:
    """Return whether commas in cells, which quotes keep together, are decimal ones: no
    number has a point, and not all of them can be those of thousands."""
    numbers = [cell for row in rows for cell in row if _decimal(cell) is not None]
    with_comma = [cell for cell in numbers if "," in cell]
    if not with_comma or any("." in cell for cell in numbers):
        return False
    return not all(map(_THOUSANDS.fullmatch, with_comma))


def split(line: str, separator: str) -> list[str]:
    """Return the cells of a line. Any number of spaces parts columns of spaces."""
    spaces = separator == " "
    # the library is slower, and only needed for separators within quotes
    if '"' in line:
        line = line.strip() if spaces else line
        cells = next(csv.reader([line], delimiter=separator, skipinitialspace=spaces))
    else:
        cells = line.split(None if spaces else separator)
    return [cell.strip() for cell in cells]


def is_content(line: str, separator: str = ",") -> bool:
    """Return whether a line holds names or data.

    Blank lines, empty cells, comments, and a line that names the separator do not.
    """
    begin = line.strip(" \t" + separator)[:1]
    return begin not in ("", "#") and not line.startswith("sep=")


def _refuse_no_names(names: Sequence[str], header: int, path: Path) -> None:
    numbers = [_decimal(name) for name in names if name]
    if None not in numbers:
        hint = (
            "write the columns' names above it (a line that starts with # is a comment)"
        )
        where = f"{path}, line {header}"
        raise LogError("has no header: this line holds numbers", where, hint)
    if len(names) == 1:
        hint = "part cells by , ; | tabs or spaces"
        raise LogError("has one column only", path, hint)


def _find_separator(lines: Sequence[str]) -> str:
    """Return what parts most lines into the same number of numbers, or else parts any
    line at all."""

    def merit(separator: str) -> tuple[int, bool, int]:
        rows = [split(line, separator) for line in lines]
        counts = Counter[int]()
        for row in rows:
            # a line that is not parted at all says nothing for the separator
            parted = len(row) > 1
            counts[len(_number_cells(row)) if parted else 0] += 1
        most = max(numbers * times for numbers, times in counts.items())
        # spaces stand in names and around other separators, too
        return most, separator != " ", max(map(len, rows))

    return max(SEPARATORS, key=merit)


def _find_header(rows: Rows) -> tuple[int, list[int]]:
    """Return the line of names, and the lines of text between it and the data."""
    number_cells = {line: _number_cells(row) for line, row in rows.items()}
    usual = _usual_cells([*number_cells.values()])
    first = _first_data_line(number_cells, usual)
    texts = dict[int, list[str]]()
    for line, row in rows.items():
        if line < first and not number_cells[line]:
            filled = [*filter(None, row)]
            if len(filled) >= max(len(usual) / 2, 1):
                texts[line] = filled

    def merit(line: int) -> tuple[bool, int, int]:
        """Names differ, are many, and stand below other texts."""
        differ = len({*texts[line]}) == len(texts[line])
        return differ, len(texts[line]), line

    named = [line for line in texts if not _are_units(texts[line])]
    header = max(named or texts, key=merit, default=next(iter(rows)))
    below = list[int]()
    for line in texts:
        if line > header and len(rows[line]) == len(rows[header]):
            below.append(line)
    return header, below


def _usual_cells(number_cells: Sequence[tuple[int, ...]]) -> tuple[int, ...]:
    """Return which cells of most lines hold numbers, where lines of many count more."""
    lines = Counter(map(len, number_cells))
    usual = max(lines, key=lambda count: (count * lines[count], count))
    alike = Counter(cells for cells in number_cells if len(cells) == usual)
    ((cells, _),) = alike.most_common(1)
    return cells


def _first_data_line(
    number_cells: Mapping[int, tuple[int, ...]], usual: tuple[int, ...]
) -> int:
    """Return the first line with data; the one after the last where none has any."""
    for line, cells in number_cells.items():
        if usual and usual[0] in cells and 2 * len(cells) >= len(usual):
            return line
    return max(number_cells) + 1


def _usual_width(rows: Sequence[Sequence[str]], names: int) -> int:
    """Return how many cells lines have, where that is not as many as names: fewer, or a
    row's number more.

    Lines that differ from each other are torn ones, but for separators at their ends.
    """
    # a single line may be a torn one itself
    widths = {len(row) for row in rows}
    if len(rows) < 2 or len(widths) > 1:
        return names
    (width,) = widths
    if width == names + 1 and _are_numbered(rows):
        return width
    # with half of the cells or fewer it is rather the names that are wrong
    if names // 2 < width < names:
        return width
    return names


def _are_numbered(rows: Sequence[Sequence[str]]) -> bool:
    """Return whether each row begins with its number, and no last cell is empty."""
    numbers = [number(row[0]) for row in rows]
    for first, second in pairwise(numbers):
        if first is None or second != first + 1:
            return False
    return all(row[-1] for row in rows)


def _number_cells(row: Sequence[str]) -> tuple[int, ...]:
    """Return which cells hold a number, maybe with a decimal comma, or a time."""
    cells = list[int]()
    for position, cell in enumerate(row):
        if _decimal(cell) is not None or clock(cell) is not None:
            cells.append(position)
    return tuple(cells)


def _decimal(cell: str) -> float | None:
    """Return the number in a cell, maybe with a decimal comma."""
    return number(cell.replace(",", "."))


def _are_units(row: Sequence[str]) -> bool:
    return any(row) and all(map(unit_of, filter(None, row)))
