"""What the numbers of a command are in: one table of signals serves `init`, `check` and
the docs."""

from collections.abc import Sequence
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
NEAR_ZERO = 0.1
"""part of the farthest count to which others come near 0"""
COMMON = 0.05
"""part of the samples that makes 0 a command that is really given"""
EXACT = 0.02
"""part of half a range within which a command rests in its middle, and nowhere else"""


class CommandRange(NamedTuple):
    """A range by its name, and what brings it to percent: command [%] = scale · cell +
    offset."""

    name: str
    scale: float
    offset: float

    def remedy(self, setting: str, gain: float, offset: float) -> dict[str, str]:
        """Return its name, and the settings under a key that bring it to percent where
        those of the log are given."""
        offset = self.offset + self.scale * offset
        remedy = f"{setting}.scale: {self.scale * gain:g}"
        if offset:
            remedy += f" and {setting}.offset: {offset:g}"
        return {"range": self.name, "remedy": remedy}

    @property
    def counts_around_zero(self) -> bool:
        """Whether no command is 0, and the whole one more than 100."""
        return not self.offset and self.scale < 1

    @property
    def excludes_zero(self) -> bool:
        """Whether a cell of 0 is no command, but a lost signal."""
        return is_lost_signal(self.offset)

    def with_overshoot(self, values: Array) -> "CommandRange":
        """Return a range in which no cell is beyond 100 %, for converters that
        overshoot; 0 does not count where it is a lost signal."""
        if self.excludes_zero:
            values = np.where(values == 0, np.nan, values)
        percent = np.abs(self.scale * values + self.offset)
        most = float(np.nanmax(percent)) / 100
        if most <= 1 + 1e-8:
            return self
        # six digits, rounded to either side, still hold the largest cell
        smaller = most + 1e-5
        scale = float(f"{self.scale / smaller:.6g}")
        offset = float(f"{self.offset / smaller:.6g}")
        return self._replace(scale=scale, offset=offset)


def is_lost_signal(offset: float) -> bool:
    """Return whether a cell of 0, which reads as the offset of its settings [%], is
    farther from rest than any command."""
    return abs(offset) > 100 * (1 + SLACK)


class CommandSignal(NamedTuple):
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
        """By how much numbers may be off, in a range around 0 half as much."""
        slack = SLACK * self.half
        if self.low < 0:
            return slack / 2
        return slack

    @property
    def range(self) -> CommandRange:
        """What brings it to percent."""
        scale = 100 / self.half
        return CommandRange(self.name, scale, -scale * self.middle)


def _signals() -> tuple[CommandSignal, ...]:
    """Return the rows of `signals.yaml`, in its order."""
    signals = list[CommandSignal]()
    for name, row in read_table("log/signals.yaml").items():
        full = row.get("full", False)
        unit = row.get("unit", "")
        signals.append(CommandSignal(name, row["from"], row["to"], full, unit))
    return tuple(signals)


SIGNALS = _signals()
ON_EACH_SIDE = CommandRange("4 to 20 mA on each side", 6.25, -25.0)
"""of a column for each direction, of which one rests"""


