"""Bytes -> lines -> table: the CSV dialects that loggers and spreadsheets write.

Accepted: `,` `;` `|` tab, or spaces; decimal commas where the separator is no comma, comment lines `#`, a
byte order mark, UTF-8, UTF-16 or Latin-1, any line ends, quoted cells, blank lines, dates and times of day.

Loggers write a preamble above the names, or a row of units below them. The data begin with the first line
that has a number in the first column of numbers, and half as many as most lines; the names stand above it. A
line below the names is left out only if it holds no number: any other fault there is a fault of the data.
"""

import csv
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path

import numpy as np

from hydroid.errors import LogError
from hydroid.log.binary import FORMATS
from hydroid.log.table import Table, clock, number
from hydroid.units import bare, unit_of

SEPARATORS = "\t;,| "
csv.field_size_limit(2**31 - 1)  # a longer cell is no number, which is said, with its place
IS_CSV = f"formats of logs are {FORMATS}; a CSV file has a header and one row per sample"


def open_csv(path: Path) -> Table:
    """Find the table in a file."""
    data = path.read_bytes()
    lines = _decode(path, data).replace("\r\n", "\n").replace("\r", "\n").split("\n")
    content = [k for k, line in enumerate(lines) if _is_content(line)]
    if not content:
        raise LogError("is empty", path, IS_CSV)
    separator = _separator([lines[k] for k in content[:400]])
    rows = {k: split(lines[k], separator) for k in content[:400]}
    header, left_out = _header(rows)
    names, width = rows[header], len(rows[header])
    if all(number(name.replace(",", ".")) is not None for name in names if name):
        hint = "write the columns' names above it (a line that starts with # is a comment)"
        raise LogError("has no header: this line holds numbers", f"{path}, line {header + 1}", hint)
    if width == 1:
        raise LogError("has one column only", path, "part cells by , ; | tabs or spaces")
    above = f"the names are in line {header + 1}; what stands above is left out"
    remarks = [above] if content[0] < header else []
    remarks += [f"line {k + 1} is text and left out" for k in left_out]
    cells_of_units = (zip(names, map(bare, rows[k]), strict=True) for k in left_out if _are_units(rows[k]))
    units = dict(chain.from_iterable(cells_of_units))
    below = [k for k in content if k > header and k not in left_out and _is_content(lines[k], separator)]
    commas = separator != "," and any("," in lines[k] for k in below)
    if commas:
        remarks.append("commas are read as decimal points")
    cells = [split(lines[k].replace(",", ".") if commas else lines[k], separator) for k in below]
    # rows of fewer or more cells count as empty
    whole = (row[:width] if len(row) >= width and not any(row[width:]) else [""] * width for row in cells)
    table = np.array([*whole], dtype=object).reshape(-1, width)
    return Table(
        source=str(path),
        names=tuple(names),
        columns=dict(zip(names, table.T, strict=True)),
        header=header + 1,
        units=units,
        remarks=tuple(remarks),
        lines=np.array(below, np.int64) + 1,
    )


def _decode(path: Path, data: bytes) -> str:
    wide = data.startswith((b"\xff\xfe", b"\xfe\xff"))
    for encoding in ("utf-16",) if wide else ("utf-8-sig", "latin-1"):
        with suppress(UnicodeDecodeError):
            text = data.decode(encoding)
            if "\0" not in text:
                return text
    hint = "save the sheet as CSV" if path.suffix.startswith(".xls") else IS_CSV
    raise LogError("is not a text file", path, hint)


def split(line: str, separator: str) -> list[str]:
    """Return the cells of a line; of a line in columns of spaces, however many part them."""
    spaces = separator == " "
    if '"' in line:
        line = line.strip() if spaces else line
        cells = next(csv.reader([line], delimiter=separator, skipinitialspace=spaces))
    else:
        cells = line.split(None if spaces else separator)
    return [cell.strip() for cell in cells]


def _separator(sample: Sequence[str]) -> str:
    """Choose what parts most lines into the same number of numbers, or parts any line at all."""

    def merit(separator: str) -> tuple[int, bool, int]:
        rows = [split(line, separator) for line in sample]
        counts = Counter(len(_numbers(row)) * (len(row) > 1) for row in rows)
        most = max(numbers * lines for numbers, lines in counts.items())
        return most, separator != " ", max(map(len, rows))

    return max(SEPARATORS, key=merit)


def _header(rows: Mapping[int, Sequence[str]]) -> tuple[int, list[int]]:
    """Return the line of names among lines of cells, and the lines of text between it and the data."""
    numbers = {k: _numbers(row) for k, row in rows.items()}
    common = Counter(map(len, numbers.values()))
    usual = max(common, key=lambda n: (n * common[n], n))
    pattern = Counter(at for at in numbers.values() if len(at) == usual).most_common(1)[0][0]
    data = (k for k, at in numbers.items() if pattern and pattern[0] in at and 2 * len(at) >= usual)
    first = next(data, max(rows) + 1)
    texts = {k: [*filter(None, row)] for k, row in rows.items() if k < first and not numbers[k]}
    texts = {k: cells for k, cells in texts.items() if len(cells) >= max(usual / 2, 1)}
    named = [k for k in texts if not _are_units(texts[k])] or texts
    # names differ, are many, and stand below other texts
    order = {k: (len({*texts[k]}) == len(texts[k]), len(texts[k]), k) for k in named}
    header = max(order, key=lambda k: order[k], default=next(iter(rows)))
    return header, [k for k in texts if k > header and len(rows[k]) == len(rows[header])]


def _numbers(row: Sequence[str]) -> tuple[int, ...]:
    """Return which cells hold a number, maybe with a decimal comma, or a time."""
    return tuple(
        c for c, x in enumerate(row) if number(x.replace(",", ".")) is not None or clock(x) is not None
    )


def _is_content(line: str, separator: str = ",") -> bool:
    """Return whether a line is neither blank, nor empty cells, nor a comment, nor names a separator."""
    return line.strip(" \t" + separator)[:1] not in ("", "#") and not line.startswith("sep=")


def _are_units(row: Sequence[str]) -> bool:
    return any(row) and all(map(unit_of, filter(None, row)))
