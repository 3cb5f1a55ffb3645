"""What the error of a compared signal depends on in a log, whatever the parameters of
the model: its times, the way that it travels, and where the joint stands at a stop."""

import numpy as np
from scipy.ndimage import binary_erosion

from hydroid.arrays import Array, Mask, record
from hydroid.log import Log
from hydroid.problem.channels import Channel
from hydroid.problem.problem import Problem

WAY_OVER = 0.25
"""time over which a way is measured [s]: the sensor's noise is no way"""
AT_STOP = 0.002
"""part of a joint's range within which it stands at the end of it"""


@record
class Course:
    """One channel's times as its error sees them: the same for all parameters of the
    model.

    Attributes:
        rows: of the channel in a row of all channels' residuals.
        weight: of the channel's errors.
        period: between samples [s].
        way: travelled from each sample to the next [rad], shape (T,).
        moved: the measured signal less its first value [rad], shape (T,).
        stops: whether the joint stands at an end of its range, shape (T,).
        readings: of which the start angle is the mean; inf where it is taken for exact.
        used: samples that count, shape (T,); of the others nothing is taken to be
            measured.
    """

    rows: slice
    weight: float
    period: float
    way: Array
    moved: Array
    stops: Mask
    readings: float
    used: Mask


def make_course(channel: Channel, log: Log, problem: Problem) -> Course:
    """Return the course of a channel of a problem, which compares `log`."""
    joint = channel.joint - 1
    stops = np.zeros(len(channel.measured), dtype=bool)
    readings = np.inf
    if channel.quantity == "angle":
        ends = problem.settings.arm.stops(joint + 1)
        stops = at_stops(channel.measured, ends, log.period)
        if channel.joint in problem.started(log) and problem.settings.free_start:
            readings = max(float(log.start_samples[joint]), 1.0)
    way = travelled(channel.measured, log.period)
    moved = channel.measured - channel.measured[0]
    used = log.recorded
    if used is None:
        used = np.ones(len(way), dtype=bool)
    return Course(
        rows=channel.rows,
        weight=channel.weight,
        period=log.period,
        way=way,
        moved=moved,
        stops=stops,
        readings=readings,
        used=used,
    )


def travelled(signal: Array, period: float) -> Array:
    """Return the way of a signal, (T,), from each sample to the next, without the noise
    of single samples."""
    half = _half_window(period)
    padded = np.pad(signal, half, mode="edge")
    # what changes over the window around a sample, spread over the samples in it
    after = padded[2 * half :]
    before = padded[: -2 * half]
    return np.abs(after - before) / (2 * half)


def at_stops(angle: Array, ends: tuple[float, float], period: float) -> Mask:
    """Return where angles [rad], (T,), rest at an end of a joint's range, which may be
    infinite.

    A joint that turns back at once has not been at its stop.
    """
    lower, upper = ends
    margin = AT_STOP * (upper - lower)
    if not np.isfinite(margin):
        return np.zeros(len(angle), dtype=bool)
    near = (angle < lower + margin) | (angle > upper - margin)
    # of all samples around it, too
    window = np.ones(2 * _half_window(period) + 1, dtype=bool)
    return binary_erosion(near, window, border_value=1).astype(np.bool_)


def _half_window(period: float) -> int:
    """Return half of WAY_OVER in samples, at least one."""
    return max(round(0.5 * WAY_OVER / period), 1)
