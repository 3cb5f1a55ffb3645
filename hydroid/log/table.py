"""Bytes -> lines -> header -> numbers: the CSV dialects that loggers and spreadsheets write.

Accepted: `,` `;` tab (and what a first line `sep=;` says), decimal commas where the separator is not a comma,
comment lines `#`, a byte order mark, UTF-8, UTF-16 or Latin-1, any line ends, quoted cells, blank lines.
"""

import codecs
import csv
import re
from array import array
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import LogError
from hydroid.log.log import Floats

MAX_BYTES = 2**28
MAX_LINE = 100_000  # characters; also below the csv module's own limit for one cell
_NAN = float("nan")


@dataclass(frozen=True)
class Table:
    """The lines of a file and its header.

    Attributes:
        source: the file.
        lines: all lines of the file.
        header: line number of the header [1-based].
        names: of the columns.
        separator: between cells.
    """

    source: str
    lines: Sequence[str]
    header: int
    names: tuple[str, ...]
    separator: str

    def text(self, line: int, column: int) -> str:
        """Return the cell of a line [1-based] as it stands in the file."""
        cells = _split(self.lines[line - 1], self.separator)
        return cells[column].strip() if column < len(cells) else ""


@dataclass(frozen=True, eq=False)
class Cells:
    """The numbers of some columns.

    Attributes:
        values: shape (T, columns), NaN where a cell holds no number and in ragged rows.
        lines: line number of each row [1-based], shape (T,).
        ragged: rows with more or fewer cells than the header, shape (T,).
    """

    values: Floats
    lines: NDArray[np.int64]
    ragged: NDArray[np.bool_]


def open_table(path: Path) -> Table:
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
    return Table(source, lines, header, names, separator)


def read_cells(table: Table, columns: Sequence[int]) -> Cells:
    """Read the numbers of the given columns; what is no number becomes NaN."""
    width, separator = len(table.names), table.separator
    values, lines, ragged = array("d"), array("q"), array("b")
    hole = [_NAN] * len(columns)
    for number in range(table.header, len(table.lines)):
        line = table.lines[number]
        if not _is_content(line, separator):
            continue
        if separator != ",":
            line = line.replace(",", ".")  # decimal commas
        cells = _split(line, separator)
        torn = len(cells) < width or (len(cells) > width and any(map(str.strip, cells[width:])))
        values.extend(hole if torn else _numbers([cells[column] for column in columns], "_" in line))
        lines.append(number + 1)
        ragged.append(torn)
    shape = (len(lines), len(columns))
    return Cells(np.array(values).reshape(shape), np.array(lines, np.int64), np.array(ragged, np.bool_))


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


def _numbers(cells: Sequence[str], grouped: bool) -> list[float]:
    """All at once, or one by one where any may be none."""
    if not grouped:
        with suppress(ValueError):
            return [*map(float, cells)]
    return [_number(cell) for cell in cells]


def _number(cell: str) -> float:
    return float(cell) if _is_number(cell) else _NAN


def _is_number(cell: str) -> bool:
    """True for what float() reads, but for the digit groups of Python's own literals (1_000)."""
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell
