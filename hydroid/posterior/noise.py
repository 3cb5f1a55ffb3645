"""The noise of a channel: its level and its autocorrelation, from a residual or from the settings.

A residual at 100 Hz is rarely white: sensor filters, quantisation and errors of the model leave deviations
that last for many samples. An autoregressive (AR) process describes them. It is fitted by Burg's method
(J. P. Burg, "Maximum entropy spectral analysis", 1967). Processes of all orders are averaged with Akaike's
weights (K. P. Burnham and D. R. Anderson, 2002): the one order of the lowest AIC would jump from one to
another, and a refinement whose priors it weighs would settle at one of several weights.

A variance that follows from an estimated process is uncertain because the process is. Its logarithm is about
normal, with a variance from the process's own information (P. Whittle, 1953): see `neighbours`.
"""

from dataclasses import replace
from functools import cached_property, reduce

import numpy as np
from scipy.fft import next_fast_len
from scipy.linalg import matmul_toeplitz
from scipy.signal import lfilter, lfiltic

from hydroid.arrays import Array, record
from hydroid.problem.channels import Channel
from hydroid.problem.problem import Problem
from hydroid.settings.problem import ObjectiveSettings

STEP = 1e-4
"""of the differences by a process's numbers, in hyperbolic arc tangents of its reflection coefficients"""
MIN_LEVEL = {"angle": np.deg2rad(0.05), "pressure_a": 1e4, "pressure_b": 1e4}
"""smallest noise level that a residual can show [rad, Pa]: no potentiometer or gauge is better (ours)"""


@record
class Noise:
    """A stationary AR process, sampled T times, with reflection coefficients k_1..k_p, within (-1, 1).

    `level` is its standard deviation, in units of the channel's residual [rad]. A residual shows it, or it is
    `given` by the settings.
    """

    samples: int
    level: float
    reflection: Array
    given: bool = False

    @cached_property
    def autocovariance(self) -> Array:
        """At lags 0 to T - 1, shape (T,)."""
        known, order = np.zeros(self.samples), min(len(self.reflection), self.samples - 1)
        known[0], polynomial, variance = self.level**2, np.ones(1), self.level**2
        for m, k in enumerate(self.reflection[:order]):
            known[m + 1] = -k * variance - polynomial[1:] @ known[m:0:-1]
            polynomial, variance = _longer(polynomial, k), variance * (1 - k**2)
        if order:  # beyond the order the recursion of the process continues
            start = lfiltic([1.0], polynomial, known[order:0:-1])
            known[order + 1 :], _ = lfilter([1.0], polynomial, np.zeros(self.samples - order - 1), zi=start)
        return known

    @property
    def power(self) -> Array:
        """Variance of each column of `transformed`, shape (F,).

        The covariance matrix S is a part of a circulant one, which the Fourier transform makes diagonal.
        """
        lags = self.autocovariance
        return np.tile(2 * np.fft.rfft(lags, _transform_size(self.samples)).real - lags[0], 2)

    def covariance_of(self, rows: Array) -> Array:
        """Return rows S rows', shape (n, n), where rows is (n, T) and S the noise's covariance matrix."""
        waves = transformed(rows)
        return (waves * self.power) @ waves.T

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
        return below[0] - 1 if len(below) else self.samples


def problem_noise(problem: Problem, residual: Array) -> list[Noise]:
    """Return the noise of each channel of a problem from a row of its residuals, shape (R,)."""
    return [channel_noise(c, residual[c.rows], problem.settings.objective) for c in problem.channels]


def prior_weight(problem: Problem, residual: Array) -> float:
    """Return the weight [rad] of a prior's score of one standard deviation beside a row of residuals, (R,).

    Autocorrelated residuals hold less information than their number T says: as much as
    `effective_sample_size` = T' independent ones on what acts as slowly as their mean, and as much as T on
    what acts as fast as they change. Parameters act in between. The weight is the noise's level times the
    root of the number of samples per effective one, of which there are √(T T'). From afar they are T':
    priors hold what an error of the model, not the noise, would move.
    """
    noise = problem_noise(problem, residual)
    square, samples = sum(n.samples * n.level**2 for n in noise), sum(n.samples for n in noise)
    effective = sum(n.effective_sample_size for n in noise)
    return np.sqrt(square / (effective if problem.afar else np.sqrt(samples * effective)))


