"""What the residual of a fit shows: where it depends on angle, velocity or command, and how long it lasts."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.signal import savgol_filter

from hydroid.parameters import Array
from hydroid.posterior.noise import fit_noise
from hydroid.posterior.uncertainty import Uncertainty
from hydroid.problem.problem import Problem

Regressor = Literal["angle", "velocity", "command"]
UNITS: dict[Regressor, str] = {"angle": "deg", "velocity": "deg/s", "command": "%"}


@dataclass(frozen=True)
class Dependence:
    """Where a residual's mean [deg] differs most clearly from zero: from low to high of a regressor."""

    regressor: Regressor
    low: float
    high: float
    mean: float


@dataclass(frozen=True)
class ResidualCheck:
    """The residual of one angle of one log.

    Attributes:
        log: its index.
        joint: its number, from 1.
        rms: [deg].
        correlation_s: time in which its autocorrelation falls to 1/e [s].
        depends: on which regressors it clearly depends, and where.
    """

    log: int
    joint: int
    rms: float
    correlation_s: float
    depends: tuple[Dependence, ...]


def residual_checks(problem: Problem, known: Uncertainty) -> tuple[ResidualCheck, ...]:
    """Check each compared angle, without simulations."""
    checks: list[ResidualCheck] = []
    for channel, noise in zip(problem.channels, known.noise, strict=True):
        if channel.quantity != "angle":
            continue
        log, angle = problem.logs[channel.log], channel.measured
        residual = np.degrees(known.linear.residual[channel.rows] / channel.weight)
        window = min(2 * round(0.11 / log.period / 2) + 1, len(angle) - (len(angle) + 1) % 2)  # of 0.11 s
        speed = np.asarray(savgol_filter(angle, window, min(2, window - 1), deriv=1, delta=log.period), float)
        values = np.degrees(angle), np.degrees(speed), log.command[:, channel.joint - 1]
        pairs = zip(UNITS, values, strict=True)
        found = [_dependence(what, each, residual) for what, each in pairs if np.ptp(each) > 0]
        rms, lasts = math.sqrt(np.mean(residual**2)), noise.correlation_time * log.period
        depends = tuple(one for one in found if one is not None)
        checks.append(ResidualCheck(channel.log, channel.joint, rms, lasts, depends))
    return tuple(checks)


def _dependence(what: Regressor, values: Array, residual: Array) -> Dependence | None:
    """The bin, of ten of equal width, whose mean differs most clearly from zero.

    It does so by three standard deviations and half the rms residual, and has 20 samples or more.
    """
    edges = np.linspace(values.min(), values.max(), 11)
    place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, 9)
    count = np.bincount(place, minlength=10)
    mean = np.bincount(place, residual, 10) / np.maximum(count, 1)
    noise = fit_noise(residual - mean[place])  # what the means leave
    part = noise.effective_sample_size / noise.samples if noise.level > 0 else 1.0
    error = noise.level / np.sqrt(np.maximum(count * part, 1.0))
    ratio = np.abs(mean) / np.maximum(error, np.finfo(float).tiny)
    clear = (count >= 20) & (ratio >= 3.0) & (np.abs(mean) > 0.5 * np.sqrt(np.mean(residual**2)))
    if not clear.any():
        return None
    best = int(np.argmax(np.where(clear, ratio, 0.0)))
    return Dependence(what, float(edges[best]), float(edges[best + 1]), float(mean[best]))
