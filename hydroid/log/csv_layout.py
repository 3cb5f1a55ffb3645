"""Where the table of a CSV file begins: its separator, and which lines hold names, units and neither.

Loggers write a preamble above the names, or a row of units below them. The data begin with the first line
that has a number in the first column of numbers, and half as many as most lines. The row of names is sought
above it; one that holds names of the settings is preferred. A line below the names is left out only if it
holds no number: any other fault there is a fault of the data.
"""

import csv
import re
from collections import Counter
from collections.abc import Collection, Sequence
from datetime import date
from itertools import islice
from typing import NamedTuple

from hydroid.units import bare, unit_of

TIME = re.compile(
    r"(?:(?:(\d{4})-?(\d{2})-?(\d{2})|.*?)[T ])?"
    r"(\d{1,2}):(\d{2}):(\d{2})(?:[.,](\d{1,9})\d*)? *([AaPp])?\.?[Mm]?\.?(?:Z|[+-][\d:]+)?"
)
"""a time of day, with or without a date"""


class Layout(NamedTuple):
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
        lines: all of them; the first 400 with content are searched.
        wanted: names of columns that the settings ask for.
    """
    declared = re.fullmatch(r"sep=([,;\t|]) *", lines[0])
    start = 1 if declared else 0
    content = list(islice((k for k in range(start, len(lines)) if is_content(lines[k])), 400))
    if not content:
        return None
    separator = declared[1] if declared else _separator([lines[k] for k in content])
    rows = {k: [cell.strip() for cell in split(lines[k], separator)] for k in content}
    numbers = {k: [c for c, cell in enumerate(row) if _counts(cell)] for k, row in rows.items()}
    usual = _usual([*map(len, numbers.values())])
    pattern = Counter(tuple(at) for at in numbers.values() if len(at) == usual).most_common(1)[0][0]
    enough = (k for k, at in numbers.items() if at and 2 * len(at) >= usual)
    first = next((k for k in enough if pattern and pattern[0] in numbers[k]), len(lines))
    above = [k for k in content if k < first]
    texts = [k for k in above if not numbers[k] and sum(map(bool, rows[k])) >= max(usual / 2, 1)]
    named, remarks = [k for k in texts if not _are_units(rows[k])] or texts, list[str]()

    def merit(k: int) -> tuple[int, bool, int, int]:
        """Rank a row of names by its wanted ones, by whether they differ, by their number, by its place."""
        names = [cell for cell in rows[k] if cell]
        return len({*names} & {*wanted}), len({*names}) == len(names), len(names), k

    if named:
        header = max(named, key=merit)
        if before := [k for k in above if k < header]:
            remarks.append(f"the names are in line {header + 1}; {_lines(before, 'above')} left out")
    else:
        header = content[0]
        # names in the last comment line above the data, as `numpy.savetxt` writes them
        last = next((k for k in range(min(first, len(lines)) - 1, -1, -1) if lines[k].strip()), 0)
        cells = [cell.strip() for cell in split(lines[last].lstrip(" \t#"), separator)]
        if lines[last].lstrip()[:1] == "#" and len(cells) >= max(usual, 2) and not any(map(_counts, cells)):
            header, rows[last] = last, cells
            remarks.append(f"the names are in line {last + 1}, a comment")
    below = [k for k in texts if k > header and len(rows[k]) == len(rows[header])]
    of_units = [k for k in below if _are_units(rows[k])]
    pairs = [pair for k in of_units for pair in zip(rows[header], map(bare, rows[k]), strict=True)]
    units = {name: unit for name, unit in pairs if name and unit}
    if units:
        remarks.append(f"line {of_units[0] + 1} holds units ({', '.join(dict.fromkeys(units.values()))})")
    if others := [k for k in below if k not in of_units]:
        remarks.append(f"{_lines(others, 'below the names')} text and left out")
    skipped = frozenset(k + 1 for k in below)
    return Layout(separator, header + 1, tuple(rows[header]), units, skipped, tuple(remarks))


def _separator(sample: Sequence[str]) -> str:
    """Choose what parts most lines into the same number of numbers, or parts any line at all."""

    def merit(separator: str) -> tuple[int, int, bool]:
        rows = [split(line, separator) for line in sample]
        counts = [sum(map(_counts, row)) * (len(row) > 1) for row in rows]
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


def number(cell: str) -> float | None:
    """Return what float() reads, but for the digit groups of Python's literals (1_000); None: no number."""
    try:
        return float(cell) if "_" not in cell else None
    except ValueError:
        return None


def clock(cell: str) -> int | None:
    """Return the time in a cell [ns], of the day or with an ISO date since year 0; None: there is none."""
    match = TIME.fullmatch(cell) if len(cell) < 50 else None
    if match is None:
        return None
    year, month, day, hour, minute, second, fraction, half = match.groups()
    hours = int(hour) % 12 + 12 * (half in "Pp") if half else int(hour)
    try:
        days = date(int(year), int(month), int(day)).toordinal() if year else 0
    except ValueError:  # such as the 31st of February
        return None
    seconds = ((24 * days + hours) * 60 + int(minute)) * 60 + int(second)
    return seconds * 10**9 + int((fraction or "0").ljust(9, "0"))


def _counts(cell: str) -> bool:
    return number(cell.replace(",", ".")) is not None or clock(cell.strip()) is not None


def _are_units(row: Sequence[str]) -> bool:
    there = [cell for cell in row if cell]
    return bool(there) and all(unit_of(cell) for cell in there)


def _lines(at: Sequence[int], where: str) -> str:
    return (
        f"line {at[0] + 1} {where} is" if len(at) == 1 else f"lines {at[0] + 1} to {at[-1] + 1} {where} are"
    )
