"""What the residual of a fit shows: its mean over angle, velocity and command, its correlation, the stops."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from hydroid.parameters import Array
from hydroid.posterior.covariance import Uncertainty
from hydroid.problem.channels import Channel
from hydroid.problem.problem import Problem

BINS = 10
"""intervals of angle, velocity and command, of equal width"""
FEWEST = 20
"""samples; a bin with fewer is left out"""
SMOOTHING_S = 0.11
"""length of the filter that gives the velocity [s]"""
CLEAR = 3.0
"""standard deviations by which a bin's mean must differ from zero to be reported"""
LARGE = 0.5
"""part of the rms residual that it must reach"""
LONG_S = 0.1
"""correlation time that is reported [s]: no sensor of an angle is that slow"""
LAGS_S = 5.0
"""longest lag of the autocorrelation [s]"""
AT_STOP = float(np.deg2rad(0.5))
"""distance from the end of the range within which a joint stands at its stop [rad]"""


class Regressor(StrEnum):
    """What a residual is shown against."""

    ANGLE = "angle"
    VELOCITY = "velocity"
    COMMAND = "command"


@dataclass(frozen=True, eq=False)
class Binned:
    """The residual in intervals of one regressor, [rad], [rad/s] or [%].

    edges: shape (B + 1,). mean, deviation: of the residual in each bin [rad], shape (B,); NaN where it has
    few samples. error: standard deviation of the mean, for the residual's effective samples, shape (B,).
    """

    edges: Array
    mean: Array
    deviation: Array
    error: Array

    def clearest(self, rms: float) -> int | None:
        """Return the bin whose mean differs most clearly from zero, beside the rms residual; None: none."""
        ratio = np.abs(self.mean) / np.maximum(self.error, np.finfo(float).tiny)
        clear = (ratio >= CLEAR) & (np.abs(self.mean) > LARGE * rms)
        return int(np.nanargmax(np.where(clear, ratio, -1.0))) if clear.any() else None


@dataclass(frozen=True, eq=False)
class ResidualCheck:
    """The residual of one angle of one log.

    Attributes:
        log: its index.
        joint: its number, from 1.
        time: [s], shape (T,).
        residual: measured less simulated angle [rad], shape (T,).
        binned: over each regressor that varies.
        autocorrelation: at lags of one sample, from 0, shape (L,).
        correlation_s: time in which it falls to 1/e [s].
        at_stop: samples at which the joint stands at its stop, shape (T,).
    """

    log: int
    joint: int
    time: Array
    residual: Array
    binned: dict[Regressor, Binned]
    autocorrelation: Array
    correlation_s: float
    at_stop: NDArray[np.bool_]

    @property
    def rms(self) -> float:
        """Of the residual [rad]."""
        return float(np.sqrt(np.mean(self.residual**2)))


def residual_checks(problem: Problem, uncertainty: Uncertainty) -> tuple[ResidualCheck, ...]:
    """Check each compared angle, without simulations."""
    return tuple(
        _check(problem, channel, uncertainty.jacobian.residual[channel.rows] / channel.weight)
        for channel in problem.channels
        if channel.quantity == "angle"
    )


def _check(problem: Problem, channel: Channel, residual: Array) -> ResidualCheck:
    log, arm, joint = problem.logs[channel.log], problem.settings.arm, channel.joint - 1
    angle = channel.measured
    window = min(2 * round(SMOOTHING_S / log.period / 2) + 1, len(angle) - (len(angle) + 1) % 2)
    velocity = np.asarray(savgol_filter(angle, window, min(2, window - 1), deriv=1, delta=log.period), float)
    lags = min(round(LAGS_S / log.period), len(residual) - 1)
    correlation = _autocorrelation(residual, lags)
    below = np.flatnonzero(correlation < 1 / np.e)
    time = float(below[0] if len(below) else lags) * log.period
    regressors = (angle, velocity, log.command[:, joint])
    binned = {
        what: _binned(values, residual, lags)
        for what, values in zip(Regressor, regressors, strict=True)
        if np.ptp(values) > 0
    }
    at_stop = (angle < arm.lower[joint] + AT_STOP) | (angle > arm.upper[joint] - AT_STOP)
    return ResidualCheck(
        channel.log, channel.joint, log.time, residual, binned, correlation, time, np.asarray(at_stop)
    )


def _binned(values: Array, residual: Array, lags: int) -> Binned:
    edges = np.linspace(values.min(), values.max(), BINS + 1)
    place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, BINS - 1)
    count = np.bincount(place, minlength=BINS)
    least = np.maximum(count, 1)
    mean = np.bincount(place, residual, BINS) / least
    rest = residual - mean[place]  # the noise is what the means leave
    deviation = np.sqrt(np.bincount(place, rest**2, BINS) / least)
    # samples per independent one: the sum of the autocorrelation up to where it first vanishes
    correlation = _autocorrelation(rest, lags)
    ends = np.flatnonzero(correlation <= 0)
    alike = 2 * float(correlation[: ends[0] if len(ends) else None].sum()) - 1
    error = rest.std() / np.sqrt(np.maximum(count / alike, 1.0))
    few = count < FEWEST
    return Binned(edges, np.where(few, np.nan, mean), np.where(few, np.nan, deviation), error)


def _autocorrelation(residual: Array, lags: int) -> Array:
    """Autocorrelation at lags 0 to `lags`."""
    own = residual - residual.mean()
    spectrum = np.abs(np.fft.rfft(own, 2 * len(own))) ** 2
    covariance = np.fft.irfft(spectrum)[: lags + 1]
    return covariance / covariance[0] if covariance[0] > 0 else np.eye(1, lags + 1)[0]
