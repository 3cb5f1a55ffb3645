"""Positions as a sensor gives them, in V, mA or counts, of which nobody has stated the
scale."""

import numpy as np

from hydroid.arrays import Array
from hydroid.files import Plain
from hydroid.log.columns import Column, Entry

TURNS = (
    *(2**bits for bits in range(8, 21)),
    *(digit * 10**zeros for zeros in range(1, 6) for digit in (36, 100, 200, 250, 500)),
)
"""counts of a turn of usual encoders"""
WRAPS = 0.75
"""part of all counts from which a step is a new turn"""
NEAR = 0.25
"""part of all counts that no other step reaches"""
ALIKE = 0.01
"""part of a turn by which a leap may differ from it"""


def over_the_joint(
    column: Column, limits: tuple[float, float] | None, *, slides: bool
) -> Entry:
    """Return the settings of a column over a joint's range [rad, m]; none where the
    joint turns without an end and the column tells no scale either."""
    by_turns = None if slides else _by_turns(column, limits)
    if by_turns is not None:
        return by_turns
    if limits is None:
        what = (
            "left out, for a joint without ends tells no scale: give scale and offset,"
        )
        return Entry({}, f"{column.name}: {what}")
    if slides:
        return over_the_range(column, limits, "m", "range")
    low, high = np.degrees(limits)
    return over_the_range(column, (float(low), float(high)), "deg", "range")


def _by_turns(column: Column, limits: tuple[float, float] | None) -> Entry | None:
    """Return the settings of an encoder that begins anew after each turn of a joint,
    which tells its scale; None: it does not, or its joint cannot turn so far.

    Its zero is not known: the log is taken for the middle of the joint's range.
    """
    finite = column.values[np.isfinite(column.values)]
    turn = counts_of_a_turn(finite)
    if turn is None:
        return None
    steps = np.diff(finite)
    turns = np.cumsum(np.sign(steps) * (np.abs(steps) > turn / 2))
    joined = finite - turn * np.concatenate([[0], turns])
    scale = 360 / turn
    middle_of_range = 0.0
    if limits is not None:
        low, high = np.degrees(limits).tolist()
        # an encoder on a faster shaft turns more often than its joint
        if scale * np.ptp(joined) > high - low:
            return None
        middle_of_range = (low + high) / 2
    middle = ((joined.min() + joined.max()) / 2, middle_of_range)
    return Entry(
        _through(column, "deg", scale, middle),
        f"{column.name}: angle by {turn:g} counts a turn",
        "the log is taken for the middle of the range: correct offset",
        _through(column, "deg", -scale, middle),
    )


def counts_of_a_turn(counts: Array) -> float | None:
    """Return how many counts a turn has of an encoder that begins anew after each, from
    its counts, (R,).

    None: it does not, or no encoder has as many.
    """
    span = np.ptp(counts)
    steps = np.diff(counts)
    wraps = np.abs(steps) > WRAPS * span
    if not wraps.any() or np.abs(steps[~wraps]).max(initial=0) > NEAR * span:
        return None
    # the joint moves on while the counts leap back
    moved = np.median(np.abs(steps[~wraps])) if not wraps.all() else 0.0
    leap = np.median(np.abs(steps[wraps])) + moved
    nearest = min(TURNS, key=lambda turn: abs(turn - leap))
    return float(nearest) if abs(nearest - leap) < ALIKE * nearest else None


def over_the_range(
    column: Column, ends: tuple[float, float], unit: str, whole: str
) -> Entry:
    """Return the settings of a column whose cells are taken for all that a joint can
    do.

    `ends` of that are in the unit; the lowest cell is the first of them, or if the
    sensor counts the other way the last.
    """
    low, high = column.ends
    least, most = ends
    signal = column.unit or "counts"
    # a reading that never changes has no span, and tells nothing of its ends
    span = high - low or 1.0
    scale = (most - least) / span
    each = f"{scale:.3g} {unit} per {signal.removesuffix('s')}"
    reach = f"{low:g} to {high:g} {signal}, {least:.4g} to {most:.4g} {unit} ({each})"
    return Entry(
        _through(column, unit, scale, (low, least)),
        f"{column.name}: {reach}, taken for the whole {whole}",
        "correct scale and offset if you know them, or if no log reaches both ends",
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
