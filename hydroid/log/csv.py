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
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hydroid.errors import LogError
from hydroid.log.cells import clock, holds_number, number, seconds, split
from hydroid.log.table import Recording, Signal, Table
from hydroid.units import bare, unit_of

MAX_BYTES = 2**28
SEPARATORS = {"\t": "tabs", ";": "semicolons", ",": "commas", "|": "bars", " ": "spaces"}
IS_CSV = "a log is a CSV file with a header, one row a sample"


@dataclass(frozen=True, eq=False, kw_only=True)
class CsvTable(Table):
    """All lines of a file; `below` are the indices of those that hold data."""

    lines: Sequence[str]
    separator: str
    below: Sequence[int]

    def text(self, row: int, column: str) -> str:
        """Return the cell of a line [1-based] as it stands in the file."""
        cells, at = split(self.lines[row - 1], self.separator), self.names.index(column)
        return cells[at] if at < len(cells) else ""

    def read(self, signals: Sequence[Signal]) -> Recording:
        """Read columns, as `Table` says."""
        names, width = [signal.name for signal in signals], len(self.names)
        lines, remark = [self.lines[k] for k in self.below], f"read as {self.layout}"
        if self.separator != "," and any("," in line for line in lines):
            lines, remark = [line.replace(",", ".") for line in lines], f"{remark}, with decimal commas"
        wanted = [self.names.index(name) for name in names]
        rows, ragged = list[list[str]](), np.zeros(len(lines), bool)
        for k, line in enumerate(lines):
            cells = split(line, self.separator)
            ragged[k] = len(cells) < width or any(cells[width:])
            rows.append([""] * len(wanted) if ragged[k] else [cells[c] for c in wanted])
        remarks, clocks = [remark] if remark != "read as CSV in UTF-8 separated by commas" else [], set[str]()
        values = np.full((len(rows), len(names)), np.nan)
        for column, name in enumerate(names):
            texts = [row[column] for row in rows]
            if clock(next(filter(None, texts), "")) is None:
                values[:, column] = [number(text) for text in texts]
            else:
                values[:, column] = seconds(texts)
                clocks.add(name)
                remarks.append(f"{name} holds times of day, taken as seconds from the first")
        at = np.array(self.below, np.int64) + 1
        return Recording(self, tuple(signals), values, at, ragged, frozenset(clocks), tuple(remarks))


def open_csv(path: Path) -> CsvTable:
    """Read a file and find its table.

    Raises:
        LogError: it cannot be read, is not text, or has no header.
    """
    text, encoding = _decode(path)
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
        hint = "write the columns' names above it (a line that starts with # is a comment)"
        raise LogError(
            "has no header: this line holds numbers", where=f"{path}, line {header + 1}", hint=hint
        )
    of_units = [k for k in left_out if _are_units(rows[k])]
    pairs = [pair for k in of_units for pair in zip(names, map(bare, rows[k]), strict=True)]
    units = {name: unit for name, unit in pairs if name and unit}
    remarks = (
        [f"line {of_units[0] + 1} holds units ({', '.join(dict.fromkeys(units.values()))})"] if units else []
    )
    remarks += [f"line {k + 1} is text and left out" for k in left_out if k not in of_units]
    if content[0] < header:
        remarks.insert(0, f"the names are in line {header + 1}; what stands above is left out")
    return CsvTable(
        source=str(path),
        layout=f"CSV in {encoding} separated by {SEPARATORS[separator]}",
        names=tuple(names),
        header=header + 1,
        units=units,
        remarks=tuple(remarks),
        lines=lines,
        separator=separator,
        below=[k for k in content if k > header and k not in left_out and _is_content(lines[k], separator)],
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
    """Return a file's text and encoding."""
    data, hint = read_start(path), "save the sheet as CSV" if path.suffix.startswith(".xls") else IS_CSV
    if len(data) > MAX_BYTES:
        what = f"is larger than {MAX_BYTES >> 20} MiB"
        raise LogError(what, where=str(path), hint="cut it into several logs")
    wide = data.startswith((b"\xff\xfe", b"\xfe\xff"))
    for encoding in ("utf-16",) if wide else ("utf-8-sig", "latin-1"):
        with suppress(UnicodeDecodeError):
            text = data.decode(encoding)
            if "\0" not in text:
                return text, encoding.upper().removesuffix("-SIG")
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
