"""Which range the numbers of a command column have: percent, or what amplifiers and joysticks give."""

from dataclasses import dataclass

import numpy as np

from hydroid.log.log import Floats

TOLERANCE = 0.03  # of a range: converters overshoot, and joysticks do not rest exactly in the middle
LEAST_USE = 0.1  # part of half a range that a log uses on each side of its middle at least
RESTING = 0.05  # part of the samples that has the same value, for this to be the value at rest
MOST = 0.95  # part of the samples in which one of two directions rests, if they are those of one command
SYMMETRIC = {1.0: "±1", 10.0: "±10 V", 100.0: "%", 1000.0: "±1000", 32767.0: "±32767"}
"""ranges about 0, by their end"""
RAISED = {
    (4.0, 20.0): "4 to 20 mA",
    (0.0, 5.0): "0 to 5 V",
    (0.0, 10.0): "0 to 10 V",
    (0.0, 1.0): "0 to 1",
    (0.0, 100.0): "0 to 100",
    (0.0, 255.0): "0 to 255",
    (0.0, 1023.0): "0 to 1023",
    (0.0, 4095.0): "0 to 4095",
    (1000.0, 2000.0): "1000 to 2000 µs",
}
"""ranges whose middle stands for no command"""


@dataclass(frozen=True)
class CommandRange:
    """A range by its name, and what brings it to percent: command [%] = scale · cell + offset."""

    name: str
    scale: float
    offset: float = 0.0

    def remedy(self, gain: float, offset: float) -> dict[str, str]:
        """Return its name, and the settings that bring it to percent where those of the log are given."""
        offset = self.offset + self.scale * offset
        more = f" and log.command.offset: {offset:g}" if offset else ""
        return {"range": self.name, "scale": f"{self.scale * gain:g}{more}"}


def likely_range(values: Floats) -> CommandRange | None:
    """Return the range that fits the cells of one signed command column, shape (R,); None if none does."""
    values = values[~np.isnan(values)]
    if not len(values) or not values.any():
        return None
    low, high, rests = float(values.min()), float(values.max()), _rests(values)
    for (start, end), name in RAISED.items():
        middle, half = (start + end) / 2, (end - start) / 2
        slack = 2 * half * TOLERANCE
        inside = low >= max(0.0, start - slack) and high <= end + slack
        used = low < middle - LEAST_USE * half and high > middle + LEAST_USE * half
        if inside and used and any(abs(rest - middle) <= slack for rest in rests):
            return CommandRange(name, 100 / half, -100 * middle / half)
    fitting = (end for end in SYMMETRIC if max(-low, high) <= end * (1 + TOLERANCE))
    end = next(fitting, None)
    return None if end is None else CommandRange(SYMMETRIC[end], 100 / end)


def likely_pair(positive: Floats, negative: Floats) -> CommandRange | None:
    """Return the range that fits the cells of a command of two columns, one for each direction."""
    low, high = 4.0, 20.0  # of a current loop [mA]: no command, and all of it
    slack = TOLERANCE * (high - low)
    both = np.stack([positive, negative])
    at_rest = np.mean((abs(both - low) <= slack).any(axis=0))
    if both.min() >= low - slack and both.max() <= high + slack and at_rest > MOST:
        return CommandRange("4 to 20 mA on each side", 100 / (high - low), -100 * low / (high - low))
    return likely_range(positive - negative)


def _rests(values: Floats) -> list[float]:
    """Return the values that may be that of a command at rest: the first, and the most common one.

    None where 0 is common: this is then the value at rest.
    """
    kinds, counts = np.unique(values, return_counts=True)
    common = kinds[counts >= RESTING * len(values)]
    return [] if 0 in common else [float(values[0]), float(kinds[counts.argmax()])]
