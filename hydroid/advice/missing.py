"""What the model lacks: each term that a fit holds is tested, and what freeing it would really gain."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from hydroid.advice.freeing import LIMITS, Freed, Freeing
from hydroid.advice.score import Explained, Score, holm
from hydroid.advice.terms import ExtendedModel, Term
from hydroid.parameters import Array
from hydroid.posterior.covariance import Uncertainty
from hydroid.problem.problem import Problem
from hydroid.progress import Progress, no_progress

LEVEL = 0.05
"""probability that any term is called missing where none is"""
MIN_GAIN = 0.05
"""part of the rms error that freeing a term must save"""
PROMISING = 0.5 * MIN_GAIN
"""part that the linear model must promise for it to be tried"""
MOST_TRIED = {True: 6, False: 3}
"""terms that are tried, the most promising first, where thorough or not; of one quantity only one: a side,
or both"""
FIRST = 1e-3
"""change of a term that is simulated first, as a part of its span"""
TRIES = 12
"""changes of a term that are simulated"""
FASTEST = 64.0
"""largest ratio of one change to the next"""
EFFECT = (0.1, 0.5)
"""rms effect of the change from which the derivative is taken, in parts of the rms residual, which counts as
MIN_RESIDUAL at least: large enough for terms that act beyond a threshold, small enough for a derivative"""
MIN_RESIDUAL = float(np.deg2rad(0.05))
"""[rad]"""
VISIBLE = 3.0
"""statistic of the largest change, without noise; a term below it cannot be told from the free parameters"""


class Verdict(StrEnum):
    """What a test says about a term."""

    FREE = "free"
    """it is significant, and freeing it lowers the error by MIN_GAIN at least"""
    UNTRIED = "untried"
    """it is significant, but others promise more"""
    LEAVE = "leave"
    """no gain, or none beyond the noise"""
    INVISIBLE = "invisible"
    """the logs cannot tell any change of it from changes of the free parameters"""


@dataclass(frozen=True)
class TermTest:
    """The test of one term.

    Attributes:
        term: that was tested.
        verdict: what it says.
        statistic: score in units of its standard deviation; positive: the change lowers the error.
        chance: of such a score if the model lacks nothing.
        rms: of the angles with the term freed [rad], simulated; that of the fit where it was not tried.
        value: of the term there, in its unit.
    """

    term: Term
    verdict: Verdict
    statistic: float
    chance: float
    rms: float
    value: float


@dataclass(frozen=True)
class MissingTerms:
    """All tests, those to free first, by their gain.

    rms: of the angles at the estimate [rad], or where refining the free parameters once more leads.
    """

    tests: tuple[TermTest, ...]
    rms: float

    @property
    def free(self) -> tuple[TermTest, ...]:
        """Those to free."""
        return tuple(t for t in self.tests if t.verdict is Verdict.FREE)


@dataclass(frozen=True, eq=False)
class _Direction:
    """A change of a term (see `Term.at`), its effect on the residuals, shape (R,), and its score."""

    change: float
    effect: Array
    score: Score


def missing_terms(
    problem: Problem, uncertainty: Uncertainty, *, thorough: bool = True, progress: Progress = no_progress
) -> MissingTerms:
    """Test every term that a problem holds at its estimate.

    A term must be significant among all that are tested (S. Holm, 1979), and freeing it must gain. What it
    gains is simulated: parts of projected steps. Where `thorough`, least squares goes on from the best of
    them, more terms are tried, and each side of an actuator is tested beside both together.
    """
    model = ExtendedModel(problem, uncertainty.theta, sides=thorough)
    progress("terms", 0, len(model.terms))
    explained = Explained.by(problem, uncertainty)
    directions = _directions(model, explained)
    chances = {i: _chance(model.terms[i], d.score) for i, d in directions.items()}
    freeing = Freeing(problem, uncertainty, model)
    rms = freeing.without().rms if thorough else float(problem.rms(model.residual[None])[0])
    freed: dict[int, Freed] = {}
    for i in _to_try(model.terms, directions, _significant(chances))[: MOST_TRIED[thorough]]:
        progress(f"freeing {model.terms[i].name}", len(freed), MOST_TRIED[thorough])
        freed[i] = freeing.freed(i, directions[i].change, directions[i].effect, refine=thorough)
        # what is left then is the noise: far from a derivative's range the step does not show it
        after = freed[i].residual
        chances[i] = _chance(model.terms[i], explained.score(after - model.residual, after))
    significant = _significant(chances)
    tests: list[TermTest] = []
    for i, term in enumerate(model.terms):
        found = freed.get(i)
        lowest, value = (rms, term.value) if found is None or found.rms >= rms else (found.rms, found.value)
        if i not in directions:
            verdict = Verdict.INVISIBLE
        elif i in significant and lowest < (1 - MIN_GAIN) * rms:
            verdict = Verdict.FREE
        else:
            promises = i in significant and i not in freed and directions[i].score.part >= PROMISING
            verdict = Verdict.UNTRIED if promises else Verdict.LEAVE
        statistic = directions[i].score.statistic if i in directions else 0.0
        tests.append(TermTest(term, verdict, statistic, chances.get(i, 1.0), lowest, value))
    tests.sort(key=lambda t: (list(Verdict).index(t.verdict), t.rms, t.chance))
    return MissingTerms(tuple(tests), rms)


def _significant(chances: Mapping[int, float]) -> set[int]:
    """Return the terms that are significant among all (S. Holm, 1979)."""
    return {i for i, holds in zip(chances, holm(list(chances.values()), LEVEL), strict=True) if holds}


def _to_try(
    terms: Sequence[Term], directions: Mapping[int, _Direction], significant: Collection[int]
) -> list[int]:
    """Return the most promising term of each quantity of each joint: significant ones first, then limits."""

    def rank(i: int) -> tuple[bool, bool, float]:
        return i not in significant, math.isfinite(terms[i].value), -directions[i].score.part

    best: dict[object, int] = {}
    for i in sorted(directions, key=rank):
        if directions[i].score.part >= PROMISING or math.isinf(terms[i].value):
            best.setdefault(terms[i].kind, i)
    return list(best.values())


def _directions(model: ExtendedModel, explained: Explained) -> dict[int, _Direction]:
    """Find a small change of each term, and its score; terms that cannot be told apart are left out."""
    unit = max(float(np.sqrt(np.mean(model.residual**2))), MIN_RESIDUAL)
    effects: dict[int, tuple[float, Array]] = {}
    search = dict.fromkeys(range(len(model.terms)), (0.0, np.inf, FIRST))  # too small, too large, next
    for _ in range(TRIES):
        tried, search = search, {}
        if not tried:
            break
        changes = [change for *_, change in tried.values()]
        rows = model.residuals(np.tile(model.theta, (len(tried), 1)), list(tried), changes)
        for (i, (small, large, change)), row in zip(tried.items(), rows, strict=True):
            effect = row - model.residual
            size = float(np.sqrt(np.mean(effect**2))) / unit if np.isfinite(row).all() else np.inf
            if 0 < size < np.inf:
                effects[i] = change, effect
            small, large = (change, large) if size < EFFECT[0] else (small, change)
            if not EFFECT[0] <= size <= EFFECT[1] and small < 1.0:
                search[i] = (small, large, _next(small, large, change, size))
    found = {
        i: _Direction(change, effect, explained.score(effect)) for i, (change, effect) in effects.items()
    }
    return {
        i: d
        for i, d in found.items()
        if d.score.strength >= VISIBLE * d.change or math.isinf(model.terms[i].value)
    }


def _chance(term: Term, score: Score) -> float:
    """Probability of a score if the model lacks nothing; for the best of several limits, of any of these."""
    chance = score.chance(one_sided=term.lowest_change == 0.0)
    return min(len(LIMITS) * chance, 1.0) if math.isinf(term.value) else chance


def _next(small: float, large: float, change: float, size: float) -> float:
    """Return the next change: in the middle of the bracket, or as far as the effect grows in proportion."""
    if small > 0 and np.isfinite(large):
        return float(np.sqrt(small * large))
    ratio = np.sqrt(EFFECT[0] * EFFECT[1]) / max(size, 1e-9)
    return min(change * float(np.clip(ratio, 1 / FASTEST, FASTEST)), 1.0)
