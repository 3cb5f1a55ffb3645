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
        """Return the bin whose mean differs most clearly from zero; None: none.

        By three standard deviations, and by half the rms residual.
        """
        ratio = np.abs(self.mean) / np.maximum(self.error, np.finfo(float).tiny)
        clear = (ratio >= 3.0) & (np.abs(self.mean) > 0.5 * rms)
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

    @property
    def stopped_s(self) -> float:
        """Time that the joint stands at its stop [s]."""
        return float(self.at_stop.sum() * np.median(np.diff(self.time)))


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
    window = min(2 * round(0.11 / log.period / 2) + 1, len(angle) - (len(angle) + 1) % 2)  # of 0.11 s
    velocity = np.asarray(savgol_filter(angle, window, min(2, window - 1), deriv=1, delta=log.period), float)
    lags = min(round(5.0 / log.period), len(residual) - 1)  # up to 5 s
    correlation = _autocorrelation(residual, lags)
    below = np.flatnonzero(correlation < 1 / np.e)
    time = float(below[0] if len(below) else lags) * log.period
    regressors = zip(Regressor, (angle, velocity, log.command[:, joint]), strict=True)
    binned = {what: _binned(values, residual, lags) for what, values in regressors if np.ptp(values) > 0}
    near = float(np.deg2rad(0.5))
    at_stop = (angle < arm.lower[joint] + near) | (angle > arm.upper[joint] - near)
    return ResidualCheck(channel.log, channel.joint, log.time, residual, binned, correlation, time, at_stop)


def _binned(values: Array, residual: Array, lags: int) -> Binned:
    """The residual in ten bins of equal width; one of fewer than 20 samples is left out."""
    edges = np.linspace(values.min(), values.max(), 11)
    place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, 9)
    count = np.bincount(place, minlength=10)
    least = np.maximum(count, 1)
    mean = np.bincount(place, residual, 10) / least
    rest = residual - mean[place]  # the noise is what the means leave
    deviation = np.sqrt(np.bincount(place, rest**2, 10) / least)
    # samples per independent one: the sum of the autocorrelation up to where it first vanishes
    correlation = _autocorrelation(rest, lags)
    ends = np.flatnonzero(correlation <= 0)
    alike = 2 * float(correlation[: ends[0] if len(ends) else None].sum()) - 1
    error = rest.std() / np.sqrt(np.maximum(count / alike, 1.0))
    mean[count < 20] = deviation[count < 20] = np.nan
    return Binned(edges, mean, deviation, error)


def _autocorrelation(residual: Array, lags: int) -> Array:
    """Autocorrelation at lags 0 to `lags`."""
    own = residual - residual.mean()
    spectrum = np.abs(np.fft.rfft(own, 2 * len(own))) ** 2
    covariance = np.fft.irfft(spectrum)[: lags + 1]
    return covariance / covariance[0] if covariance[0] > 0 else np.eye(1, lags + 1)[0]
