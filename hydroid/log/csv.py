"""Bytes -> lines -> table: the CSV dialects that loggers and spreadsheets write.

Accepted: `,` `;` tab (and what a first line `sep=;` says), spaces where nothing else parts the numbers,
decimal commas where the separator is no comma, comment lines `#`, a byte order mark, UTF-8, UTF-16 or
Latin-1, any line ends, quoted cells, blank lines, dates and times of day, and what `hydroid.log.csv_layout`
finds: a preamble, a row of units, names in a comment.
"""

import codecs
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hydroid.errors import LogError
from hydroid.log.csv_layout import clock, find_layout, is_content, number, split
from hydroid.log.log import Floats
from hydroid.log.table import Recording, Signal, Table

MAX_BYTES = 2**28
IS_CSV = "a log is a CSV file with a header, one row a sample"
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", " ": "spaces"}


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

    def read(self, signals: Sequence[Signal]) -> Recording:
        """Read columns, as `Table` says."""
        names = [signal.name for signal in signals]
        wanted, width = [self.names.index(name) for name in names], len(self.names)
        lines, remark = [self.lines[k] for k in self.below], f"read as {self.layout}"
        if self.separator != "," and any("," in line for line in lines):
            lines, remark = [line.replace(",", ".") for line in lines], f"{remark}, with decimal commas"
        values, ragged = np.full((len(lines), len(names)), np.nan), np.zeros(len(lines), bool)
        for row, line in enumerate(lines):
            cells = split(line, self.separator)
            if len(cells) < width or any(map(str.strip, cells[width:])):
                ragged[row] = True
            else:
                values[row] = [number(cells[c]) for c in wanted]
        clocks = list[str]()
        for column, name in enumerate(names):
            texts = [self.text(k + 1, name) for k in self.below] if np.isnan(values[:1, column]).any() else ()
            if clock(next(filter(None, texts), "")) is not None:
                clocks.append(name)
                values[:, column] = np.where(ragged, np.nan, _seconds(texts))
        remarks = [] if remark == "read as CSV in UTF-8 separated by commas" else [remark]
        remarks += [f"{name} holds times of day, taken as seconds from the first" for name in clocks]
        rows = np.array(self.below, np.int64) + 1
        return Recording(self, tuple(signals), values, rows, ragged, frozenset(clocks), tuple(remarks))


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
    most = 100_000  # characters; also below the csv module's own limit for one cell
    if long := next((k for k, line in enumerate(lines, 1) if len(line) > most), 0):
        raise LogError(f"is longer than {most} characters", where=f"{source}, line {long}", hint=IS_CSV)
    layout = find_layout(lines, wanted)
    if layout is None:
        raise LogError("is empty", where=source, hint=IS_CSV)
    if all(number(name.replace(",", ".")) is not None for name in layout.names if name):
        hint = "write the columns' names above it (a line that starts with # is a comment)"
        where = f"{source}, line {layout.header}"
        raise LogError("has no header: this line holds numbers", where=where, hint=hint)
    below = (k for k in range(layout.header, len(lines)) if k + 1 not in layout.skipped)
    return CsvTable(
        source=source,
        layout=f"CSV in {encoding} separated by {SEPARATORS[layout.separator]}",
        names=layout.names,
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
    encodings = ["utf-8-sig", "latin-1"]
    for first, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
        bytes_ = data[first:2000:2]
        if len(bytes_) > 8 and bytes_.count(0) > 0.9 * len(bytes_):
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


def _seconds(cells: Sequence[str]) -> Floats:
    """Return the time of each cell from the first [s], shape (R,), NaN for a cell that holds none.

    A date counts only where it is ISO 8601. Whether 3/4 is in March or in April does not matter, since a time
    of day that falls by more than half a day has passed midnight.
    """
    ticks = np.array([clock(cell) for cell in cells], dtype=object)
    there = np.array([tick is not None for tick in ticks], dtype=bool)
    seconds, day = np.full(len(cells), np.nan), 86_400 * 10**9
    since = (ticks[there] - ticks[there][0]).astype(np.int64)
    midnights = np.cumsum(np.diff(since, prepend=since[0]) < -day // 2)
    seconds[there] = (since + day * midnights) / 1e9
    return seconds
