"""Bytes -> lines -> table: the CSV dialects that loggers and spreadsheets write.

Accepted: `,` `;` `|` tab, or spaces; decimal commas where the separator is no comma,
comment lines `#`, a byte order mark, UTF-8, UTF-16 or Latin-1, any line ends, quoted
cells, blank lines, dates and times of day.

Loggers write a preamble above the names, or a row of units below them. The data begin
with the first line that has a number in the first column of numbers, and half as many
as most lines; the names stand above it. A line below the names is left out only if it
holds no number: any other fault there is a fault of the data.
"""

import csv
from array import array
from codecs import getincrementaldecoder
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, islice, pairwise
from pathlib import Path
from typing import TextIO

import numpy as np

from hydroid.arrays import record
from hydroid.errors import LogError
from hydroid.log.binary import FORMATS
from hydroid.log.table import Recording, Signal, Table, TextColumn, clock, number
from hydroid.progress import Progress, no_progress
from hydroid.units import bare, unit_of
from hydroid.words import listed

SEPARATORS = "\t;,| "
# a longer cell is no number, which is said, with its place
csv.field_size_limit(2**31 - 1)
IS_CSV = (
    f"formats of logs are {FORMATS}; a CSV file has a header and one row per sample"
)


SAMPLE = 400  # lines by which separator, names and width are recognised
WATCHED = 20_000  # lines between two reports of progress
PIECE = 256  # lines whose cells are held as text at a time


@record
class CsvTable(Table):
    """The numbers of a CSV file; the text of a cell is read again where a message shows
    it."""

    encoding: str
    split_row: Callable[[str], list[str]]

    def read(self, signals: Sequence[Signal]) -> Recording:
        """Read columns; the recording does not keep the others."""
        recording = super().read(signals)
        return replace(recording, table=replace(self, columns={}))

    def text(self, name: str, row: int) -> str:
        """Read a cell anew, for a message; empty where its line has none."""
        assert self.lines is not None
        with Path(self.source).open(encoding=self.encoding) as file:
            line = next(islice(file, int(self.lines[row]) - 1, None), "")
        cells = self.split_row(line.rstrip("\n"))
        return cells[self.names.index(name)]


def open_csv(path: Path, progress: Progress = no_progress) -> Table:
    """Find the table in a file, whose lines are read one after the other."""
    encoding = _encoding(path)
    try:
        with path.open(encoding=encoding) as file:
            return _read_table(path, encoding, _watched(file, path, progress))
    except UnicodeDecodeError:
        raise _no_text(path) from None


