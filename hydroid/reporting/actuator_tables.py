"""What the curves of the actuators say at the places that an engineer asks for, as
tables: every tenth per cent of command, 1 Hz."""

from typing import NamedTuple

import numpy as np

from hydroid.arrays import Array
from hydroid.estimate import (
    CurveEstimate,
    FitSummary,
    Interval,
    QuantityEstimate,
)
from hydroid.posterior.curves import LEAST_START, TIME_CONSTANTS
from hydroid.reporting.page import Cell, Table
from hydroid.words import (
    interval_words,
    three_digits,
    two_digits,
    value_words,
)

EVERY = 10.0
"""commands of the table of speeds [%]"""
NEAR = 5.0
"""how far the command of a measured speed may be from the table's [%]"""
LEAST_MEASURED = 5
"""measured speeds that a median is taken of"""
LEAST_PART = 1e-3
"""of the top speed, below which a measured speed is shown as 0"""
SETTLED = 0.05
"""part of the speed within which it stays when a step has settled"""
NOT_YET = 0.9
"""part of the time that a step has to settle, after which it cannot be told whether it
has"""
TURNED = -90.0
"""phase whose frequency is stated [deg]"""
FAR = 0.25
"""part of a speed by which a measured one is far from it"""
LEAST_FAR = 0.05
"""part of the top speed below which no measured speed is called far"""


def speed_table(
    name: str, speed: CurveEstimate, opening: CurveEstimate | None, measured: Array
) -> Table:
    """Return speed and valve opening of a joint against its command, beside the median
    of measured speeds; `measured` are commands [%] and speeds in the curve's unit,
    shape (2, n)."""
    unit = speed.unit
    header = ["command [%]", f"speed [{unit}]", "95 %", "measured"]
    openings = dict[float, float]()
    if opening is not None:
        header.append(f"valve [{opening.unit}]")
        openings = dict(zip(opening.at, opening.value, strict=True))
    rows = list[tuple[Cell, ...]]()
    least = LEAST_PART * max(map(abs, speed.value))
    points = zip(speed.at, speed.value, speed.interval, strict=True)
    for command, value, (low, high) in points:
        if command % EVERY:
            continue
        # a valve that stays shut has no interval, and its speed no sign
        stands = low == high == 0.0
        said = "0" if stands else value_words(value, low, high)
        row: list[Cell] = [f"{command:+.0f}", said]
        row.append(None if stands else interval_words(low, high))
        row.append(_median(command, measured, least))
        if opening is not None:
            area = openings.get(command)
            row.append(None if area is None else three_digits(area))
        rows.append(tuple(row))
    return Table(name, tuple(header), tuple(rows))


def _median(command: float, measured: Array, least: float) -> str | None:
    """Write the median speed near a command, 0 below the least one; nothing of too
    few."""
    median = _median_speed(command, measured)
    if median is None:
        return None
    return three_digits(median) if abs(median) >= least else "0"


def _median_speed(command: float, measured: Array) -> float | None:
    """Return the median of the measured speeds near a command; None of too few."""
    speeds = measured[1, np.abs(measured[0] - command) <= NEAR]
    return float(np.median(speeds)) if len(speeds) >= LEAST_MEASURED else None


def far_commands(speed: CurveEstimate, measured: Array) -> list[float]:
    """Return the commands of the table of speeds [%] at which the measured median lies
    outside the model's interval, and is far from its speed.

    Speeds too small to matter do not count.
    """
    matters = LEAST_FAR * max(map(abs, speed.value))
    far = list[float]()
    points = zip(speed.at, speed.value, speed.interval, strict=True)
    for command, value, (low, high) in points:
        median = _median_speed(command, measured)
        if command % EVERY or median is None or low is None or high is None:
            continue
        size = max(abs(median), abs(value))
        is_far = abs(median - value) > FAR * size and size > matters
        if is_far and not low <= median <= high:
            far.append(command)
    return far


RESPONSE_HEADER = (
    "joint",
    "step to",
    "dead time [s]",
    "time constant [s]",
    f"settling time ({100 * SETTLED:.0f} %) [s]",
    "bandwidth (-3 dB) [Hz]",
    f"phase {TURNED:g}° at [Hz]",
)


def response_rows(name: str, towards: str, summary: FitSummary) -> tuple[Cell, ...]:
    """Return a row of the table of responses: of a joint in one direction."""
    curves = summary.curves
    step = curves.get(f"{name}_step_{towards}")
    amplitude = curves.get(f"{name}_amplitude_{towards}")
    phase = curves.get(f"{name}_phase_{towards}")
    # the command and the direction
    label = step.label.partition(" to ")[2] if step else towards
    width = bandwidth(amplitude) if amplitude else None
    turned = phase_crossing(phase) if phase else None
    settling = settling_time(name, towards, summary)
    return (
        name,
        label,
        _quantity(summary.quantities.get(f"{name}_dead_time_{towards}")),
        _quantity(summary.quantities.get(f"{name}_time_constant_{towards}")),
        None if settling is None else str(settling),
        None if width is None else two_digits(width),
        None if turned is None else turned.cell,
    )


