"""Bytes -> lines -> table: the CSV dialects that loggers and spreadsheets write.

Accepted: `,` `;` tab (and what a first line `sep=;` says), spaces where nothing else parts the numbers,
decimal commas where the separator is no comma, comment lines `#`, a byte order mark, UTF-8, UTF-16 or
Latin-1, any line ends, quoted cells, blank lines, dates and times of day, and what `hydroid.log.csv_layout`
finds: a preamble, several rows of names, a row of units.
"""

import codecs
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import numpy as np

from hydroid.errors import LogError
from hydroid.log.csv_layout import TIME, find_layout, is_clock, is_content, is_number, split
from hydroid.log.log import Floats
from hydroid.log.table import Cells, Table

MAX_BYTES = 2**28
MAX_LINE = 100_000  # characters; also below the csv module's own limit for one cell
DAY = 86_400 * 10**9  # [ns]
IS_CSV = "a log is a CSV file with a header, one row a sample"
_PLAIN = "CSV in UTF-8 separated by commas"
_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", " ": "spaces"}
_ISO_DATE = re.compile(r"(\d{4})-?(\d{2})-?(\d{2})[T ]")


@dataclass(frozen=True, eq=False, kw_only=True)
class CsvTable(Table):
    """All lines of a file; `below` are the indices of those that hold data."""

    lines: Sequence[str]
    separator: str
    below: Sequence[int]

    def text(self, row: int, column: str) -> str:
        """Return the cell of a line [1-based] as it stands in the file."""
        cells, at = split(self.lines[row - 1], self.separator), self.names.index(column)
        return cells[at].strip() if at < len(cells) else ""

    def read(self, columns: Sequence[str], held: Collection[str] = ()) -> Cells:
        """Read columns, as `Table` says."""
        wanted = [self.names.index(name) for name in columns]
        rows, lines = [self.lines[k] for k in self.below], np.array(self.below, np.int64) + 1
        remarks = [] if self.layout == _PLAIN else [f"read as {self.layout}"]
        if self.separator != "," and any("," in row for row in rows):
            rows = [row.replace(",", ".") for row in rows]
            remarks = [f"read as {self.layout}, with decimal commas"]
        values = self._plain_numbers(rows, wanted)
        ragged, clocks = np.zeros(len(rows), bool), list[str]()
        if values is None:
            width, parted = len(self.names), [split(row, self.separator) for row in rows]
            ragged = np.array([len(c) < width or any(map(str.strip, c[width:])) for c in parted], bool)
            values = np.full((len(rows), len(columns)), np.nan)
            for k, c in enumerate(wanted):
                cells = [row[c].strip() for row, torn in zip(parted, ragged, strict=True) if not torn]
                if is_clock(next(filter(None, cells), "")):
                    clocks.append(columns[k])
                    values[~ragged, k] = _clock_seconds(cells)
                else:
                    values[~ragged, k] = [float(cell) if is_number(cell) else np.nan for cell in cells]
        remarks += [f"{name} holds times of day, taken as seconds from the first" for name in clocks]
        return Cells(values, lines, ragged, frozenset(clocks), tuple(remarks))

    def _plain_numbers(self, rows: Sequence[str], columns: Sequence[int]) -> Floats | None:
        """Read all rows at once; None where a row or a cell is unusual and must be looked at by itself."""
        separator = None if self.separator == " " else self.separator
        widths = (len(row.split(separator)) for row in rows)
        if not rows or any(n != len(self.names) for n in widths) or any('"' in r or "_" in r for r in rows):
            return None
        try:
            return np.loadtxt(rows, delimiter=separator, usecols=columns, comments=None, ndmin=2)
        except ValueError:
            return None


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
        what = f"is longer than {MAX_LINE} characters"
        raise LogError(what, where=f"{source}, line {longest + 1}", hint=IS_CSV)
    layout = find_layout(lines, wanted)
    if layout is None:
        raise LogError("is empty", where=source, hint=IS_CSV)
    if all(is_number(name, layout.separator) for name in layout.names if name):
        hint = "write the columns' names above it (a line that starts with # is a comment)"
        where = f"{source}, line {layout.header}"
        raise LogError("has no header: this line holds numbers", where=where, hint=hint)
    below = (k for k in range(layout.header, len(lines)) if k + 1 not in layout.skipped)
    return CsvTable(
        source=source,
        layout=f"CSV in {encoding} separated by {_SEPARATORS[layout.separator]}",
        names=layout.names,
        place="line",
        header=layout.header,
        units=layout.units,
        remarks=layout.remarks,
        lines=lines,
        separator=layout.separator,
        below=[k for k in below if is_content(lines[k], layout.separator)],
    )


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
    """Return a file's text and encoding; UTF-16 without its mark has a zero in nearly every other byte."""
    data = read_start(path)
    if len(data) > MAX_BYTES:
        what = f"is larger than {MAX_BYTES >> 20} MiB"
        raise LogError(what, where=str(path), hint="cut it into several logs")
    start, encodings = data[:2000], ["utf-8-sig", "latin-1"]
    for encoding, zeros in (("utf-16-le", start[1::2]), ("utf-16-be", start[::2])):
        if len(zeros) > 8 and zeros.count(0) > 0.9 * len(zeros):
            encodings = [encoding]
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encodings = ["utf-16"]
    for encoding in encodings:
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        if "\0" not in text:
            return text, encoding.upper().removesuffix("-SIG")
        break
    hint = "save the sheet as CSV" if path.suffix.startswith(".xls") else IS_CSV
    raise LogError("is not a text file", where=str(path), hint=hint)


def _clock_seconds(cells: Sequence[str]) -> Floats:
    """Return the time of each cell from the first [s], shape (R,), NaN for a cell that holds none.

    Dates count where they are ISO 8601 (2024-05-01). Other dates are not read: whether 3/4 is in March or in
    April does not matter, since a time of day that falls by more than half a day has passed midnight.
    """
    ticks = np.array([_nanoseconds(cell) for cell in cells], dtype=object)
    there = np.array([tick is not None for tick in ticks], dtype=bool)
    seconds = np.full(len(cells), np.nan)
    if there.any():
        since = (ticks[there] - ticks[there][0]).astype(np.int64)
        midnights = np.cumsum(np.diff(since, prepend=since[0]) < -DAY // 2)
        seconds[there] = (since + DAY * midnights) / 1e9
    return seconds


def _nanoseconds(cell: str) -> int | None:
    if not is_clock(cell) or (match := TIME.fullmatch(cell)) is None:
        return None
    hours, minutes, seconds, fraction, half = match.groups()
    hour = int(hours) % 12 + 12 * (half in "Pp") if half else int(hours)
    ticks = (3600 * hour + 60 * int(minutes) + int(seconds)) * 10**9 + int((fraction or "0").ljust(9, "0"))
    day = _ISO_DATE.match(cell)
    try:
        return ticks + (DAY * date(*map(int, day.groups())).toordinal() if day else 0)
    except ValueError:  # such as the 31st of February
        return None
