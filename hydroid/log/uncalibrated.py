"""Positions as a sensor gives them, in V, mA or counts, of which nobody has stated the
scale."""

import numpy as np

from hydroid.files import Plain
from hydroid.log.columns import Column, Entry


def over_the_joint(
    column: Column, limits: tuple[float, float], *, slides: bool
) -> Entry:
    """Return the settings of a column over a joint's range [rad, m]."""
    if slides:
        return over_the_range(column, limits, "m", "range")
    low, high = np.degrees(limits)
    return over_the_range(column, (float(low), float(high)), "deg", "range")


def over_the_range(
    column: Column, ends: tuple[float, float], unit: str, whole: str
) -> Entry:
    """Return the settings of a column whose cells are taken for all that a joint can
    do.

    `ends` of that are in the unit; the lowest cell is the first of them, or if the
    sensor counts the other way the last.
    """
    finite = column.values[np.isfinite(column.values)]
    low = float(finite.min())
    high = float(finite.max())
    least, most = ends
    signal = column.unit or "counts"
    reach = f"{low:g} to {high:g} {signal}, taken for the whole {whole}"
    hint = "correct scale and offset where the log does not reach both ends,"
    what = f"{reach}, {least:.4g} to {most:.4g} {unit}: {hint}"
    # a reading that never changes has no span, and tells nothing of its ends
    span = high - low or 1.0
    scale = (most - least) / span
    return Entry(
        _through(column, unit, scale, (low, least)),
        f"{column.name}: {what}",
        _through(column, unit, -scale, (low, most)),
    )


def _through(
    column: Column, unit: str, scale: float, point: tuple[float, float]
) -> Plain:
    """Return settings of few digits by which a cell has a value, those of a `point`."""
    cell, value = point
    scale = float(f"{scale:.6g}")
    # encoders may count from a million
    offset = float(f"{value - scale * cell:.9g}")
    return {"column": column.name, "unit": unit, "scale": scale, "offset": offset}
