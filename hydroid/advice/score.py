"""Score test: does a residual resemble the effect of something that the model lacks?

Let r be the residual of a least-squares fit and d the change of the residual with a quantity that the fit
holds. What the free parameters can do as well as d, the fit has done already. So d is projected off their
effects, with the priors as further residuals: d' = d - U' U d with orthonormal rows U. The statistic is the
score of C. R. Rao (1948), robust to autocorrelated noise of covariance S (H. White, 1982):

    z = -d' r / sqrt(d' S d').

The change of the quantity that would explain most is a = -d' r / |d'|². S is that of the noise which the
residual shows without what d' explains, r + a d': a term that explains nearly everything is no noise. z then
follows about Student's t. Where d' and the noise are slow it has few degrees of freedom: the variance d' S d'
is a sum over frequencies, each of which is known from two numbers of the record. As many degrees count as the
sum has terms of equal size (F. E. Satterthwaite, 1946), or as the level of an autoregressive noise has, half
its effective samples; less the one that a took.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.linalg import matmul_toeplitz
from scipy.stats import t as student

from hydroid.arrays import Array, Mask
from hydroid.posterior.noise import Noise, problem_noise
from hydroid.posterior.uncertainty import Uncertainty
from hydroid.problem.problem import Problem


@dataclass(frozen=True)
class Score:
    """Statistic of one change of the model.

    Attributes:
        statistic: z; positive where the change lowers the error.
        amount: of the change that lowers it most, by the linear approximation.
        part: of the rms residual that this saves, by the same approximation.
        strength: the statistic that the whole change would have without noise: what can be seen at all.
        freedom: degrees of freedom of the statistic.
    """

    statistic: float
    amount: float
    part: float
    strength: float
    freedom: float

    def chance(self, *, one_sided: bool) -> float:
        """Return the probability of such a statistic where the model lacks nothing."""
        tail = student.sf(self.statistic if one_sided else abs(self.statistic), self.freedom)
        return tail if one_sided else 2 * tail


@dataclass(frozen=True, eq=False)
class Explained:
    """What a fit has explained, and the noise that it has left.

    Attributes:
        effects: of the free parameters, orthonormal rows of residuals with all priors behind, (k, R + M + p).
        residual: of the fit with the priors' weighted scores behind, shape (R + M + p,).
        noise_of: the noise of each channel, from a row of residuals, shape (R,).
        rows: of each channel.
        prior_weight: standard deviation of a prior's row.
    """

    effects: Array
    residual: Array
    noise_of: Callable[[Array], Sequence[Noise]]
    rows: Sequence[slice]
    prior_weight: float

    def score(self, change: Array) -> Score:
        """Return the score of a change of the residuals, shape (R,)."""
        row = np.append(change, np.zeros(self.residual.size - change.size))
        row -= self.effects.T @ (self.effects @ row)
        square = row @ row
        if not square > 0:
            return Score(0.0, 0.0, 0.0, 0.0, 1.0)
        gain = -(row @ self.residual)
        left = (self.residual + gain / square * row)[: change.size]
        variance, freedom = self._variance(row, self.noise_of(left))
        deviation = np.sqrt(variance)
        before = max(np.linalg.norm(self.residual[: change.size]), np.finfo(float).tiny)
        saved = 1.0 - np.linalg.norm(left) / before
        return Score(gain / deviation, gain / square, saved, square / deviation, freedom)

    def _variance(self, row: Array, noise: Sequence[Noise]) -> tuple[float, float]:
        """Variance of the product of a row, (R + M + p,), with the residuals, and its degrees of freedom."""
        variance = self.prior_weight**2 * np.sum(row[self.rows[-1].stop :] ** 2)
        spectra: list[Array] = []
        for process, part in zip(noise, self.rows, strict=True):
            weighed = matmul_toeplitz(process.autocovariance, row[part])
            variance += row[part] @ weighed
            power = np.real(np.conj(np.fft.rfft(row[part])) * np.fft.rfft(weighed))
            spectra.append(np.maximum(power, 0.0) / weighed.size)
        spectrum = np.concatenate(spectra)
        equal = np.sum(spectrum) ** 2 / np.sum(spectrum**2)
        level = 0.5 * sum(process.effective_sample_size for process in noise)
        return variance, max(max(2 * equal, level) - 1, 1.0)


def explained(problem: Problem, known: Uncertainty) -> Explained:
    """Return what a fit has explained at an estimate. Parameters at bounds are held."""
    linear = known.linear
    scores = linear.prior_weight * problem.priors.scores(known.theta[None])[0]
    residual = np.zeros(linear.effects.shape[1])  # 0 behind: the estimate does not depend on the weak priors
    residual[: linear.residual.size + scores.size] = np.append(linear.residual, scores)
    rows, noise_of = [c.rows for c in problem.channels], partial(problem_noise, problem)
    return Explained(linear.effects, residual, noise_of, rows, linear.prior_weight)


def holm(chances: Sequence[float], level: float) -> Mask:
    """Return which findings hold, any false one with at most a probability `level` (S. Holm, 1979)."""
    p = np.array(chances, dtype=float)
    order = np.argsort(p)
    holds = p[order] <= level / np.arange(len(p), 0, -1)
    kept = np.zeros(len(p), dtype=bool)
    kept[order] = np.cumprod(holds, dtype=bool)
    return kept
