"""Bytes -> lines -> header -> numbers: the CSV dialects that loggers and spreadsheets write.

Accepted: `,` `;` tab (and what a first line `sep=;` says), decimal commas where the separator is not a comma,
comment lines `#`, a byte order mark, UTF-8, UTF-16 or Latin-1, any line ends, quoted cells, blank lines.
"""

import codecs
import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import LogError
from hydroid.log.log import Floats

MAX_BYTES = 2**28
MAX_LINE = 100_000  # characters; also below the csv module's own limit for one cell


@dataclass(frozen=True)
class CsvFile:
    """All lines of a file, the line [1-based] of its header, and the names of its columns."""

    source: str
    lines: Sequence[str]
    header: int
    names: tuple[str, ...]
    separator: str

    def text(self, line: int, column: int) -> str:
        """Return the cell of a line [1-based] as it stands in the file."""
        cells = _split(self.lines[line - 1], self.separator)
        return cells[column].strip() if column < len(cells) else ""


def open_csv(path: Path) -> CsvFile:
    """Read a file and find its header.

    Raises:
        LogError: it cannot be read, is not text, or has no header.
    """
    source = str(path)
    lines = _decode(path).replace("\r\n", "\n").replace("\r", "\n").split("\n")
    longest = max(range(len(lines)), key=lambda i: len(lines[i]))
    if len(lines[longest]) > MAX_LINE:
        raise LogError(
            f"is longer than {MAX_LINE} characters", where=f"{source}, line {longest + 1}", hint=_IS_CSV
        )
    declared = re.fullmatch(r"sep=([,;\t|]) *", lines[0])
    start = 1 if declared else 0
    content = [*islice((i for i in range(start, len(lines)) if _is_content(lines[i])), 2)]
    if not content:
        raise LogError("is empty", where=source, hint=_IS_CSV)
    head, row = lines[content[0]], lines[content[-1]]
    separator = declared[1] if declared else _separator(head, row)
    names = tuple(name.strip() for name in _split(head, separator))
    header = content[0] + 1
    if all(_is_number(name.replace(",", ".")) for name in names if name):
        hint = "write the columns' names above it (a line that starts with # is a comment)"
        raise LogError("has no header: this line holds numbers", where=f"{source}, line {header}", hint=hint)
    return CsvFile(source, lines, header, names, separator)


def read_cells(file: CsvFile, columns: Sequence[int]) -> tuple[Floats, NDArray[np.int64], NDArray[np.bool_]]:
    """Read the numbers of the given columns, shape (R, columns), NaN where a cell holds none.

    Also returns the line [1-based] of each row, and which rows have more or fewer cells than the header.
    """
    width, separator = len(file.names), file.separator
    below = range(file.header, len(file.lines))
    numbers = [k for k in below if _is_content(file.lines[k], separator)]
    rows = [file.lines[k] for k in numbers]
    lines = np.array(numbers, np.int64) + 1
    if separator != ",":
        rows = [row.replace(",", ".") for row in rows]  # decimal commas
    values = _plain_numbers(rows, columns, width, separator)
    if values is not None:
        return values, lines, np.zeros(len(lines), bool)
    values, ragged = np.full((len(rows), len(columns)), np.nan), np.zeros(len(rows), bool)
    for k, row in enumerate(rows):
        cells = _split(row, separator)
        ragged[k] = len(cells) < width or (len(cells) > width and any(map(str.strip, cells[width:])))
        if not ragged[k]:
            values[k] = [float(cells[c]) if _is_number(cells[c]) else np.nan for c in columns]
    return values, lines, ragged


def _plain_numbers(rows: Sequence[str], columns: Sequence[int], width: int, separator: str) -> Floats | None:
    """Read all rows at once; None where a row or a cell is unusual and must be looked at by itself."""
    if not rows or any(row.count(separator) != width - 1 or '"' in row or "_" in row for row in rows):
        return None
    try:
        return np.loadtxt(rows, delimiter=separator, usecols=columns, comments=None, ndmin=2)
    except ValueError:
        return None


_IS_CSV = "a log is a CSV file with a header, one row a sample"


def _decode(path: Path) -> str:
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise LogError(f"cannot be read ({reason})", where=str(path)) from None
    if len(data) > MAX_BYTES:
        raise LogError(
            f"is larger than {MAX_BYTES >> 20} MiB", where=str(path), hint="cut it into several logs"
        )
    wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    for encoding in ("utf-16",) if wide else ("utf-8-sig", "latin-1"):
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        if "\0" not in text:
            return text
        break
    raise LogError("is not a text file", where=str(path), hint=_IS_CSV)


def _is_content(line: str, separator: str = ",") -> bool:
    bare = line.strip(" \t" + separator)
    return bare != "" and not bare.startswith("#")


def _separator(header: str, row: str) -> str:
    """Choose what parts the header into as many cells as the row below it, or else parts it at all."""
    parts = {s: len(_split(header, s)) for s in "\t;,"}
    candidates = [s for s in parts if parts[s] > 1]
    agreeing = [s for s in candidates if parts[s] == len(_split(row, s))]
    return [*agreeing, *candidates, ","][0]


def _split(line: str, separator: str) -> list[str]:
    return next(csv.reader([line], delimiter=separator)) if '"' in line else line.split(separator)


def _is_number(cell: str) -> bool:
    """True for what float() reads, but for the digit groups of Python's own literals (1_000)."""
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell
