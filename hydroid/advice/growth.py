"""Growth: the terms that a model lacks, and whether they lower the error on parts of the logs left out.

A small change of each term changes the residual. What the free parameters cannot do as well tells how
clearly the term is missing, and how much freeing it would gain (`score`). That is cheap: some simulations a
term. The best few are then really freed: least squares goes on from the estimate, once with all samples and
once without each part of them, on which the result is judged. A term that only follows the noise loses there.

The score test: let r be the residual of a least-squares fit and d the change of the residual with a quantity
that the fit holds. What the free parameters can do as well as d, the fit has done already. So d is projected
off their effects, with the priors as further residuals: d' = d - U' U d with orthonormal rows U. The
statistic is the score of C. R. Rao (1948), robust to autocorrelated noise of covariance S (H. White, 1982):

    z = -d' r / sqrt(d' S d').

The change of the quantity that would explain most is a = -d' r / |d'|². S is that of the noise which the
residual shows without what d' explains, r + a d': a term that explains nearly everything is no noise. z then
follows about Student's t. Where d' and the noise are slow it has few degrees of freedom: the variance d' S d'
is a sum over frequencies, each of which is known from two numbers of the record. As many degrees count as the
sum has terms of equal size (F. E. Satterthwaite, 1946), or as the level of an autoregressive noise has, half
its effective samples; less the one that a took.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from scipy.linalg import matmul_toeplitz
from scipy.stats import t as student

from hydroid.advice.terms import Term, terms
from hydroid.arrays import Array, Mask, record, rms
from hydroid.posterior.noise import Noise, problem_noise
from hydroid.posterior.uncertainty import Uncertainty
from hydroid.problem.problem import Problem
from hydroid.progress import Progress


@record
class Score:
    """Statistic z of one change of the model, positive where the change lowers the error.

    By the linear approximation the `amount` of it that lowers the error most saves a `part` of the rms
    residual. `strength` is the statistic that the whole change would have without noise: what can be seen at
    all. `freedom` are the degrees of freedom of z.
    """

    statistic: float
    amount: float
    part: float
    strength: float
    freedom: float

    def chance(self, *, one_sided: bool) -> float:
        """Return the probability of such a statistic where the model lacks nothing."""
        tail = float(student.sf(self.statistic if one_sided else abs(self.statistic), self.freedom))
        return tail if one_sided else 2 * tail


@record
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
        square = float(row @ row)
        if not square > 0:
            return Score(0.0, 0.0, 0.0, 0.0, 1.0)
        gain = -float(row @ self.residual)
        left = (self.residual + gain / square * row)[: change.size]
        variance, freedom = self._variance(row, self.noise_of(left))
        deviation = np.sqrt(variance)
        before = max(float(np.linalg.norm(self.residual[: change.size])), np.finfo(float).tiny)
        saved = 1.0 - float(np.linalg.norm(left)) / before
        return Score(gain / deviation, gain / square, saved, square / deviation, freedom)

    def _variance(self, row: Array, noise: Sequence[Noise]) -> tuple[float, float]:
        """Variance of the product of a row, (R + M + p,), with the residuals, and its degrees of freedom."""
        variance = self.prior_weight**2 * np.sum(row[self.rows[-1].stop :] ** 2)
        spectra: list[Array] = []
        for process, part in zip(noise, self.rows, strict=True):
            weighed = matmul_toeplitz(process.autocovariance, row[part])
            variance += float(row[part] @ weighed)
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
    weak = np.zeros(len(linear.slopes))  # the estimate does not depend on the weak priors
    residual = np.concatenate([linear.residual, scores, weak])
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


LEVEL = 0.05  # probability that any term is a candidate where none is missing
MIN_GAIN = 0.02
"""part of the rms error that a candidate must promise to save, and then save on the parts left out"""
VISIBLE = 3.0
"""statistic of the largest change, without noise; a term below it cannot be told from the free parameters"""
LARGEST_EFFECT = 0.5
"""rms effect of the change that is tested, in parts of the rms residual: large enough for terms that act
beyond a threshold, small enough for a derivative"""
MIN_RESIDUAL = np.deg2rad(0.05)  # what the rms residual counts at least [rad]


@record
class Candidate:
    """A change of the settings that frees one more parameter, to be refined from `start`, in its unit.

    Attributes:
        score: how clearly the residual shows its effect, in standard deviations.
        chance: of such a score if the model lacks nothing.
        gain: part of the rms error that freeing it saves, by the linear approximation.
    """

    term: Term
    start: float
    score: float
    chance: float
    gain: float


def score_terms(problem: Problem, known: Uncertainty, progress: Progress) -> list[Candidate]:
    """Test every term of a problem at an estimate; those that the logs cannot show are left out."""
    every, fit, tests = terms(problem, known.theta), explained(problem, known), list[Candidate]()
    for done, term in enumerate(every):
        progress("terms", done, len(every))
        tests += _tested(term, problem, known, fit)
    return tests


def promising(tests: Sequence[Candidate]) -> list[Candidate]:
    """Return those that are significant among all (S. Holm, 1979) and promise MIN_GAIN, the best first.

    Of one quantity of one joint only the best: a side, or both.
    """
    significant, best = holm([one.chance for one in tests], LEVEL), dict[object, Candidate]()
    for one, holds in sorted(zip(tests, significant, strict=True), key=lambda pair: -pair[0].gain):
        if holds and one.gain >= MIN_GAIN:
            best.setdefault(one.term.kind, one)
    return list(best.values())


def _tested(term: Term, problem: Problem, known: Uncertainty, fit: Explained) -> list[Candidate]:
    """Test one term by the largest change whose effect is small, a limit by each that acts."""
    (low, high), limit = term.span, math.isinf(term.value)
    end = high if high - term.value >= term.value - low else low
    parts = np.zeros(16) if limit else 4.0 ** np.arange(-5.0, 1.0)
    values = np.geomspace(high, low, 16) if limit else term.value + parts * (end - term.value)
    residual = known.linear.residual
    effects = term.residuals(problem, known.theta, values.tolist()) - residual
    sizes = rms(effects, axis=1) / max(rms(residual), MIN_RESIDUAL)
    acting = np.flatnonzero(np.isfinite(sizes) & (sizes > 0))
    if not limit:
        acting = acting[: max(np.sum(sizes[acting] <= LARGEST_EFFECT), 1)][-1:]
    one_sided = limit or term.value in term.span
    scores = list[tuple[float, Score, float]]()
    for i in acting:
        score = fit.score(effects[i])
        if score.strength >= VISIBLE * parts[i]:
            gain = 0.0 if one_sided and score.statistic <= 0 else score.part
            away = values[i] - term.value
            start = values[i] if limit else term.value + np.copysign(away, away * score.amount)
            scores.append((gain, score, np.clip(start, low, high)))
    if not scores:
        return []
    gain, score, start = max(scores, key=lambda one: one[0])
    chance = min(len(scores) * score.chance(one_sided=one_sided), 1.0)
    return [Candidate(term, start, score.statistic if one_sided else abs(score.statistic), chance, gain)]
