"""Bytes -> lines -> table: the CSV dialects that loggers and spreadsheets write.

Accepted: `,` `;` `|` tab, or spaces; decimal commas where the separator is no comma, comment lines `#`, a
byte order mark, UTF-8, UTF-16 or Latin-1, any line ends, quoted cells, blank lines, dates and times of day.

Loggers write a preamble above the names, or a row of units below them. The data begin with the first line
that has a number in the first column of numbers, and half as many as most lines; the names stand above it. A
line below the names is left out only if it holds no number: any other fault there is a fault of the data.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from hydroid.errors import LogError
from hydroid.log.cells import holds_number, number, split
from hydroid.log.table import Table
from hydroid.units import bare, unit_of

SEPARATORS = {"\t": "tabs", ";": "semicolons", ",": "commas", "|": "bars", " ": "spaces"}
IS_CSV = "a log is a CSV file with a header, one row a sample"


def open_csv(path: Path, data: bytes) -> Table:
    """Find the table in a file's bytes.

    Raises:
        LogError: it is not text, or has no header.
    """
    text, encoding = _decode(path, data)
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if long := next((k for k, line in enumerate(lines, 1) if len(line) > 100_000), 0):  # csv has such a limit
        raise LogError("is longer than 100000 characters", where=f"{path}, line {long}", hint=IS_CSV)
    content = [k for k, line in enumerate(lines) if _is_content(line)]
    if not content:
        raise LogError("is empty", where=str(path), hint=IS_CSV)
    separator = _separator([lines[k] for k in content[:400]])
    rows = {k: split(lines[k], separator) for k in content[:400]}
    header, left_out = _header(rows)
    names = rows[header]
    if all(number(name.replace(",", ".")) is not None for name in names if name):
        what, where = "has no header: this line holds numbers", f"{path}, line {header + 1}"
        hint = "write the columns' names above it (a line that starts with # is a comment)"
        raise LogError(what, where=where, hint=hint)
    remarks, units = list[str](), dict[str, str]()
    if content[0] < header:
        remarks.append(f"the names are in line {header + 1}; what stands above is left out")
    for k in left_out:
        said = "is text and left out"
        if _are_units(rows[k]):
            units |= {name: unit for name, unit in zip(names, map(bare, rows[k]), strict=True) if unit}
            said = f"holds units ({', '.join(dict.fromkeys(units.values()))})"
        remarks.append(f"line {k + 1} {said}")
    layout = f"CSV in {encoding} separated by {SEPARATORS[separator]}"
    below = [k for k in content if k > header and k not in left_out and _is_content(lines[k], separator)]
    commas = separator != "," and any("," in lines[k] for k in below)
    if commas or layout != "CSV in UTF-8 separated by commas":
        remarks.append(f"read as {layout}{', with decimal commas' if commas else ''}")
    width = len(names)
    cells = [split(lines[k].replace(",", ".") if commas else lines[k], separator) for k in below]
    torn = np.array([len(row) < width or any(row[width:]) for row in cells], bool)
    cells = [[""] * width if bad else row for row, bad in zip(cells, torn, strict=True)]
    columns: dict[str, Any] = {
        name: np.array([row[c] for row in cells], dtype=object) for c, name in enumerate(names)
    }
    return Table(
        source=str(path),
        layout=layout,
        names=tuple(names),
        columns=columns,
        header=header + 1,
        units=units,
        remarks=tuple(remarks),
        lines=np.array(below, np.int64) + 1,
        torn=torn,
    )


def _decode(path: Path, data: bytes) -> tuple[str, str]:
    """Return a file's text and encoding."""
    wide = data.startswith((b"\xff\xfe", b"\xfe\xff"))
    for encoding in ("utf-16",) if wide else ("utf-8-sig", "latin-1"):
        with suppress(UnicodeDecodeError):
            text = data.decode(encoding)
            if "\0" not in text:
                return text, encoding.upper().removesuffix("-SIG")
    hint = "save the sheet as CSV" if path.suffix.startswith(".xls") else IS_CSV
    raise LogError("is not a text file", where=str(path), hint=hint)


def _separator(sample: Sequence[str]) -> str:
    """Choose what parts most lines into the same number of numbers, or parts any line at all."""

    def merit(separator: str) -> tuple[int, bool, int]:
        rows = [split(line, separator) for line in sample]
        counts = [len(_numbers(row)) * (len(row) > 1) for row in rows]
        usual = _usual(counts)
        return usual * counts.count(usual), separator != " ", max(map(len, rows))

    return max(SEPARATORS, key=merit)


def _header(rows: Mapping[int, Sequence[str]]) -> tuple[int, list[int]]:
    """Return the line of names among lines of cells, and the lines of text between it and the data."""
    numbers = {k: _numbers(row) for k, row in rows.items()}
    usual = _usual([*map(len, numbers.values())])
    pattern = Counter(at for at in numbers.values() if len(at) == usual).most_common(1)[0][0]
    data = (k for k, at in numbers.items() if pattern and pattern[0] in at and 2 * len(at) >= usual)
    first = next(data, max(rows) + 1)
    texts = {k: [*filter(None, row)] for k, row in rows.items() if k < first and not numbers[k]}
    texts = {k: cells for k, cells in texts.items() if len(cells) >= max(usual / 2, 1)}
    named = [k for k in texts if not _are_units(rows[k])] or texts
    # names differ, are many, and stand below other texts
    header = max(
        named, key=lambda k: (len({*texts[k]}) == len(texts[k]), len(texts[k]), k), default=next(iter(rows))
    )
    return header, [k for k in texts if k > header and len(rows[k]) == len(rows[header])]


def _numbers(row: Sequence[str]) -> tuple[int, ...]:
    return tuple(c for c, cell in enumerate(row) if holds_number(cell))


def _usual(counts: Sequence[int]) -> int:
    """Return how many numbers most numbers stand in a line with; 0 where there are none."""
    common = Counter(counts)
    return max(common, key=lambda n: (n * common[n], n))


def _is_content(line: str, separator: str = ",") -> bool:
    """Return whether a line is neither blank, nor empty cells, nor a comment, nor names a separator."""
    return line.strip(" \t" + separator)[:1] not in ("", "#") and not line.startswith("sep=")


def _are_units(row: Sequence[str]) -> bool:
    there = [cell for cell in row if cell]
    return bool(there) and all(map(unit_of, there))
