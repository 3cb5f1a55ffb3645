"""Bytes -> lines -> table: the CSV dialects that loggers and spreadsheets write.

Accepted: `,` `;` `|` tab, or spaces; decimal commas within quotes, or where the
separator is no comma; comment lines `#`, a byte order mark, UTF-8, UTF-16 or Latin-1,
any line ends, quoted cells, blank lines, dates and times of day; a preamble above the
names, and a row of units below them.
"""

from array import array
from codecs import IncrementalDecoder, getincrementaldecoder
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, islice
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from hydroid.arrays import record
from hydroid.errors import LogError
from hydroid.log.binary import FORMATS
from hydroid.log.csv_layout import CsvLayout, find_csv_layout, is_content
from hydroid.log.table import Recording, Signal, Table, TextColumn
from hydroid.progress import Progress, no_progress

IS_CSV = (
    f"formats of logs are {FORMATS}; a CSV file has a header and one row per sample"
)
SAMPLE = 400
"""number of lines by which separator, names and width are recognised"""
WATCHED = 20_000
"""number of lines between two reports of progress"""
PIECE = 256
"""number of lines whose cells are held as text at a time"""
PIECE_BYTES = 1 << 16
UTF_8 = "utf-8-sig"
UTF_16_MARKS = (b"\xff\xfe", b"\xfe\xff")


@record
class CsvTable(Table):
    """The numbers of a CSV file; the text of a cell is read again where a message shows
    it."""

    encoding: str
    layout: CsvLayout

    def read(self, signals: Sequence[Signal]) -> Recording:
        """Read columns; the recording does not keep the others."""
        recording = super().read(signals)
        return replace(recording, table=replace(self, columns={}))

    def text(self, name: str, row: int) -> str:
        """Read a cell anew, for a message; empty where its line has none."""
        assert self.lines is not None
        with Path(self.source).open(encoding=self.encoding) as file:
            before = int(self.lines[row]) - 1
            # the file may have been changed since
            line = next(islice(file, before, None), "")
        cells = self.layout.cells(line.rstrip("\n"))
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
    lines = _numbered(file)
    sample = _sample(lines)
    if not sample:
        raise LogError("is empty", path, IS_CSV)
    # the layout follows from the first lines: a log of hours is not held as text
    layout = find_csv_layout(sample, path)
    text_columns = [TextColumn() for _ in layout.names]
    line_numbers = array("q")
    decimal_commas = False
    data = _data_lines(sample, lines, layout)
    while piece := [*islice(data, PIECE)]:
        rows = [layout.cells(line) for _, line in piece]
        line_numbers.extend(number for number, _ in piece)
        if not decimal_commas:
            decimal_commas = any(layout.has_decimal_commas(line) for _, line in piece)
        cells_by_column = zip(*rows, strict=True)
        for column, cells in zip(text_columns, cells_by_column, strict=True):
            column.extend(cells)

    columns = dict[str, NDArray[Any]]()
    for name, column in zip(layout.names, text_columns, strict=True):
        columns[name] = column.values()
    numbers = np.zeros(0, np.int64)
    # without a copy of what may be millions; numpy has no view of nothing
    if line_numbers:
        numbers = np.frombuffer(line_numbers, np.int64)
    remarks = [*layout.remarks]
    if decimal_commas:
        remarks.append("commas are read as decimal points")
    return CsvTable(
        source=str(path),
        names=tuple(layout.names),
        columns=columns,
        header=layout.header,
        units=layout.units,
        remarks=tuple(remarks),
        lines=numbers,
        encoding=encoding,
        layout=layout,
    )


def _numbered(file: Iterable[str]) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(file, 1):
        yield number, line.rstrip("\n")


def _sample(lines: Iterator[tuple[int, str]]) -> dict[int, str]:
    """Take the first lines with content."""
    sample = dict[int, str]()
    for number, line in lines:
        if is_content(line):
            sample[number] = line
        if len(sample) == SAMPLE:
            break
    return sample


def _data_lines(
    sample: Mapping[int, str], others: Iterable[tuple[int, str]], layout: CsvLayout
) -> Iterator[tuple[int, str]]:
    """Yield the lines with data and their numbers, those of the sample first."""
    for number, line in chain(sample.items(), others):
        if number <= layout.header or number in layout.text_lines:
            continue
        # now that the separator is known, so are lines of empty cells
        if is_content(line, layout.separator):
            yield number, line


def _encoding(path: Path) -> str:
    """Return how a text is encoded: a byte that is no UTF-8 makes it Latin-1, wherever
    it stands."""
    with path.open("rb") as file:
        if file.read(2) in UTF_16_MARKS:
            return "utf-16"
        file.seek(0)
        decoder = getincrementaldecoder(UTF_8)()
        is_utf_8 = True
        line = 1
        while piece := file.read(PIECE_BYTES):
            text, nul, _ = piece.partition(b"\0")
            line += text.count(b"\n")
            if nul and is_utf_8 and line > 1:
                hint = "a logger keeps room by them, or lost power: cut the file there"
                where = f"{path}, line {line}"
                raise LogError("holds NUL bytes from here on", where, hint)
            if nul:
                raise _no_text(path)
            is_utf_8 = is_utf_8 and _decodes(decoder, piece)
        # the file may end within a letter of several bytes
        is_utf_8 = is_utf_8 and _decodes(decoder, b"", final=True)
        return UTF_8 if is_utf_8 else "latin-1"


def _decodes(decoder: IncrementalDecoder, piece: bytes, *, final: bool = False) -> bool:
    try:
        decoder.decode(piece, final=final)
    except UnicodeDecodeError:
        return False
    return True


def _no_text(path: Path) -> LogError:
    hint = "save the sheet as CSV" if path.suffix.startswith(".xls") else IS_CSV
    return LogError("is not a text file", path, hint)
