"""Where the table of a CSV file begins: its separator, and which lines hold names, units and neither.

Loggers write a preamble above the names, a row of units below them, or names in two rows (a group over each
name). The data begin with the first line that has a number in the first column of numbers, and half as many
as most lines. The row of names is sought above it; one that holds names of the settings is preferred. A line
below the names is left out only if it holds no number: any other fault there is a fault of the data.
"""

import csv
import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import islice

from hydroid.units import bare, unit_of

SAMPLE = 400
"""lines with content, from the first, that are searched"""
TIME = re.compile(
    r"(?:.*?[T ])?(\d{1,2}):(\d{2}):(\d{2})(?:[.,](\d{1,9})\d*)? *([AaPp])?\.?[Mm]?\.?(?:Z|[+-][\d:]+)?"
)
"""a time of day, with or without a date"""


@dataclass(frozen=True)
class Layout:
    """The separator; line [1-based] and cells of the names; units by name; other lines that hold no data."""

    separator: str
    header: int
    names: tuple[str, ...]
    units: dict[str, str]
    skipped: frozenset[int]
    remarks: tuple[str, ...]


def find_layout(lines: Sequence[str], wanted: Collection[str] = ()) -> Layout | None:
    """Find the table in the lines of a file; None where no line has content.

    Args:
        lines: all of them.
        wanted: names of columns that the settings ask for.
    """
    declared = re.fullmatch(r"sep=([,;\t|]) *", lines[0])
    start = 1 if declared else 0
    content = list(islice((i for i in range(start, len(lines)) if is_content(lines[i])), SAMPLE))
    if not content:
        return None
    separator = declared[1] if declared else _separator([lines[i] for i in content])
    rows = {i: [cell.strip() for cell in split(lines[i], separator)] for i in content}
    numbers = {i: [c for c, cell in enumerate(row) if _counts(cell, separator)] for i, row in rows.items()}
    usual = _usual([*map(len, numbers.values())])
    pattern = Counter(tuple(at) for at in numbers.values() if len(at) == usual).most_common(1)[0][0]
    enough = (i for i, at in numbers.items() if at and 2 * len(at) >= usual)
    first = next((i for i in enough if pattern and pattern[0] in numbers[i]), len(lines))
    above = [i for i in content if i < first]
    texts = [i for i in above if not numbers[i] and sum(map(bool, rows[i])) >= max(usual / 2, 1)]
    named = [i for i in texts if not _are_units(rows[i])] or texts
    if not named:
        return _commented(lines, first, separator, usual) or _layout(separator, content[0], rows, [], above)
    header, rows[header] = _names(named, rows, wanted)
    below = [i for i in texts if i > header and len(rows[i]) == len(rows[header])]
    return _layout(separator, header, rows, below, above)


def _names(
    named: Sequence[int], rows: dict[int, list[str]], wanted: Collection[str]
) -> tuple[int, list[str]]:
    """Choose the row of names: with most wanted names, then distinct, then most names, then the lowest."""
    choices = [(i, rows[i]) for i in named]
    for i in named:
        if not _distinct(rows[i]) and len(rows.get(i - 1, [])) == len(rows[i]):
            choices.append((i, _joined(rows[i - 1], rows[i])))

    def merit(choice: tuple[int, list[str]]) -> tuple[int, bool, int, int]:
        i, row = choice
        return len({*row} & {*wanted}), _distinct(row), sum(map(bool, row)), i

    return max(choices, key=merit)


def _layout(
    separator: str, header: int, rows: dict[int, list[str]], below: Sequence[int], above: Sequence[int]
) -> Layout:
    names, remarks = tuple(rows[header]), list[str]()
    of_units = [i for i in below if _are_units(rows[i])]
    pairs = [(name, bare(unit)) for i in of_units for name, unit in zip(names, rows[i], strict=False)]
    units = {name: unit for name, unit in pairs if name and unit}
    if before := [i for i in above if i < header]:
        remarks.append(f"the names are in line {header + 1}; {_lines(before)} above {_is(before)} left out")
    if units:
        remarks.append(f"line {below[0] + 1} holds units ({', '.join(dict.fromkeys(units.values()))})")
    if others := [i for i in below if i not in of_units]:
        remarks.append(f"{_lines(others)} below the names {_is(others)} text and left out")
    return Layout(separator, header + 1, names, units, frozenset(i + 1 for i in below), tuple(remarks))


