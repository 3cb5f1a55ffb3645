"""Growth: the terms that a model lacks, and whether they lower the error on parts of
the logs left out.

A small change of each term changes the residual. What the free parameters cannot do as
well tells how clearly the term is missing, and how much freeing it would gain
(`score`). That is cheap: some simulations a term. The best few are then really freed,
and judged on parts of the logs left out: there a term that only follows the noise
loses.

The score test: let r be the innovations at a maximum of the likelihood and d the change
of them with a quantity that the fit holds. What the free parameters can do as well as
d, the fit has done already. So d is projected off their effects, with the priors'
scores as further rows: d' = d - U' U d with orthonormal rows U. The statistic is the
score of C. R. Rao (1948), a standard normal variable where the model lacks nothing:

    z = -d' r / √(Var d' r),

whose variance is that of the errors as they are, whatever least squares weighs them by.

The change of the quantity that would explain most is a = -d' r / |d'|². It raises the
log-likelihood that least squares takes by a² |d'|² / 2.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy.stats import norm as normal

from hydroid.advice.terms import Term, terms
from hydroid.arrays import Array, Mask, record, rms
from hydroid.posterior.uncertainty import Uncertainty
from hydroid.problem.problem import Problem
from hydroid.progress import Progress


@record
class Score:
    """Statistic z of one change of the model, positive where the change lowers the
    error.

    By the linear approximation the `amount` of it that lowers the error most raises the
    log-likelihood that least squares takes by `gain`. `strength` is the statistic that
    the whole change would have without noise: what can be seen at all.
    """

    statistic: float
    amount: float
    strength: float
    gain: float

    def chance(self, *, one_sided: bool) -> float:
        """Return the probability of such a statistic where the model lacks nothing."""
        tail = float(normal.sf(self.statistic if one_sided else abs(self.statistic)))
        if one_sided:
            return tail
        return 2 * tail


@record
class Explained:
    """What a fit has explained, and what it has left.

    Attributes:
        effects: of the free parameters, orthonormal rows with all priors behind, (k, R
            + M + p).
        left: innovations with the priors' scores behind, shape (R + M + p,).
        variance: of what is left, summed along a row of that shape.
    """

    effects: Array
    left: Array
    variance: Callable[[Array], float]

    def score(self, change: Array) -> Score:
        """Return the score of a change of the innovations, shape (R,)."""
        row = np.append(change, np.zeros(self.left.size - change.size))
        row -= self.effects.T @ (self.effects @ row)
        square = float(row @ row)
        if not square > 0:
            return Score(0.0, 0.0, 0.0, 0.0)
        deviation = math.sqrt(self.variance(row))
        amount = -float(row @ self.left) / square
        gain = 0.5 * amount**2 * square
        strength = square / deviation
        return Score(amount * square / deviation, amount, strength, gain)


def explained(problem: Problem, uncertainty: Uncertainty) -> Explained:
    """Return what a fit has explained at an estimate. Parameters at bounds are held."""
    linear = uncertainty.linear
    # the estimate does not depend on the weak priors
    weak = np.zeros(len(linear.slopes))
    of_priors = problem.priors.weighed_at(uncertainty.theta)(uncertainty.theta[None])[0]
    left = np.concatenate([linear.innovations, of_priors, weak])

    def variance(row: Array) -> float:
        samples = problem.measured.size
        of_logs = uncertainty.variance(row[:samples])
        # scores of priors have a variance of 1
        return of_logs + float(np.sum(row[samples:] ** 2))

    return Explained(linear.effects, left, variance)


def holm(chances: Sequence[float], level: float) -> Mask:
    """Return which findings hold, any false one with at most a probability `level` (S.
    Holm, 1979)."""
    p = np.array(chances, dtype=float)
    order = np.argsort(p)
    holds = p[order] <= level / np.arange(len(p), 0, -1)
    kept = np.zeros(len(p), dtype=bool)
    kept[order] = np.cumprod(holds, dtype=bool)
    return kept


LEVEL = 0.05  # probability that any term is a candidate where none is missing
MIN_GAIN = 2.0
"""rise of the log-likelihood that a candidate must promise:
that of one more parameter by Akaike's measure"""
VISIBLE = 3.0
"""statistic of the largest change, without noise;
a term below it cannot be told from the free parameters"""
LARGEST_EFFECT = 0.5
"""rms effect of the change that is tested, in rms innovations: large enough for terms
that act beyond a threshold, small enough for a derivative"""


