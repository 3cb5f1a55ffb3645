"""Bytes -> lines -> table: the CSV dialects that loggers and spreadsheets write.

Accepted: `,` `;` tab (and what a first line `sep=;` says), spaces where nothing else parts the numbers,
decimal commas where the separator is no comma, comment lines `#`, a byte order mark, UTF-8, UTF-16 or
Latin-1, any line ends, quoted cells, blank lines, and what `hydroid.log.csv_layout` finds: a preamble,
several rows of names, a row of units.
"""

import codecs
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hydroid.errors import LogError
from hydroid.log.clock import clock_seconds, is_clock
from hydroid.log.csv_layout import Layout, find_layout, is_content, is_number, split
from hydroid.log.log import Floats
from hydroid.log.table import Cells

MAX_BYTES = 2**28
MAX_LINE = 100_000  # characters; also below the csv module's own limit for one cell
_PLAIN = "CSV in UTF-8 separated by commas"
_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", " ": "spaces"}


@dataclass(frozen=True, eq=False)
class CsvTable:
    """All lines of a file and where its table stands in them; a `Table`."""

    source: str
    lines: Sequence[str]
    found: Layout
    encoding: str
    place: str = "line"

    @property
    def layout(self) -> str:
        """The format in a few words."""
        separator = _SEPARATORS[self.found.separator]
        return f"CSV in {self.encoding.upper().removesuffix('-SIG')} separated by {separator}"

    @property
    def header(self) -> int:
        """Line of the names [1-based]."""
        return self.found.header

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return self.found.names

    @property
    def units(self) -> Mapping[str, str]:
        """Units by name, from a row of units."""
        return self.found.units

    @property
    def remarks(self) -> tuple[str, ...]:
        """Lines that are left out, and what the others were taken for."""
        return self.found.remarks

    def text(self, row: int, column: str) -> str:
        """Return the cell of a line [1-based] as it stands in the file."""
        cells, at = split(self.lines[row - 1], self.found.separator), self.names.index(column)
        return cells[at].strip() if at < len(cells) else ""

    def read(self, columns: Sequence[str], held: Collection[str] = ()) -> Cells:
        """Read columns, as `Table` says."""
        width, separator = len(self.names), self.found.separator
        wanted = [self.names.index(name) for name in columns]
        below = range(self.found.header, len(self.lines))
        kept = [k for k in below if is_content(self.lines[k], separator) and k + 1 not in self.found.skipped]
        rows, lines = [self.lines[k] for k in kept], np.array(kept, np.int64) + 1
        remarks = [] if self.layout == _PLAIN else [f"read as {self.layout}"]
        if separator != "," and any("," in row for row in rows):
            rows = [row.replace(",", ".") for row in rows]
            remarks = [f"read as {self.layout}, with decimal commas"]
        values = _plain_numbers(rows, wanted, width, separator)
        if values is not None:
            return Cells(values, lines, np.zeros(len(lines), bool), remarks=tuple(remarks))
        parted = [split(row, separator) for row in rows]
        ragged = np.array([len(c) < width or any(map(str.strip, c[width:])) for c in parted], bool)
        whole = [[cells[c].strip() for c in wanted] for cells, r in zip(parted, ragged, strict=True) if not r]
        values = np.full((len(rows), len(columns)), np.nan)
        clocks = [c for c in range(len(columns)) if any(cells[c] for cells in whole) and _is_clock(whole, c)]
        for c in range(len(columns)):
            values[~ragged, c] = (
                clock_seconds([cells[c] for cells in whole])
                if c in clocks
                else [float(cells[c]) if is_number(cells[c]) else np.nan for cells in whole]
            )
        remarks += [f"{columns[c]} holds times of day, taken as seconds from the first" for c in clocks]
        return Cells(values, lines, ragged, frozenset(columns[c] for c in clocks), tuple(remarks))


def open_csv(path: Path, wanted: Collection[str] = ()) -> CsvTable:
    """Read a file and find its table.

    Args:
        path: the file.
        wanted: names of columns that the settings ask for; they tell the header from other lines.

    Raises:
        LogError: it cannot be read, is not text, or has no header.
    """
    source = str(path)
    text, encoding = _decode(path)
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    longest = max(range(len(lines)), key=lambda i: len(lines[i]))
    if len(lines[longest]) > MAX_LINE:
        raise LogError(
            f"is longer than {MAX_LINE} characters", where=f"{source}, line {longest + 1}", hint=_IS_CSV
        )
    found = find_layout(lines, wanted)
    if found is None:
        raise LogError("is empty", where=source, hint=_IS_CSV)
    if all(is_number(name, found.separator) for name in found.names if name):
        hint = "write the columns' names above it (a line that starts with # is a comment)"
        where = f"{source}, line {found.header}"
        raise LogError("has no header: this line holds numbers", where=where, hint=hint)
    return CsvTable(source, lines, found, encoding)


def _is_clock(rows: Sequence[Sequence[str]], column: int) -> bool:
    return is_clock(next(cells[column] for cells in rows if cells[column]))


def _plain_numbers(rows: Sequence[str], columns: Sequence[int], width: int, separator: str) -> Floats | None:
    """Read all rows at once; None where a row or a cell is unusual and must be looked at by itself."""
    spaces = separator == " "
    widths = (len(row.split()) if spaces else row.count(separator) + 1 for row in rows)
    if not rows or any(n != width for n in widths) or any('"' in row or "_" in row for row in rows):
        return None
    try:
        return np.loadtxt(
            rows, delimiter=None if spaces else separator, usecols=columns, comments=None, ndmin=2
        )
    except ValueError:
        return None


_IS_CSV = "a log is a CSV file with a header, one row a sample"


def read_start(path: Path, size: int = MAX_BYTES + 1) -> bytes:
    """Return the first bytes of a file.

    Raises:
        LogError: it cannot be read.
    """
    try:
        with path.open("rb") as file:
            return file.read(size)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise LogError(f"cannot be read ({reason})", where=str(path)) from None


def _decode(path: Path) -> tuple[str, str]:
    data = read_start(path)
    if len(data) > MAX_BYTES:
        raise LogError(
            f"is larger than {MAX_BYTES >> 20} MiB", where=str(path), hint="cut it into several logs"
        )
    for encoding in _encodings(data):
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        if "\0" not in text:
            return text, encoding
        break
    hint = "save the sheet as CSV" if path.suffix.startswith(".xls") else _IS_CSV
    raise LogError("is not a text file", where=str(path), hint=hint)


def _encodings(data: bytes) -> tuple[str, ...]:
    """Encodings to be tried; UTF-16 without a byte order mark has a zero in nearly every other byte."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return ("utf-16",)
    start = data[:2000]
    for encoding, zeros in (("utf-16-le", start[1::2]), ("utf-16-be", start[::2])):
        if len(zeros) > 8 and zeros.count(0) > 0.9 * len(zeros):
            return (encoding,)
    return ("utf-8-sig", "latin-1")