def _watched(file: TextIO, path: Path, progress: Progress) -> Iterator[str]:
    """Yield lines, and report how much of the file is read [MB]."""
    size = path.stat().st_size // 1_000_000
    for row, line in enumerate(file):
        if row % WATCHED == 0:
            progress(f"reading {path.name}, MB", file.buffer.tell() // 1_000_000, size)
        yield line


def _read_table(path: Path, encoding: str, file: Iterable[str]) -> Table:
    lines = enumerate((line.rstrip("\n") for line in file), 1)
    sample = dict(islice(((k, line) for k, line in lines if _is_content(line)), SAMPLE))
    if not sample:
        raise LogError("is empty", path, IS_CSV)
    separator = _separator([*sample.values()])
    rows = {k: split(line, separator) for k, line in sample.items()}
    header, left_out = _header(rows)
    names = rows[header]
    if all(number(name.replace(",", ".")) is not None for name in names if name):
        hint = (
            "write the columns' names above it (a line that starts with # is a comment)"
        )
        raise LogError(
            "has no header: this line holds numbers", f"{path}, line {header}", hint
        )
    if len(names) == 1:
        raise LogError(
            "has one column only", path, "part cells by , ; | tabs or spaces"
        )
    above = f"the names are in line {header}; what stands above is left out"
    remarks = [above] if next(iter(sample)) < header else []
    remarks += [f"line {k} is text and left out" for k in left_out]
    cells_of_units = (
        zip(names, map(bare, rows[k]), strict=True)
        for k in left_out
        if _are_units(rows[k])
    )
    units = dict(chain.from_iterable(cells_of_units))
    below = {k: line for k, line in sample.items() if k > header and k not in left_out}
    usual = _usual_width([rows[k] for k in below], len(names))
    if usual < len(names):
        remarks.append(f"lines hold {usual} cells: {listed(names[usual:], 3)} has none")
    elif usual > len(names):
        remarks.append("the first column has no name")
        names = ["", *names]
    decimal_comma = separator != ","

    def split_row(line: str) -> list[str]:
        """Return as many cells as there are names; empty ones of a line that has fewer
        or more."""
        if decimal_comma and "," in line:
            line = line.replace(",", ".")
        row = split(line, separator)
        if len(row) == usual < len(names):
            return row + [""] * (len(names) - usual)
        whole = len(row) >= len(names) and not any(row[len(names) :])
        return row[: len(names)] if whole else [""] * len(names)

    columns, at, commas = [TextColumn() for _ in names], array("q"), False
    data = (
        (k, line)
        for k, line in chain(below.items(), lines)
        if _is_content(line, separator)
    )
    while piece := [*islice(data, PIECE)]:
        commas |= decimal_comma and any("," in line for _, line in piece)
        at.extend(k for k, _ in piece)
        cells = [split_row(line) for _, line in piece]
        for column, own in zip(columns, zip(*cells, strict=True), strict=True):
            column.extend(own)
    if commas:
        remarks.append("commas are read as decimal points")
    return CsvTable(
        source=str(path),
        names=tuple(names),
        columns={
            name: column.values() for name, column in zip(names, columns, strict=True)
        },
        header=header,
        units=units,
        remarks=tuple(remarks),
        lines=np.frombuffer(at, np.int64) if at else np.zeros(0, np.int64),
        encoding=encoding,
        split_row=split_row,
    )


def _usual_width(rows: Sequence[Sequence[str]], names: int) -> int:
    """Return how many cells lines have, where that is not as many as names: fewer, or a
    row's number more.

    Lines that differ from each other are torn ones, but for separators at their ends.
    """
    widths = {len(row) for row in rows}
    if len(rows) < 2 or len(widths) > 1:
        return names
    (width,) = widths
    if width == names + 1:
        numbers = [number(row[0]) for row in rows]
        named = all(row[-1] for row in rows) and _counts_up(numbers)
        return width if named else names
    return width if names // 2 < width < names else names


def _counts_up(numbers: Sequence[float | None]) -> bool:
    return all(one is not None and other == one + 1 for one, other in pairwise(numbers))


def _encoding(path: Path) -> str:
    """Return how a text is encoded: a byte that is no UTF-8 makes it Latin-1, wherever
    it stands."""
    with path.open("rb") as file:
        if file.read(2) in (b"\xff\xfe", b"\xfe\xff"):
            return "utf-16"
        file.seek(0)
        decoder, encoding, line = getincrementaldecoder("utf-8-sig")(), "utf-8-sig", 1
        while piece := file.read(1 << 16):
            text, nul, _ = piece.partition(b"\0")
            line += text.count(b"\n")
            if nul and line > 1 and encoding == "utf-8-sig":
                hint = "a logger keeps room by them, or lost power: cut the file there"
                raise LogError(
                    "holds NUL bytes from here on", f"{path}, line {line}", hint
                )
            if nul:
                raise _no_text(path)
            if encoding == "utf-8-sig":
                try:
                    decoder.decode(piece)
                except UnicodeDecodeError:
                    encoding = "latin-1"
        try:
            decoder.decode(b"", final=True)
        except UnicodeDecodeError:
            return "latin-1"
        return encoding


def _no_text(path: Path) -> LogError:
    hint = "save the sheet as CSV" if path.suffix.startswith(".xls") else IS_CSV
    return LogError("is not a text file", path, hint)


def split(line: str, separator: str) -> list[str]:
    """Return the cells of a line; of a line in columns of spaces, however many part
    them."""
    spaces = separator == " "
    if '"' in line:
        line = line.strip() if spaces else line
        cells = next(csv.reader([line], delimiter=separator, skipinitialspace=spaces))
    else:
        cells = line.split(None if spaces else separator)
    return [cell.strip() for cell in cells]


def _separator(sample: Sequence[str]) -> str:
    """Choose what parts most lines into the same number of numbers, or parts any line
    at all."""

    def merit(separator: str) -> tuple[int, bool, int]:
        rows = [split(line, separator) for line in sample]
        counts = Counter(len(_numbers(row)) * (len(row) > 1) for row in rows)
        most = max(numbers * lines for numbers, lines in counts.items())
        return most, separator != " ", max(map(len, rows))

    return max(SEPARATORS, key=merit)


def _header(rows: Mapping[int, Sequence[str]]) -> tuple[int, list[int]]:
    """Return the line of names among lines of cells, and the lines of text between it
    and the data."""
    numbers = {k: _numbers(row) for k, row in rows.items()}
    common = Counter(map(len, numbers.values()))
    usual = max(common, key=lambda n: (n * common[n], n))
    pattern = Counter(at for at in numbers.values() if len(at) == usual).most_common(1)[
        0
    ][0]
    data = (
        k
        for k, at in numbers.items()
        if pattern and pattern[0] in at and 2 * len(at) >= usual
    )
    first = next(data, max(rows) + 1)
    texts = {
        k: [*filter(None, row)]
        for k, row in rows.items()
        if k < first and not numbers[k]
    }
    texts = {k: cells for k, cells in texts.items() if len(cells) >= max(usual / 2, 1)}
    named = [k for k in texts if not _are_units(texts[k])] or texts
    # names differ, are many, and stand below other texts
    order = {k: (len({*texts[k]}) == len(texts[k]), len(texts[k]), k) for k in named}
    header = max(order, key=lambda k: order[k], default=next(iter(rows)))
    return header, [
        k for k in texts if k > header and len(rows[k]) == len(rows[header])
    ]


def _numbers(row: Sequence[str]) -> tuple[int, ...]:
    """Return which cells hold a number, maybe with a decimal comma, or a time."""
    return tuple(
        c
        for c, x in enumerate(row)
        if number(x.replace(",", ".")) is not None or clock(x) is not None
    )


def _is_content(line: str, separator: str = ",") -> bool:
    """Return whether a line is neither blank, nor empty cells, nor a comment, nor names
    a separator."""
    return line.strip(" \t" + separator)[:1] not in ("", "#") and not line.startswith(
        "sep="
    )


def _are_units(row: Sequence[str]) -> bool:
    return any(row) and all(map(unit_of, filter(None, row)))