def likely_range(
    values: Array, negative: Array | None = None, unit: str = ""
) -> CommandRange | None:
    """Return the range that fits the cells of a command, shape (R,), or of its two
    directions, or None.

    Converters overshoot, and joysticks do not rest exactly in the middle. A range with
    a positive middle must be used on both sides of it, and rest there: first or most of
    the time; or be used on one side, and rest exactly there. Receivers without a signal
    give 0 for a while. A command that never changes tells no range. `unit`: of the
    cells, if stated.
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
    if not len(values) or np.ptp(values) == 0:
        return None
    received = values[values != 0]
    if 0 < len(values) - len(received) < COMMON * len(values):
        found = _first_range(
            [signal for signal in SIGNALS if signal.range.excludes_zero], received, unit
        )
        if found is not None:
            return found
    return _first_range(SIGNALS, values, unit)


def _first_range(
    signals: Sequence[CommandSignal], values: Array, unit: str
) -> CommandRange | None:
    """Return the range of the first signal that fits cells, shape (R,), in a unit; None:
    none does."""
    if not len(values):
        return None
    fitting = [
        signal for signal in signals if _fits(signal, values.min(), values.max(), unit)
    ]
    rests = values[0], _most_frequent(values)
    proofs = _rests_in_the_middle, _comes_near_zero, _rests_beside, _is_around_zero
    for is_proved in proofs:
        for signal in fitting:
            if is_proved(signal, values, rests):
                return signal.range
    return None


def of_one_scale(
    ranges: Sequence[CommandRange | None],
) -> list[CommandRange | None]:
    """Return the ranges of the commands of one log: of those that count around 0, beyond
    100, all have the widest."""
    counts = [found for found in ranges if found and found.counts_around_zero]
    widest = min(counts, key=lambda found: found.scale, default=None)
    return [widest if found and found.counts_around_zero else found for found in ranges]


def resting_range(
    values: Array, likely: CommandRange | None, usual: CommandRange | None
) -> tuple[float, CommandRange] | None:
    """Return where a command rests that rests beside the middle of its range, and the
    range from there.

    Cells are in the `likely` range, or in the `usual` one of the log's other commands,
    whose whole it does not leave. None: it rests in the middle, or the log does not
    tell: it begins at rest and rests most of the time. A command that is never given
    rests in the middle of the usual range, too.
    """
    values = values[~np.isnan(values)]
    if not len(values):
        return None
    rest = float(_most_frequent(values))
    begin = float(values[0])
    candidates = list[CommandRange]()
    if likely and likely.offset:
        candidates.append(likely)
    if usual:
        candidates.append(usual)
    for command_range in candidates:
        scale = command_range.scale
        percent = scale * values + command_range.offset
        percent_at_rest = scale * rest + command_range.offset
        is_within = np.abs(percent).max() <= 100 * (1 + SLACK)
        known_to_rest = likely is not None and percent_at_rest == 0
        begins_elsewhere = abs(scale * (begin - rest)) > 100 * EXACT
        if known_to_rest or begins_elsewhere:
            continue
        if is_within and abs(percent_at_rest) <= 100 * FARTHEST_REST:
            offset = float(f"{-scale * rest:.6g}")
            return rest, command_range._replace(offset=offset)
    return None


def _most_frequent(values: Array) -> float:
    """Return the value that most samples have; of several the smallest."""
    distinct, counts = np.unique(values, return_counts=True)
    return distinct[counts.argmax()]


def _rest_at_four(both: Array) -> bool:
    """Return whether cells, (2, R), are from 4 to 20 mA, of which one side rests."""
    # with a slack of 6 % of half the range
    at_rest = (abs(both - 4) <= 0.48).any(axis=0)
    is_within = both.min() >= 3.52 and both.max() <= 20.48
    return bool(is_within and np.mean(at_rest) > 0.95)


def _fits(signal: CommandSignal, low: float, high: float, unit: str) -> bool:
    """Return whether cells from a lowest to a highest, in a unit, may be a signal."""
    slack = signal.slack
    if low < signal.low - slack or high > signal.high + slack:
        return False
    if signal.full:
        ends = [low <= signal.low + slack, high >= signal.high - slack]
        reached = any(ends) if signal.low < 0 else all(ends)
        if not reached:
            return False
    if signal.unit and signal.unit != unit:
        return False
    unit_of_signal = unit_of(signal.name.split()[-1])
    stated = None
    if unit:
        stated = unit_of(unit)
    if unit_of_signal is None or stated is None:
        return True
    return unit_of_signal.quantity == stated.quantity


def _rests_in_the_middle(
    signal: CommandSignal, values: Array, rests: tuple[float, float]
) -> bool:
    """Return whether cells rest in the positive middle of a signal, and lie on both
    sides of it, or on one side if they rest exactly there.

    `rests`: the first cell, and the most frequent one.
    """
    if signal.low < 0:
        return False
    near = [abs(rest - signal.middle) <= signal.slack for rest in rests]
    zero_is_given = np.sum(values == 0) >= COMMON * len(values)
    # where 0 is given often, it may be no command, and the middle some other one
    enough = all(near) if zero_is_given else any(near)
    below = values.min() < signal.middle - USED * signal.half
    above = values.max() > signal.middle + USED * signal.half
    exactly = all(abs(rest - signal.middle) <= EXACT * signal.half for rest in rests)
    if signal.range.excludes_zero and not signal.full and exactly:
        return bool(below or above)
    return bool(enough and below and above)


def _comes_near_zero(
    signal: CommandSignal, values: Array, rests: tuple[float, float]
) -> bool:
    """Return whether cells of a signal around 0 are ever near it: counts must be."""
    return signal.low < 0 and (signal.half <= 100 or comes_near_zero(values))


def comes_near_zero(values: Array) -> bool:
    """Return whether any of the cells of a command, (R,) without NaN, is near 0."""
    low = values.min()
    high = values.max()
    return bool(low <= NEAR_ZERO * high and high >= NEAR_ZERO * low)


def _rests_beside(
    signal: CommandSignal, values: Array, rests: tuple[float, float]
) -> bool:
    """Return whether counts rest at one place, beside the middle of a signal."""
    begin, rest = rests
    return (
        signal.low >= 0
        and signal.half > 100
        and abs(rest - begin) <= EXACT * signal.half
        and abs(rest - signal.middle) <= FARTHEST_REST * signal.half
    )


def _is_around_zero(
    signal: CommandSignal, values: Array, rests: tuple[float, float]
) -> bool:
    return signal.low < 0
