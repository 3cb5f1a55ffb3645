"""What the numbers of a command are in: one table of signals serves `init`, `check` and
the docs."""

from typing import NamedTuple

import numpy as np

from hydroid.arrays import Array
from hydroid.files import read_table
from hydroid.units import unit_of

SLACK = 0.06
"""part of half a range by which converters overshoot, and by which joysticks rest
beside the middle"""
USED = 0.1
"""part of half a range beyond which both sides of the middle are used"""
FARTHEST_REST = 0.3
"""part of half a range by which a command may rest beside the middle"""
COMMON = 0.05
"""part of the samples that makes 0 a command that is really given"""


class CommandRange(NamedTuple):
    """A range by its name, and what brings it to percent: command [%] = scale · cell +
    offset."""

    name: str
    scale: float
    offset: float

    def remedy(self, gain: float, offset: float) -> dict[str, str]:
        """Return its name, and the settings that bring it to percent where those of the
        log are given."""
        offset = self.offset + self.scale * offset
        more = f" and log.command.offset: {offset:g}" if offset else ""
        return {"range": self.name, "scale": f"{self.scale * gain:g}{more}"}

    def with_overshoot(self, values: Array) -> "CommandRange":
        """Return a range in which no cell is beyond 100 %, for converters that
        overshoot."""
        most = float(np.nanmax(np.abs(self.scale * values + self.offset))) / 100
        if most <= 1 + 1e-8:
            return self
        scale, offset = (
            float(f"{one / (most + 1e-5):.6g}") for one in (self.scale, self.offset)
        )
        return self._replace(scale=scale, offset=offset)


class Signal(NamedTuple):
    """A row of the table: from `low` over no command to `high`."""

    name: str
    low: float
    high: float
    full: bool
    unit: str

    @property
    def half(self) -> float:
        """From no command to the whole one."""
        return (self.high - self.low) / 2

    @property
    def middle(self) -> float:
        """What stands for no command."""
        return (self.low + self.high) / 2

    @property
    def slack(self) -> float:
        """By how much numbers may be off."""
        return SLACK * self.half / (1 + (self.low < 0))

    @property
    def range(self) -> CommandRange:
        """What brings it to percent."""
        scale = 100 / self.half
        return CommandRange(self.name, scale, -scale * self.middle)


SIGNALS = tuple(
    Signal(name, row["from"], row["to"], row.get("full", False), row.get("unit", ""))
    for name, row in read_table("log/signals.yaml").items()
)
ON_EACH_SIDE = CommandRange("4 to 20 mA on each side", 6.25, -25.0)
"""of a column for each direction, of which one rests"""


def likely_range(
    values: Array, negative: Array | None = None, unit: str = ""
) -> CommandRange | None:
    """Return the range that fits the cells of a command, shape (R,), or of its two
    directions, or None.

    Converters overshoot, and joysticks do not rest exactly in the middle. A range with
    a positive middle must be used on both sides of it, and rest there: first or most of
    the time. `unit`: of the cells, if stated.
    """
    if negative is not None:
        both = np.stack([values, negative])
        both = both[:, ~np.isnan(both).any(axis=0)]
        if not both.size:
            return None
        if _rest_at_four(both):
            return ON_EACH_SIDE
        values = both[0] - both[1]
    values = values[~np.isnan(values)]
    if not values.any():
        return None
    kinds, counts = np.unique(values, return_counts=True)
    rests = values[0], kinds[counts.argmax()]
    zero_is_given = 0 in kinds[counts >= COMMON * len(values)]
    for signal in SIGNALS:
        if _fits(signal, values.min(), values.max(), unit) and (
            signal.low < 0 or _rests_in_the_middle(signal, values, rests, zero_is_given)
        ):
            return signal.range
    return None


def resting_range(
    values: Array, likely: CommandRange | None, usual: CommandRange | None
) -> tuple[float, CommandRange] | None:
    """Return where a command rests that rests beside the middle of its range, and the
    range from there.

    Cells are in the `likely` range, or in the `usual` one of the log's other commands,
    whose whole it does not leave. None: it rests in the middle, or the log does not
    tell: it begins at rest and rests most of the time.
    """
    values = values[~np.isnan(values)]
    kinds, counts = np.unique(values, return_counts=True)
    if not len(kinds) or values[0] != kinds[counts.argmax()]:
        return None
    rest = float(values[0])
    for own in (likely if likely and likely.offset else None, usual):
        if own is None:
            continue
        percent = own.scale * values + own.offset
        off = own.scale * rest + own.offset
        within = np.abs(percent).max() <= 100 * (1 + SLACK)
        if 0 < abs(off) <= 100 * FARTHEST_REST and within:
            return rest, own._replace(offset=float(f"{-own.scale * rest:.6g}"))
    return None


def _rest_at_four(both: Array) -> bool:
    at_rest = np.mean((abs(both - 4) <= 0.48).any(axis=0))
    return bool(both.min() >= 3.52 and both.max() <= 20.48 and at_rest > 0.95)


def _fits(signal: Signal, low: float, high: float, unit: str) -> bool:
    slack = signal.slack
    if low < signal.low - slack or high > signal.high + slack:
        return False
    if signal.full:
        ends = [low <= signal.low + slack, high >= signal.high - slack]
        if not (any(ends) if signal.low < 0 else all(ends)):
            return False
    if signal.unit and signal.unit != unit:
        return False
    own = unit_of(signal.name.split()[-1])
    stated = unit_of(unit) if unit else None
    return own is None or stated is None or own.quantity == stated.quantity


def _rests_in_the_middle(
    signal: Signal, values: Array, rests: tuple[float, float], zero_is_given: bool
) -> bool:
    near = [bool(abs(rest - signal.middle) <= signal.slack) for rest in rests]
    enough = all(near) if zero_is_given else any(near)  # else 0 is no command
    below = values.min() < signal.middle - USED * signal.half
    above = values.max() > signal.middle + USED * signal.half
    return bool(enough and below and above)