class Settling(NamedTuple):
    """When a step has settled [s]; or, if it is `open`, that it has not until then."""

    seconds: float
    open: bool

    def __str__(self) -> str:
        """Write it as "0.76", or "over 1.1"."""
        return f"{'over ' if self.open else ''}{two_digits(self.seconds)}"


def settling_time(name: str, towards: str, summary: FitSummary) -> Settling | None:
    """Return when a joint's speed has settled after a step in a direction; None where the
    fit has no such step, or does not state when it begins to move.

    The speed that counts is that at the end of the step's start, as in
    `posterior.curves`: further on the joint has left its pose.
    """
    step = summary.curves.get(f"{name}_step_{towards}")
    onset = summary.quantities.get(f"{name}_dead_time_{towards}")
    risen = summary.quantities.get(f"{name}_time_constant_{towards}")
    if step is None or onset is None or risen is None:
        return None
    at = np.array(step.at)
    start = max(onset.value + TIME_CONSTANTS * risen.value, LEAST_START)
    start = min(start, float(at[-1]))
    speed = np.array(step.value)
    settled = float(np.interp(start, at, speed))
    # above 0 outside
    outside = np.abs(speed - settled) - SETTLED * abs(settled)
    last = np.flatnonzero((outside > 0.0) & (at < start))
    if not len(last):
        return Settling(float(at[0]), open=False)
    ends = slice(last[-1], last[-1] + 2)
    seconds = float(np.interp(0.0, -outside[ends], at[ends]))
    if seconds > NOT_YET * start:
        return Settling(start, open=True)
    return Settling(seconds, open=False)


def bandwidth(amplitude: CurveEstimate) -> float | None:
    """Return the frequency [Hz] at which the speed first falls by 3 dB from that at the
    lowest one; None of a curve that does not fall so far."""
    gain = np.log(np.array(amplitude.value) / amplitude.value[0] * np.sqrt(2.0))
    below = np.flatnonzero(gain < 0.0)
    if not len(below):
        return None
    ends = slice(below[0] - 1, below[0] + 1)
    at = np.log(amplitude.at[ends])
    return float(np.exp(np.interp(0.0, -gain[ends], at)))


class Crossing(NamedTuple):
    """The frequency at which a phase is TURNED [Hz], with its 95 % interval; or, if it is
    `open`, up to which it stays above."""

    frequency: float
    interval: Interval = (None, None)
    open: bool = False

    @property
    def cell(self) -> str:
        """Write it for a table, as "0.46 (0.41 to 0.52)", or "over 4.6"."""
        if self.open:
            return self.short
        between = interval_words(*self.interval)
        value = value_words(self.frequency, *self.interval)
        return f"{value} ({between})" if between else value

    @property
    def short(self) -> str:
        """Write it for a heading, without its interval."""
        return f"{'over ' if self.open else ''}{two_digits(self.frequency)}"


def phase_crossing(phase: CurveEstimate) -> Crossing | None:
    """Return where a phase, which falls with the frequency, is TURNED; None where it is
    further turned at the lowest frequency.

    Only the frequencies count at which the logs determine the phase, if they do at any.
    """
    ends = np.array(phase.interval, dtype=float)
    known = np.isfinite(ends).all(axis=1)
    count = len(ends)
    if known.any() and not known.all():
        count = max(int(np.argmin(known)), 1)
    at = np.log(phase.at[:count])
    value = np.array(phase.value[:count])
    if value[0] <= TURNED:
        return None
    frequency = _falls_to_turned(at, value)
    if frequency is None:
        return Crossing(phase.at[count - 1], open=True)
    low, high = (_falls_to_turned(at, end) for end in ends[:count].T)
    return Crossing(frequency, (low, high))


def _falls_to_turned(at: Array, phase: Array) -> float | None:
    """Return the frequency [Hz] at which a phase over logarithms of frequencies, (n,),
    first falls to TURNED; None where it does so at none of them, or before."""
    below = np.flatnonzero(phase <= TURNED)
    if not len(below) or below[0] == 0:
        return None
    ends = slice(below[0] - 1, below[0] + 1)
    return float(np.exp(np.interp(-TURNED, -phase[ends], at[ends])))


def _quantity(quantity: QuantityEstimate | None) -> str | None:
    """Write a quantity with its interval."""
    if quantity is None:
        return None
    between = interval_words(*quantity.interval)
    value = value_words(quantity.value, *quantity.interval)
    return f"{value} ({between})" if between else value