def channel_noise(channel: Channel, residual: Array, objective: ObjectiveSettings) -> Noise:
    """Return a channel's noise: white as the settings give it, else from its residual, shape (T,).

    Simulated data without noise leave a residual below MIN_LEVEL. White noise then fills the difference.
    """
    given, samples = objective.noise_of(channel.joint), len(residual)
    if given is not None and channel.quantity == "angle":
        return Noise(samples, np.deg2rad(given) * channel.weight, np.empty(0), given=True)
    lacking = samples * (MIN_LEVEL[channel.quantity] * channel.weight) ** 2 - residual @ residual
    if lacking <= 0:
        return fit_noise(residual)
    impulse = np.zeros(samples)  # its products are those expected of white noise
    impulse[samples // 2] = np.sqrt(lacking)
    return fit_noise(np.vstack([residual, channel.filtered(impulse)]))


def error_level(channel: Channel, noise: Noise) -> float:
    """Standard deviation of the output error whose residual has a noise, unweighted [rad, Pa]."""
    size = _transform_size(noise.samples)
    power = noise.power[: 1 + size // 2] / channel.gain(size) ** 2
    return np.sqrt(np.fft.irfft(power, size)[0]) / channel.weight


def transformed(rows: Array) -> Array:
    """Real and imaginary parts of the Fourier transform of rows, (n, T) -> (n, F).

    With them, rows S rows' is a sum of products weighed by `Noise.power`.
    """
    size = _transform_size(rows.shape[1])
    waves = np.fft.rfft(rows, size) / np.sqrt(size)
    waves[:, 1 : (size + 1) // 2] *= np.sqrt(2)  # frequencies that stand for their negative ones as well
    return np.hstack([waves.real, waves.imag])


def _transform_size(samples: int) -> int:
    return int(next_fast_len(2 * samples, real=True))  # pyright: ignore[reportArgumentType, reportUnknownArgumentType]


def neighbours(noise: Noise) -> list[Noise]:
    """Return processes that differ from one by independent standard errors, STEP of each.

    A process that the settings give is not uncertain.
    """
    if noise.given:
        return []
    samples, order, place = noise.samples, len(noise.reflection), np.arctanh(noise.reflection)
    innovation = noise.level**2 * np.prod(1 - noise.reflection**2)

    def at(shift: Array) -> Noise:
        reflection = np.tanh(place + shift)
        level = np.sqrt(innovation / np.prod(1 - reflection**2))
        return replace(noise, level=level, reflection=reflection)

    def log_spectrum(shift: Array) -> Array:
        polynomial = reduce(_longer, at(shift).reflection, np.ones(1))
        return -2 * np.log(np.abs(np.fft.rfft(polynomial, 2 * samples)))

    # standard error of the logarithm of the innovations' variance: sqrt(2 / T)
    others = [replace(noise, level=noise.level * np.exp(STEP * np.sqrt(0.5 / samples)))]
    if order:
        middle = log_spectrum(np.zeros(order))
        slopes = np.array([log_spectrum(STEP * each) - middle for each in np.eye(order)]) / STEP
        values, vectors = np.linalg.eigh(samples / 2 * slopes @ slopes.T / len(middle))
        others += [at(STEP * v / np.sqrt(x)) for x, v in zip(values, vectors.T, strict=True) if x > 0]
    return others


def fit_noise(rows: Array) -> Noise:
    """Fit an average of AR processes of order 0 to 30 to a residual of zero mean, shape (T,).

    A process of order m has no reflection coefficients beyond k_m: the average of k_j is k_j times the weight
    of all orders from j. Of several rows, (n, T), the products are added.
    """
    forward = backward = rows = np.atleast_2d(rows)
    samples = rows.shape[1]
    level = np.sqrt(np.sum(rows**2) / samples)
    reflection: list[float] = []
    criterion = [0.0]
    for _ in range(min(30, samples // 4)):
        forward, backward = forward[:, 1:], backward[:, :-1]
        power = np.vdot(forward, forward) + np.vdot(backward, backward)
        k = float(-2 * np.vdot(forward, backward) / power) if power > 0 else np.inf
        if not abs(k) < 1:
            break
        forward, backward = forward + k * backward, backward + k * forward
        reflection.append(k)
        criterion.append(criterion[-1] + samples * np.log1p(-(k**2)) + 2.0)
    weight = np.exp(-0.5 * (np.array(criterion) - min(criterion)))
    share = np.cumsum((weight / weight.sum())[::-1])[::-1][1:]
    order = int(np.sum(share > 0.05))  # higher orders weigh less than this together
    return Noise(samples, level, share[:order] * np.array(reflection[:order]))


def unbiased(noise: Noise, effects: Array, spread: Array) -> Noise:
    """Return the noise before a least-squares fit absorbed a part of it.

    A fit absorbs the part of the noise that resembles its derivatives, slow noise above all. Let U be the
    orthonormal rows that span them, `effects`, (p, T), the channel's part of U, and `spread`, (p, p), U S U'
    of all channels. The covariance of the residual is (1 - U'U) S (1 - U'U). The autocovariances of `noise`
    are raised by the difference to S, in a few rounds because S is not known beforehand. A noise that the
    settings give is whole.
    """
    if noise.given:
        return noise
    samples, order, spread_out = noise.samples, len(noise.reflection), spread @ effects
    left, whole = noise.autocovariance[: order + 1], noise
    lags = np.arange(order + 1)

    def lagged(a: Array, b: Array) -> Array:
        return np.array([np.sum(a[:, : samples - k] * b[:, k:]) for k in lags])

    for _ in range(4):
        smooth = np.asarray(matmul_toeplitz(whole.autocovariance, effects.T), dtype=np.float64).T
        absorbed = lagged(effects, smooth) + lagged(smooth, effects) - lagged(spread_out, effects)
        reflection = _levinson(left + absorbed / (samples - lags))
        # a fit that has absorbed half the noise leaves too little to correct the level with
        if reflection is None or absorbed[0] > 0.5 * samples * left[0]:
            break
        whole = replace(noise, level=np.sqrt(left[0] + absorbed[0] / samples), reflection=reflection)
    return whole


def _levinson(autocovariance: Array) -> Array | None:
    """Reflection coefficients from lags 0 to p; None where no AR process has these autocovariances."""
    polynomial, variance, reflection = np.ones(1), autocovariance[0], np.empty(0)
    if not variance > 0:
        return None
    for m in range(1, len(autocovariance)):
        k = -(polynomial @ autocovariance[m:0:-1]) / variance
        if not abs(k) < 1:
            return None
        polynomial, variance = _longer(polynomial, k), variance * (1 - k**2)
        reflection = np.append(reflection, k)
    return reflection


def _longer(polynomial: Array, k: float) -> Array:
    """Prediction-error filter of the next order, whose error has 1 - k² times the variance (Levinson)."""
    longer = np.append(polynomial, 0.0)
    return longer + k * longer[::-1]