@record
class Candidate:
    """A change of the settings that frees one more parameter, to be refined from
    `start`, in its unit.

    Attributes:
        score: how clearly the residual shows its effect, in standard deviations.
        chance: of such a score if the model lacks nothing.
        gain: rise of the log-likelihood by freeing it, by the linear approximation.
    """

    term: Term
    start: float
    score: float
    chance: float
    gain: float


def score_terms(
    problem: Problem, uncertainty: Uncertainty, progress: Progress
) -> list[Candidate]:
    """Test every term of a problem at an estimate; those that the logs cannot show are
    left out."""
    every = terms(problem, uncertainty.theta)
    fit = explained(problem, uncertainty)
    candidates = list[Candidate]()
    for done, term in enumerate(every):
        progress("terms", done, len(every))
        candidate = _tested(term, uncertainty, fit)
        if candidate is not None:
            candidates.append(candidate)
    return candidates


def promising(tests: Sequence[Candidate]) -> list[Candidate]:
    """Return those that are significant among all (S. Holm, 1979) and promise MIN_GAIN,
    the best first.

    Of one quantity of one joint only the best: a side, or both.
    """
    significant = holm([candidate.chance for candidate in tests], LEVEL)
    kept = [
        candidate
        for candidate, holds in zip(tests, significant, strict=True)
        if holds and candidate.gain >= MIN_GAIN
    ]
    best = dict[object, Candidate]()
    for candidate in sorted(kept, key=lambda candidate: -candidate.gain):
        best.setdefault(candidate.term.kind, candidate)
    return list(best.values())


def _tested(term: Term, uncertainty: Uncertainty, fit: Explained) -> Candidate | None:
    """Test one term by the largest change whose effect is small, a limit by each that
    acts.

    None: the logs cannot show it.
    """
    low, high = term.span
    is_limit = math.isinf(term.value)
    if is_limit:
        values = np.geomspace(high, low, 16)
        parts = np.zeros(16)
    else:
        # towards the bound that leaves more room
        end = low
        if high - term.value >= term.value - low:
            end = high
        parts = 4.0 ** np.arange(-5.0, 1.0)
        values = term.value + parts * (end - term.value)
    innovations = term.innovations(
        uncertainty.likelihood, uncertainty.theta, values.tolist()
    )
    effects = innovations - uncertainty.linear.innovations
    noise = float(rms(uncertainty.linear.innovations))
    # simulated logs without noise can be fitted exactly
    sizes = rms(effects, axis=1) / max(noise, np.finfo(float).tiny)
    acting = np.flatnonzero(np.isfinite(sizes) & (sizes > 0))
    if not is_limit:
        small = np.sum(sizes[acting] <= LARGEST_EFFECT)
        acting = acting[: max(small, 1)][-1:]
    one_sided = is_limit or term.value in term.span
    # gain, score, and where a refinement starts
    tried = list[tuple[float, Score, float]]()
    for i in acting:
        score = fit.score(effects[i])
        if score.strength < VISIBLE * parts[i]:
            continue
        gain = 0.0 if one_sided and score.statistic <= 0 else score.gain
        start = values[i]
        if not is_limit:
            change = values[i] - term.value
            start = term.value + np.copysign(change, change * score.amount)
        tried.append((gain, score, np.clip(start, low, high)))
    if not tried:
        return None
    gain, score, start = max(tried, key=lambda trial: trial[0])
    # as many limits as were tried may each look significant by chance (C. E.
    # Bonferroni)
    chance = min(len(tried) * score.chance(one_sided=one_sided), 1.0)
    statistic = score.statistic if one_sided else abs(score.statistic)
    return Candidate(term, start, statistic, chance, gain)
