"""Whether a recording is known already, or a part of it: its samples decide, not its
file.

A copy may be cut, saved with fewer digits, resampled, or stand in another format. So
stretches of its angles are looked for at every time of the known recordings, within
what noise, digits, and lines between samples explain. Of two recordings of a machine,
even of the same commands, the angles differ by more.
"""

import math
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
    moving = 0
    held = 0
    for stretch in _stretches(log):
        moves = _moves(stretch)
        if moves.any():
            moving += 1
            held += any(_holds(other, stretch, moves) for other in known)
    if not moving:
        return float(any(_has_same_angles(log, other) for other in known))
    return held / moving


def _has_same_angles(log: Log, other: Log) -> bool:
    return np.array_equal(log.angle, other.angle, equal_nan=True)


def _stretches(log: Log) -> list[Log]:
    """Return stretches of one length, which cover a short log whole and a long one in
    part."""
    samples = len(log.time)
    length = min(round(STRETCH / log.period), samples)
    count = min(math.ceil(samples / length), MOST)
    starts = np.linspace(0, samples - length, count)
    return [log.part(int(start), int(start) + length) for start in starts]


def _moves(log: Log) -> Mask:
    """Return which joints have a measured motion that is more than a steady one, shape
    (J,)."""
    time = log.time - log.time.mean()
    off = log.angle - log.angle.mean(axis=0)
    slopes = time @ off / max(time @ time, log.period**2)
    steady = np.outer(time, slopes)
    left = np.sqrt(np.mean((off - steady) ** 2, axis=0))
    # False where the angle is not measured, and NaN
    return left > MOTION


def _holds(known: Log, log: Log, moves: Mask) -> bool:
    """Return whether a log holds a stretch of another, at some time, in all joints that
    move there."""
    joints = np.flatnonzero(moves & known.has_angle)
    grid = np.arange(0.0, log.duration + 1e-9, known.period)
    if not len(joints) or len(grid) > len(known.time):
        return False
    # fewer have no second difference, which tells the noise
    if len(grid) < 3:
        return False
    angles = known.angle[:, joints]
    columns = [np.interp(grid, log.time, log.angle[:, joint]) for joint in joints]
    wanted = np.column_stack(columns)
    # large numbers would lose the small differences
    middle = angles.mean(axis=0)
    by_noise = NOISE * _noise(angles)
    by_lines = LINES * wanted.std(axis=0)
    scale = np.maximum(np.maximum(by_noise, by_lines), ROUNDING)
    angles = (angles - middle) / scale
    wanted = (wanted - middle) / scale
    nearest = int(np.argmin(_squares(angles, wanted)))
    # a clock may be read between the samples of the other
    starts = {max(nearest - 1, 0), nearest}
    return any(_between(angles[start:], wanted) <= 1.0 for start in starts)


def _noise(angle: Array) -> Array:
    """Return the standard deviation of the noise of angles [rad], shape (K,), from
    their second differences."""
    bends = np.abs(np.diff(angle, 2, axis=0))
    # a normal variable's median size, and the variance of a - 2 b + c
    return np.median(bends, axis=0) / (0.6745 * np.sqrt(6.0))


def _squares(angles: Array, wanted: Array) -> Array:
    """Return the sum of squared differences of `wanted`, (N, K), from each N samples of
    `angles`, (T, K), in turn, shape (T - N + 1,)."""
    size = 1 << (len(angles) + len(wanted)).bit_length()
    spectra = np.fft.rfft(angles, size, axis=0)
    spectra = spectra * np.conj(np.fft.rfft(wanted, size, axis=0))
    lags = len(angles) - len(wanted) + 1
    products = np.fft.irfft(spectra.sum(axis=1), size)[:lags]
    sums = np.zeros(len(angles) + 1)
    sums[1:] = np.cumsum((angles**2).sum(axis=1))
    # without the squares of `wanted`, which are the same everywhere
    return sums[len(wanted) :] - sums[: -len(wanted)] - 2 * products


def _between(angles: Array, wanted: Array) -> float:
    """Return the mean square difference of `wanted`, (N, K), from lines between the
    first samples of `angles`.

    `wanted` may lie between these and the next ones: where, is chosen once for all.
    """
    first = angles[: len(wanted)]
    following = angles[1 : 1 + len(wanted)]
    off = wanted - first
    if len(following) < len(wanted):
        return float(np.mean(off**2))
    step = following - first
    square = float(np.sum(step**2))
    part = 0.0
    if square:
        part = float(np.sum(step * off)) / square
        part = min(max(part, 0.0), 1.0)
    return float(np.mean((off - part * step) ** 2))
