"""The noise of a channel: its level and its autocorrelation, from a residual or from the settings.

A residual at 100 Hz is rarely white: sensor filters, quantisation and errors of the model leave deviations
that last for many samples. An autoregressive (AR) process describes them. It is fitted by Burg's method
(J. P. Burg, "Maximum entropy spectral analysis", 1967), its order by the lowest AIC (H. Akaike, 1974).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.linalg import matmul_toeplitz
from scipy.signal import lfilter, lfiltic

from hydroid.parameters import Array
from hydroid.problem.channels import Channel
from hydroid.settings.problem import ObjectiveSettings

MAX_AR_ORDER = 30
"""the highest order of the AR process"""
ABSORBED_ROUNDS = 4
"""rounds in which the noise that a fit has absorbed is estimated"""
MAX_ABSORBED = 0.5
"""part of the noise; a fit that has absorbed more leaves too little to correct the level with"""
MIN_LEVEL = {"angle": float(np.deg2rad(0.05)), "pressure_a": 1e4, "pressure_b": 1e4}
"""smallest noise level that a residual can show [rad, Pa]: no potentiometer or gauge is better (ours)"""


@dataclass(frozen=True, eq=False)
class Noise:
    """A stationary AR process, sampled T times.

    Attributes:
        samples: T.
        level: standard deviation, in units of the channel's residual [rad].
        reflection: coefficients k_1..k_p of its Levinson recursion, shape (p,), each within (-1, 1).
        source: of the level; "smallest" is MIN_LEVEL, as the residual shows less.
    """

    samples: int
    level: float
    reflection: Array
    source: Literal["residual", "settings", "smallest"] = "residual"

    @cached_property
    def autocovariance(self) -> Array:
        """At lags 0 to T - 1, shape (T,)."""
        predictors, order = self._predictors(), min(len(self.reflection), self.samples - 1)
        known = np.zeros(self.samples)
        known[0] = self.level**2
        for m, (polynomial, variance) in enumerate(predictors[:order]):
            known[m + 1] = -self.reflection[m] * variance - polynomial[1:] @ known[m:0:-1]
        if order:  # beyond the order the recursion of the process continues
            last = predictors[order][0]
            start = lfiltic([1.0], last, known[order:0:-1])
            known[order + 1 :], _ = lfilter([1.0], last, np.zeros(self.samples - order - 1), zi=start)
        return known

    @property
    def spectrum(self) -> Array:
        """Power at T + 1 frequencies from 0 to half the sampling rate, shape (T + 1,)."""
        polynomial, variance = self._predictors()[-1]
        return variance / np.abs(np.fft.rfft(polynomial, 2 * self.samples)) ** 2

    def covariance_of(self, rows: Array) -> Array:
        """Return rows S rows', shape (n, n), where rows is (n, T) and S the noise's covariance matrix."""
        return covariances([self], rows)[0]

    def whitened(self, rows: Array) -> Array:
        """Return L^-1 rows' of S = L L', shape (n, T), which makes this noise white with unit variance."""
        predictors = self._predictors()
        polynomial, variance = predictors[-1]
        white = lfilter(polynomial, [1.0], rows, axis=1) / np.sqrt(variance)
        for m, (shorter, shorter_variance) in enumerate(predictors[:-1][: self.samples]):
            white[:, m] = rows[:, m::-1] @ shorter / np.sqrt(shorter_variance)
        return white

    @property
    def effective_sample_size(self) -> float:
        """Number of independent samples whose mean is known as well, at most T."""
        weight = 2 * (1 - np.arange(self.samples) / self.samples)
        total = float(weight @ self.autocovariance) - self.level**2
        return self.samples / max(total / self.level**2, 1.0)

    @property
    def correlation_time(self) -> float:
        """Samples until the autocorrelation has fallen below 1/e for the first time; 0 of white noise."""
        below = np.flatnonzero(self.autocovariance < self.level**2 / np.e)
        return float(below[0] - 1) if len(below) else float(self.samples)

    def _predictors(self) -> list[tuple[Array, float]]:
        """Prediction-error filters of order 0 to p, each with the variance of its prediction error."""
        predictors = [(np.ones(1), self.level**2)]
        for k in self.reflection:
            predictors.append(_next_predictor(*predictors[-1], float(k)))
        return predictors


def prior_weight(channels: Sequence[Channel], residual: Array, objective: ObjectiveSettings) -> float:
    """Return the weight [rad] of a prior's score of one standard deviation beside a row of residuals, (R,).

    Autocorrelated residuals hold less information than their number says. The weight is therefore the noise's
    level times the root of the number of samples per effective sample. The AR process has its full order:
    the order of the lowest AIC jumps, and a refinement would then settle at one of several weights.
    """
    noise = [channel_noise(c, residual[c.rows], objective, by_aic=False) for c in channels]
    square = sum(n.samples * n.level**2 for n in noise)
    return float(np.sqrt(square / sum(n.effective_sample_size for n in noise)))


def channel_noise(
    channel: Channel, residual: Array, objective: ObjectiveSettings, by_aic: bool = True
) -> Noise:
    """Return a channel's noise: white as the settings give it, else from its residual, shape (T,).

    Simulated data without noise leave a residual below MIN_LEVEL. White noise then fills the difference.
    """
    if channel.quantity == "angle":
        given = objective.noise_deg
        given = given.get(channel.joint) if isinstance(given, dict) else given
        level = None if given is None else float(np.deg2rad(given))
    else:
        level = None if objective.noise_bar is None else objective.noise_bar * 1e5
    samples = len(residual)
    if level is not None:
        return Noise(samples, level * channel.weight, np.empty(0), "settings")
    lacking = samples * (MIN_LEVEL[channel.quantity] * channel.weight) ** 2 - float(residual @ residual)
    if lacking <= 0:
        return fit_noise(residual, by_aic=by_aic)
    impulse = np.zeros(samples)  # its products are those expected of white noise
    impulse[samples // 2] = np.sqrt(lacking)
    return replace(fit_noise(np.vstack([residual, impulse]), by_aic=by_aic), source="smallest")


def covariances(processes: Sequence[Noise], rows: Array) -> Array:
    """Return rows S rows' of each process's S, shape (m, n, n), where rows is (n, T).

    S is a part of a circulant matrix of 2 T rows, which the discrete Fourier transform makes diagonal.
    """
    samples = rows.shape[1]
    if not any(len(process.reflection) for process in processes):
        square = rows @ rows.T
        return np.array([process.level**2 * square for process in processes])
    spectrum = np.fft.rfft(rows, 2 * samples)
    spectrum[:, 1:-1] *= np.sqrt(2)  # frequencies that stand for their negative ones as well
    out = np.empty((len(processes), len(rows), len(rows)))
    for square, process in zip(out, processes, strict=True):
        lags = process.autocovariance
        power = np.fft.rfft(np.concatenate([lags, [0.0], lags[:0:-1]])).real
        square[:] = ((spectrum * power) @ spectrum.conj().T).real / (2 * samples)
    return out


def fit_noise(rows: Array, max_order: int = MAX_AR_ORDER, by_aic: bool = True) -> Noise:
    """Fit an AR process of order 0 to `max_order` to a residual of zero mean, shape (T,).

    by_aic: the order has the lowest AIC; otherwise it is the highest.
    Of several rows, (n, T), the products are added.
    """
    forward = backward = rows = np.atleast_2d(rows)
    samples = rows.shape[1]
    level = float(np.sqrt(np.sum(rows**2) / samples))
    reflection: list[float] = []
    criterion = [0.0]
    for _ in range(min(max_order, samples // 4)):
        forward, backward = forward[:, 1:], backward[:, :-1]
        power = float(np.vdot(forward, forward) + np.vdot(backward, backward))
        k = -2 * float(np.vdot(forward, backward)) / power if power > 0 else np.inf
        if not abs(k) < 1:
            break
        forward, backward = forward + k * backward, backward + k * forward
        reflection.append(k)
        criterion.append(criterion[-1] + samples * float(np.log1p(-(k**2))) + 2.0)
    order = int(np.argmin(criterion)) if by_aic else len(reflection)
    return Noise(samples, level, np.array(reflection[:order]))


def unbiased(noise: Noise, effects: Array, spread: Array) -> Noise:
    """Return the noise before a least-squares fit absorbed a part of it.

    A fit absorbs the part of the noise that resembles its derivatives, slow noise above all. Let U be the
    orthonormal rows that span them, `effects`, (p, T), the channel's part of U, and `spread`, (p, p), U S U'
    of all channels. The covariance of the residual is (1 - U'U) S (1 - U'U). The autocovariances of `noise`
    are raised by the difference to S, in a few rounds because S is not known beforehand.
    """
    samples, order = noise.samples, len(noise.reflection)
    left, whole = noise.autocovariance[: order + 1], noise
    for _ in range(ABSORBED_ROUNDS):
        smooth = np.asarray(matmul_toeplitz(whole.autocovariance, effects.T), dtype=np.float64).T
        absorbed = np.array(
            [
                np.sum(effects[:, : samples - k] * smooth[:, k:])
                + np.sum(smooth[:, : samples - k] * effects[:, k:])
                - np.sum((spread @ effects[:, : samples - k]) * effects[:, k:])
                for k in range(order + 1)
            ]
        )
        reflection = _levinson(left + absorbed / (samples - np.arange(order + 1)))
        if reflection is None or absorbed[0] > MAX_ABSORBED * samples * left[0]:
            break
        whole = replace(noise, level=float(np.sqrt(left[0] + absorbed[0] / samples)), reflection=reflection)
    return whole


def _levinson(autocovariance: Array) -> Array | None:
    """Reflection coefficients from lags 0 to p; None where no AR process has these autocovariances."""
    polynomial, variance, reflection = np.ones(1), float(autocovariance[0]), np.empty(0)
    if not variance > 0:
        return None
    for m in range(1, len(autocovariance)):
        k = float(-(polynomial @ autocovariance[m:0:-1]) / variance)
        if not abs(k) < 1:
            return None
        polynomial, variance = _next_predictor(polynomial, variance, k)
        reflection = np.append(reflection, k)
    return reflection


def _next_predictor(polynomial: Array, variance: float, k: float) -> tuple[Array, float]:
    """Prediction-error filter of the next order and the variance of its error (Levinson)."""
    longer = np.append(polynomial, 0.0)
    return longer + k * longer[::-1], variance * (1 - k**2)
