"""The cells of a line of text: how it is split, and which cells hold numbers or times of day."""

import csv
import re
from collections.abc import Sequence

import numpy as np

from hydroid.log.log import Floats

TIME = re.compile(
    r"(?:.*[T ])?(\d{1,2}):(\d{2}):(\d{2})(?:[.,](\d{1,9})\d*)? *([AaPp])?\.?[Mm]?\.?(?:Z|[+-][\d:]+)?"
)
"""a time of day, behind a date or without one"""


def split(line: str, separator: str) -> list[str]:
    """Return the cells of a line; of a line in columns of spaces, however many part them."""
    spaces = separator == " "
    if '"' in line:
        line = line.strip() if spaces else line
        cells = next(csv.reader([line], delimiter=separator, skipinitialspace=spaces))
    else:
        cells = line.split(None if spaces else separator)
    return [cell.strip() for cell in cells]


def number(cell: str) -> float | None:
    """Return what float() reads, but for the digit groups of Python's literals (1_000); None: no number."""
    try:
        return float(cell) if "_" not in cell else None
    except ValueError:
        return None


def clock(cell: str) -> int | None:
    """Return the time of day in a cell [ns]; None: there is none."""
    match = TIME.fullmatch(cell) if len(cell) < 50 else None
    if match is None:
        return None
    hour, minute, second, fraction, half = match.groups()
    hours = int(hour) % 12 + 12 * (half in "Pp") if half else int(hour)
    return ((hours * 60 + int(minute)) * 60 + int(second)) * 10**9 + int((fraction or "0").ljust(9, "0"))


def holds_number(cell: str) -> bool:
    """Return whether a cell holds a number, maybe with a decimal comma, or a time."""
    return number(cell.replace(",", ".")) is not None or clock(cell) is not None


def seconds(cells: Sequence[str]) -> Floats:
    """Return the time of each cell from the first [s], shape (R,), NaN for a cell that holds none.

    Dates do not count, which programs write in many ways: a time of day that falls by more than half a day
    has passed midnight.
    """
    ticks = [clock(cell) for cell in cells]
    there = np.array([tick is not None for tick in ticks])
    times = np.array([tick for tick in ticks if tick is not None], np.int64)
    midnights = np.cumsum(np.diff(times, prepend=times[0]) < -43_200 * 10**9)
    result = np.full(len(cells), np.nan)
    result[there] = (times - times[0] + 86_400 * 10**9 * midnights) / 1e9
    return result
