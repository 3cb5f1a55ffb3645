"""Whether a recording is known already, or a part of it: its samples decide, not its
file.

A copy may be cut, saved with fewer digits, resampled, or stand in another format. So
stretches of its angles are looked for at every time of the known recordings, within
what noise, digits, and lines between samples explain. Of two recordings of a machine,
even of the same commands, the angles differ by more.
"""

from collections.abc import Sequence

import numpy as np

from hydroid.arrays import Array, Mask
from hydroid.log.log import Log

STRETCH = 5.0
"""length of what is looked for [s]"""
MOST = 40
"""stretches of one log, evenly spread"""
MOTION = np.radians(0.5)
"""rms of a joint's motion besides a steady one [rad]: less is no sign of one
recording"""
ROUNDING = np.radians(0.03)
"""rms difference that is left by angles in steps of 0.1 deg [rad]"""
LINES = 0.005
"""rms difference that is left by lines between samples, as part of the motion's rms"""
NOISE = 1.15
"""rms difference that is left by averaged noise, as a multiple of it; two recordings
have the root of 2"""
KNOWN = 0.2
"""part of a log's motion that makes it known"""


def overlap(log: Log, known: Sequence[Log]) -> float:
    """Return which part of a log's motion stands in known logs, from 0 to 1.

    Only angles are compared: of joints that move in the log and that a known one
    measures too. A log in which nothing moves is known whole or not at all.
    """
    stretches = [log.part(first, end) for first, end in _stretches(log)]
    telling = [(one, moves) for one in stretches if (moves := _moves(one)).any()]
    if not telling:
        return float(
            any(
                np.array_equal(log.angle, other.angle, equal_nan=True)
                for other in known
            )
        )
    return sum(any(_holds(other, *one) for other in known) for one in telling) / len(
        telling
    )


def _stretches(log: Log) -> list[tuple[int, int]]:
    """First sample and end of stretches, all alike, that hold a short log whole and a
    long one in part."""
    length = min(round(STRETCH / log.period), len(log.time))
    starts = np.linspace(
        0, len(log.time) - length, min(-(-len(log.time) // length), MOST)
    )
    return [(int(start), int(start) + length) for start in starts]


def _moves(log: Log) -> Mask:
    """Joints whose measured motion is more than a steady one, shape (J,)."""
    time = log.time - log.time.mean()
    off = log.angle - log.angle.mean(axis=0)
    steady = np.outer(time, time @ off / max(time @ time, log.period**2))
    # False where it is NaN
    return np.sqrt(np.mean((off - steady) ** 2, axis=0)) > MOTION


def _holds(known: Log, log: Log, moves: Mask) -> bool:
    """Return whether a log holds a stretch of another, at some time, in all joints that
    move there."""
    joints = np.flatnonzero(moves & known.measured)
    grid = np.arange(0.0, log.duration + 1e-9, known.period)
    if not len(joints) or len(grid) > len(known.time) or len(grid) < 3:
        return False
    there = known.angle[:, joints]
    wanted = np.column_stack(
        [np.interp(grid, log.time, log.angle[:, joint]) for joint in joints]
    )
    middle = there.mean(axis=0)  # large numbers would lose the small differences
    scale = np.maximum(
        np.maximum(NOISE * _noise(there), LINES * wanted.std(axis=0)), ROUNDING
    )
    there, wanted = (there - middle) / scale, (wanted - middle) / scale
    nearest = int(np.argmin(_squares(there, wanted)))
    # a clock that is read between the samples of the other
    return any(
        _between(there[first:], wanted) <= 1.0
        for first in {max(nearest - 1, 0), nearest}
    )


def _noise(angle: Array) -> Array:
    """Standard deviation of the noise of angles [rad], shape (K,), from their second
    differences."""
    bends = np.abs(np.diff(angle, 2, axis=0))
    return np.median(bends, axis=0) / (0.6745 * np.sqrt(6.0))


def _squares(there: Array, wanted: Array) -> Array:
    """Sum of squared differences of `wanted`, (N, K), from each N samples of `there`,
    (T, K) in turn."""
    size = 1 << (len(there) + len(wanted)).bit_length()
    spectra = np.fft.rfft(there, size, axis=0) * np.conj(
        np.fft.rfft(wanted, size, axis=0)
    )
    products = np.fft.irfft(spectra.sum(axis=1), size)[: len(there) - len(wanted) + 1]
    sums = np.concatenate([[0.0], np.cumsum((there**2).sum(axis=1))])
    return sums[len(wanted) :] - sums[: -len(wanted)] - 2 * products


def _between(there: Array, wanted: Array) -> float:
    """Mean square difference of `wanted`, (N, K), from lines between the first samples
    of `there`.

    `wanted` may lie between these and the next ones: where, is chosen once for all.
    """
    first, following = there[: len(wanted)], there[1 : 1 + len(wanted)]
    if len(following) < len(wanted):
        return float(np.mean((wanted - first) ** 2))
    step, off = following - first, wanted - first
    square = float(np.sum(step**2))
    part = min(max(float(np.sum(step * off)) / square, 0.0), 1.0) if square else 0.0
    return float(np.mean((off - part * step) ** 2))