def _commented(lines: Sequence[str], first: int, separator: str, usual: int) -> Layout | None:
    """Names in the last comment line above the data, as `numpy.savetxt` writes them."""
    at = next((i for i in range(min(first, len(lines)) - 1, -1, -1) if lines[i].strip()), None)
    if at is None or not lines[at].lstrip().startswith("#"):
        return None
    names = tuple(cell.strip() for cell in split(lines[at].lstrip().lstrip("#"), separator))
    if len(names) < max(usual, 2) or any(is_number(name, separator) for name in names):
        return None
    remark = f"the names are in line {at + 1}, a comment"
    return Layout(separator, at + 1, names, {}, frozenset(), (remark,))


def _separator(sample: Sequence[str]) -> str:
    """Choose what parts most lines into the same number of numbers, or parts any line at all."""

    def merit(separator: str) -> tuple[int, int, bool]:
        rows = [split(line, separator) for line in sample]
        counts = [sum(_counts(c, separator) for c in row) * (len(row) > 1) for row in rows]
        whole = [n * (n == len(row)) for n, row in zip(counts, rows, strict=True)]
        usual, mixed = _usual(whole), _usual(counts)
        return usual * whole.count(usual), mixed * counts.count(mixed), len(rows[0]) > 1

    best = max("\t;,", key=merit)
    return " " if merit(best)[1] == 0 and merit(" ")[0] > 0 else best  # cells may hold spaces, or be blank


def _usual(counts: Sequence[int]) -> int:
    """Return how many numbers most numbers stand in a line with; 0 where there are none."""
    common = Counter(counts)
    return max(common, key=lambda n: (n * common[n], n))


def is_content(line: str, separator: str = ",") -> bool:
    """Return whether a line is neither blank, nor empty cells, nor a comment."""
    return line.strip(" \t" + separator)[:1] not in ("", "#")


def split(line: str, separator: str) -> list[str]:
    """Return the cells of a line; of a line in columns of spaces, however many part them."""
    spaces = separator == " "
    if '"' in line:
        line = line.strip() if spaces else line
        return next(csv.reader([line], delimiter=separator, skipinitialspace=spaces))
    return line.split(None if spaces else separator)


def is_number(cell: str, separator: str = ",") -> bool:
    """Return whether float() reads the cell, but for the digit groups of Python's own literals (1_000)."""
    try:
        float(cell if separator == "," else cell.replace(",", "."))
    except ValueError:
        return False
    return "_" not in cell


def is_clock(cell: str) -> bool:
    """Return whether a cell holds a time of day, such as 12:30:05.25 or 2024-05-01T12:30:05."""
    return len(cell) < 50 and TIME.fullmatch(cell.strip()) is not None


def _counts(cell: str, separator: str) -> bool:
    return is_number(cell, separator) or is_clock(cell)


def _are_units(row: Sequence[str]) -> bool:
    there = [cell for cell in row if cell]
    return bool(there) and all(unit_of(cell) for cell in there)


def _distinct(row: Sequence[str]) -> bool:
    there = [cell for cell in row if cell]
    return len(set(there)) == len(there)


def _joined(groups: Sequence[str], row: Sequence[str]) -> list[str]:
    """Return each name after that of its group, which stands over the first column of the group."""
    joined, group = list[str](), ""
    for above, name in zip(groups, row, strict=True):
        group = above or group
        joined.append(f"{group} {name}".strip())
    return joined


def _lines(at: Sequence[int]) -> str:
    return f"line {at[0] + 1}" if len(at) == 1 else f"lines {at[0] + 1} to {at[-1] + 1}"


def _is(at: Sequence[int]) -> str:
    return "is" if len(at) == 1 else "are"
