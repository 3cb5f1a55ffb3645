"""The noise of a channel: its level and how long it remembers, from a residual or as given.

A residual at 100 Hz is rarely white: a sensor's filter, a quantised signal, and whatever the model lacks
leave errors that last. It is described by an autoregressive (AR) model, fitted by Burg's method (J. P. Burg,
"Maximum entropy spectral analysis", 1967), of the order with the lowest AIC (H. Akaike, 1974).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import matmul_toeplitz
from scipy.signal import lfilter, lfiltic

from hydroid.parameters import Array
from hydroid.problem.channels import Channel
from hydroid.settings.problem import ObjectiveSettings

ORDER = 30
"""the highest order that is tried"""
ROUNDS = 4
"""times that the noise which a fit has taken up is estimated"""
HALF = 0.5
"""of the noise: a fit that took up more leaves nothing to correct with"""
FLOOR = {"angle": float(np.deg2rad(0.05)), "pressure_a": 1e4, "pressure_b": 1e4}
"""the least error that is believed [rad, Pa]: potentiometers, gauges, converters are no better (ours)"""


@dataclass(frozen=True, eq=False)
class Noise:
    """A stationary AR process, sampled T times.

    Attributes:
        samples: T.
        level: standard deviation, in units of the channel's residual [rad].
        reflection: coefficients k_1..k_p of its Levinson recursion, shape (p,), each within (-1, 1).
        source: where it was taken from: the residual, the settings, or the least that is believed.
    """

    samples: int
    level: float
    reflection: Array
    source: Literal["residual", "settings", "least believed"] = "residual"

    @property
    def autocovariance(self) -> Array:
        """At lags 0 to T - 1, shape (T,)."""
        predictors, order = self._predictors(), min(len(self.reflection), self.samples - 1)
        known = np.zeros(self.samples)
        known[0] = self.level**2
        for m, (polynomial, variance) in enumerate(predictors[:order]):
            known[m + 1] = -self.reflection[m] * variance - polynomial[1:] @ known[m:0:-1]
        if order:  # beyond its order the process' own recursion goes on
            last = predictors[order][0]
            start = lfiltic([1.0], last, known[order:0:-1])
            known[order + 1 :], _ = lfilter([1.0], last, np.zeros(self.samples - order - 1), zi=start)
        return known

    def covariance_of(self, rows: Array) -> Array:
        """Return rows S rows', shape (n, n), where rows is (n, T) and S the noise's covariance matrix."""
        if not len(self.reflection):
            return self.level**2 * (rows @ rows.T)
        return rows @ np.asarray(matmul_toeplitz(self.autocovariance, rows.T), dtype=np.float64)

    def whitened(self, rows: Array) -> Array:
        """Return L^-1 rows' of S = L L', shape (n, T): what makes this noise white with unit variance."""
        predictors = self._predictors()
        polynomial, variance = predictors[-1]
        white = lfilter(polynomial, [1.0], rows, axis=1) / np.sqrt(variance)
        for m, (shorter, its_variance) in enumerate(predictors[:-1][: self.samples]):
            white[:, m] = rows[:, m::-1] @ shorter / np.sqrt(its_variance)  # the past is still short
        return white

    @property
    def effective_sample_size(self) -> float:
        """Effective sample size: how many independent samples would tell the mean as well; at most T."""
        weight = 2 * (1 - np.arange(self.samples) / self.samples)
        total = float(weight @ self.autocovariance) - self.level**2
        return self.samples / max(total / self.level**2, 1.0)

    @property
    def correlation_time(self) -> float:
        """Samples until the autocorrelation has fallen below 1/e for the first time; 0 of white noise."""
        below = np.flatnonzero(self.autocovariance < self.level**2 / np.e)
        return float(below[0] - 1) if len(below) else float(self.samples)

    def _predictors(self) -> list[tuple[Array, float]]:
        """Prediction-error filters of order 0 to p with the variance of what they leave."""
        polynomial, variance = np.ones(1), self.level**2
        found = [(polynomial, variance)]
        for k in self.reflection:
            longer = np.append(polynomial, 0.0)
            polynomial, variance = longer + k * longer[::-1], variance * (1 - k**2)
            found.append((polynomial, variance))
        return found


def statement_unit(channels: Sequence[Channel], residual: Array, how: ObjectiveSettings) -> float:
    """What a statement's score counts beside a row of residuals, shape (R,), in least squares [rad].

    As many residuals as there are samples, of noise that lasts, tell no more than the independent ones among
    them. So a score counts the noise's level times the root of how many samples make one that is independent.
    """
    noise = [channel_noise(channel, residual[channel.rows], how) for channel in channels]
    square = sum(n.samples * n.level**2 for n in noise)
    return float(np.sqrt(square / sum(n.effective_sample_size for n in noise)))


def channel_noise(channel: Channel, residual: Array, how: ObjectiveSettings) -> Noise:
    """Return a channel's noise: as the settings give it (white), else from its residual, shape (T,).

    A residual smaller than FLOOR, as simulated data without noise leave it, is not believed.
    """
    if channel.quantity == "angle":
        given = how.noise_deg.get(channel.joint) if isinstance(how.noise_deg, dict) else how.noise_deg
        si = None if given is None else float(np.deg2rad(given))
    else:
        si = None if how.noise_bar is None else how.noise_bar * 1e5
    if si is not None:
        return Noise(len(residual), si * channel.weight, np.empty(0), "settings")
    found = fit_noise(residual)
    least = FLOOR[channel.quantity] * channel.weight
    return found if found.level > least else Noise(len(residual), least, np.empty(0), "least believed")


def fit_noise(residual: Array, most: int = ORDER) -> Noise:
    """Fit an AR process of order 0 to `most` to a residual, shape (T,), whose mean is 0 but for the noise."""
    samples = len(residual)
    level = float(np.sqrt(np.mean(residual**2)))
    reflection: list[float] = []
    criterion = [0.0]
    forward = backward = residual
    for _ in range(min(most, samples // 4)):
        forward, backward = forward[1:], backward[:-1]
        power = float(forward @ forward + backward @ backward)
        if power <= 0:
            break
        k = -2 * float(forward @ backward) / power
        if not abs(k) < 1:
            break
        forward, backward = forward + k * backward, backward + k * forward
        reflection.append(k)
        criterion.append(criterion[-1] + samples * float(np.log1p(-(k**2))) + 2.0)
    best = int(np.argmin(criterion))
    return Noise(samples, level, np.array(reflection[:best]))


def unbiased(noise: Noise, course: Array, spread: Array) -> Noise:
    """Return the noise of which a least-squares fit left what `noise` was fitted to.

    A fit takes up the part of the noise that looks like its derivatives: slow noise above all. With U
    (orthonormal rows that span them) the residual's covariance is (1 - U'U) S (1 - U'U); the autocovariances
    are raised by what that takes, in a few rounds since S is not known beforehand.

    Args:
        noise: as fitted to a channel's residual.
        course: the channel's part of U, shape (p, T).
        spread: U S U' of all channels, shape (p, p).
    """
    samples, order = noise.samples, len(noise.reflection)
    seen, found = noise.autocovariance[: order + 1], noise
    for _ in range(ROUNDS):
        felt = np.asarray(matmul_toeplitz(found.autocovariance, course.T), dtype=np.float64).T
        taken = np.array(
            [
                np.sum(course[:, : samples - k] * felt[:, k:])
                + np.sum(felt[:, : samples - k] * course[:, k:])
                - np.sum((spread @ course[:, : samples - k]) * course[:, k:])
                for k in range(order + 1)
            ]
        )
        reflection = _levinson(seen + taken / (samples - np.arange(order + 1)))
        if reflection is None or taken[0] > HALF * samples * seen[0]:
            break  # the fit took up so much of the noise that nothing can be said about the rest
        found = Noise(samples, float(np.sqrt(seen[0] + taken[0] / samples)), reflection)
    return found


def _levinson(known: Array) -> Array | None:
    """Reflection coefficients from autocovariances at lags 0 to p; None where no process has these."""
    polynomial, variance, reflection = np.ones(1), known[0], np.empty(0)
    for m in range(1, len(known)):
        k = -(polynomial @ known[m:0:-1]) / variance
        if not abs(k) < 1:
            return None
        longer = np.append(polynomial, 0.0)
        polynomial, variance = longer + k * longer[::-1], variance * (1 - k**2)
        reflection = np.append(reflection, k)
    return reflection
