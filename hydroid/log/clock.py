"""Cells that hold dates or times of day -> seconds from the first."""

import re
from collections.abc import Sequence
from datetime import date

import numpy as np

from hydroid.log.log import Floats
from hydroid.settings.log import SECONDS

DAY = 86_400 * 10**9  # [ns]
_TIME = re.compile(
    r"(?:.*?[T ])?(\d{1,2}):(\d{2}):(\d{2})(?:[.,](\d{1,9})\d*)? *([AaPp])?\.?[Mm]?\.?(?:Z|[+-][\d:]+)?"
)
_ISO_DATE = re.compile(r"(\d{4})-?(\d{2})-?(\d{2})[T ]")


def likely_unit(step: float) -> str:
    """Return the unit in which a step between samples is one of 2 to 1000 samples a second; "": in none."""
    units = ("s", "ms", "us", "ns", "min", "day")
    return next((name for name in units if 9e-4 < step * SECONDS[name] < 0.6), "")


def is_clock(cell: str) -> bool:
    """Return whether a cell holds a time of day, such as 12:30:05.25 or 2024-05-01T12:30:05."""
    return len(cell) < 50 and _TIME.fullmatch(cell.strip()) is not None


def clock_seconds(cells: Sequence[str]) -> Floats:
    """Return the time of each cell from the first [s], shape (R,), NaN for a cell that holds none.

    Dates count where they are ISO 8601 (2024-05-01). Other dates are not read: whether 3/4 is in March or in
    April does not matter, since a time of day that falls by more than half a day has passed midnight.
    """
    ticks = np.array([_nanoseconds(cell.strip()) for cell in cells], dtype=object)
    there = np.array([tick is not None for tick in ticks], dtype=bool)
    seconds = np.full(len(cells), np.nan)
    if there.any():
        since = (ticks[there] - ticks[there][0]).astype(np.int64)
        midnights = np.cumsum(np.diff(since, prepend=since[0]) < -DAY // 2)
        seconds[there] = (since + DAY * midnights) / 1e9
    return seconds


def _nanoseconds(cell: str) -> int | None:
    found = _TIME.fullmatch(cell) if len(cell) < 50 else None
    if found is None:
        return None
    hours, minutes, seconds, fraction, half = found.groups()
    hour = int(hours) % 12 + 12 * (half in "Pp") if half else int(hours)
    ticks = (3600 * hour + 60 * int(minutes) + int(seconds)) * 10**9 + int((fraction or "0").ljust(9, "0"))
    day = _ISO_DATE.match(cell)
    try:
        return ticks + (DAY * date(*map(int, day.groups())).toordinal() if day else 0)
    except ValueError:  # such as the 31st of February
        return None
