"""Which range the numbers of a command column have: percent, or what amplifiers and joysticks give."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hydroid.log.log import Floats

TOLERANCE = 0.03  # of a range: converters overshoot, and joysticks do not rest exactly in the middle
LEAST_USE = 0.1  # part of half a range that a log uses on each side of its middle at least
RESTING = 0.05  # part of the samples that has the same value, for this to be the value at rest
SYMMETRIC = {1.0: "±1", 10.0: "±10 V", 100.0: "%", 1000.0: "±1000", 32767.0: "±32767"}
"""ranges about 0, by their end"""
LOOP = (4.0, 20.0)
"""a current loop of one direction [mA]: no command, and all of it"""
MOST = 0.95
"""part of the samples in which one of the two directions rests, if they are those of one command"""
RAISED = {
    "4 to 20 mA": (4.0, 20.0),
    "0 to 5 V": (0.0, 5.0),
    "0 to 10 V": (0.0, 10.0),
    "0 to 1": (0.0, 1.0),
    "0 to 100": (0.0, 100.0),
    "0 to 255": (0.0, 255.0),
    "0 to 1023": (0.0, 1023.0),
    "0 to 4095": (0.0, 4095.0),
    "1000 to 2000 µs": (1000.0, 2000.0),
}
"""ranges whose middle stands for no command"""


@dataclass(frozen=True)
class CommandRange:
    """A range by its name, and what brings it to percent: command [%] = scale · cell + offset."""

    name: str
    scale: float
    offset: float


def likely_range(values: Floats) -> CommandRange | None:
    """Return the range that fits the cells of one signed command column, shape (R,); None if none does."""
    values = values[~np.isnan(values)]
    if not len(values) or not values.any():
        return None
    low, high = float(values.min()), float(values.max())
    raised = next(_raised(low, high, _rests(values)), None) if low >= 0 else None
    if raised:
        return raised
    largest = max(-low, high)
    end = next((end for end in SYMMETRIC if largest <= end * (1 + TOLERANCE)), None)
    return None if end is None else CommandRange(SYMMETRIC[end], 100 / end, 0.0)


def likely_pair(positive: Floats, negative: Floats) -> CommandRange | None:
    """Return the range that fits the cells of a command of two columns, one for each direction."""
    low, high = LOOP
    slack = TOLERANCE * (high - low)
    both = np.concatenate([positive, negative])
    at_rest = np.mean((abs(positive - low) <= slack) | (abs(negative - low) <= slack))
    if both.min() >= low - slack and both.max() <= high + slack and at_rest > MOST:
        return CommandRange("4 to 20 mA on each side", 100 / (high - low), -100 * low / (high - low))
    return likely_range(positive - negative)


def _raised(low: float, high: float, rests: list[float]) -> Iterator[CommandRange]:
    for name, (start, end) in RAISED.items():
        middle, half = (start + end) / 2, (end - start) / 2
        slack = 2 * half * TOLERANCE
        inside = start - slack <= low and high <= end + slack
        used = low < middle - LEAST_USE * half and high > middle + LEAST_USE * half
        if inside and used and any(abs(rest - middle) <= slack for rest in rests):
            yield CommandRange(name, 100 / half, -100 * middle / half)


def _rests(values: Floats) -> list[float]:
    """Return the values that may be that of a command at rest: the first, and the most common one.

    None where 0 is common: this is then the value at rest.
    """
    kinds, counts = np.unique(values, return_counts=True)
    common = kinds[counts >= RESTING * len(values)]
    return [] if 0 in common else [float(values[0]), float(kinds[counts.argmax()])]
