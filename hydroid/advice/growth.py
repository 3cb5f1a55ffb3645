"""Growth: the terms that a model lacks, and whether they lower the error on parts of the logs left out.

A small change of each term changes the residual. What the free parameters cannot do as well tells how
clearly the term is missing, and how much freeing it would gain (`score`). That is cheap: some simulations a
term. The best few are then really freed: least squares goes on from the estimate, once with all samples and
once without each part of them, on which the result is judged. A term that only follows the noise loses there.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hydroid.advice.score import Explained, Score, explained, holm
from hydroid.advice.terms import Term, terms
from hydroid.arrays import Array, Mask
from hydroid.posterior.linear import least_squares_rows
from hydroid.posterior.noise import prior_weight
from hydroid.posterior.uncertainty import Uncertainty
from hydroid.problem.problem import Problem
from hydroid.progress import Progress, no_progress
from hydroid.search.descent import Descent
from hydroid.search.least_squares import least_squares
from hydroid.settings.search import RefinementSettings

LEVEL = 0.05
"""probability that any term is a candidate where none is missing"""
MIN_GAIN = 0.02
"""part of the rms error that a candidate must promise to save, and then save on the parts left out"""
VISIBLE = 3.0
"""statistic of the largest change, without noise; a term below it cannot be told from the free parameters"""
LARGEST_EFFECT = 0.5
"""rms effect of the change that is tested, in parts of the rms residual: large enough for terms that act
beyond a threshold, small enough for a derivative"""
MIN_RESIDUAL = np.deg2rad(0.05)
"""what the rms residual counts at least [rad]"""
SHORT = RefinementSettings(iterations=30, gain_tolerance=1e-3)
"""of the refinements from an estimate"""


@dataclass(frozen=True)
class Candidate:
    """A change of the settings that frees one more parameter.

    Attributes:
        term: the change.
        start: value to refine it from, in its unit.
        score: how clearly the residual shows its effect, in standard deviations.
        chance: of such a score if the model lacks nothing.
        gain: part of the rms error that freeing it saves, by the linear approximation.
    """

    term: Term
    start: float
    score: float
    chance: float
    gain: float


@dataclass(frozen=True, eq=False)
class Refit:
    """What a short refinement leads to.

    Attributes:
        theta: shape (P,).
        rms: of the angles [rad]; infinite where the start cannot be simulated.
        left_out: the same on each part of the samples, of refinements without that part.
    """

    theta: Array
    rms: float
    left_out: float

    @property
    def degrees(self) -> dict[str, float]:
        """Its errors [deg], as JSON has them."""
        return {"rms_deg": math.degrees(self.rms), "left_out_deg": math.degrees(self.left_out)}


def score_terms(problem: Problem, known: Uncertainty, progress: Progress = no_progress) -> list[Candidate]:
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


def refitted(problem: Problem, theta: Array, weight: float | None = None) -> Refit:
    """Refine an estimate, shape (P,), with all samples, and without each part of them.

    The parts are the logs, in three groups at most, or the halves of one log. `weight` is that of a prior's
    score beside the residuals [rad]; None: as the noise at theta has it.
    """
    parameters, size = problem.parameters, problem.measured.size
    if weight is None:
        row = problem.residuals(theta[None])[0]
        weight = prior_weight(problem, row)
    rows = least_squares_rows(problem, theta, weight)

    def fitted(point: Array, kept: slice | Mask = slice(None)) -> Descent:
        return least_squares(point, lambda points: rows(parameters.from_unit(points))[:, kept], SHORT)

    whole = fitted(parameters.to_unit(theta))
    if not np.isfinite(whole.cost):
        return Refit(theta, np.inf, np.inf)
    number, unseen = np.zeros(whole.residual.size), np.empty(size)
    for c in problem.channels:
        halves = np.arange(len(c.measured)) >= len(c.measured) // 2
        number[c.rows] = 1 + (c.log % 3 if len(problem.logs) > 1 else halves)
    for part in np.unique(number[:size]):
        out = number == part
        unseen[out[:size]] = rows(parameters.from_unit(fitted(whole.point, ~out).point)[None])[0, out]
    rms = problem.rms(np.stack([whole.residual[:size], unseen])).tolist()
    return Refit(parameters.from_unit(whole.point), *rms)


def _tested(term: Term, problem: Problem, known: Uncertainty, fit: Explained) -> list[Candidate]:
    """Test one term by the largest change whose effect is small, a limit by each that acts."""
    (low, high), limit = term.span, math.isinf(term.value)
    end = high if high - term.value >= term.value - low else low
    parts = np.zeros(16) if limit else 4.0 ** np.arange(-5.0, 1.0)
    values = np.geomspace(high, low, 16) if limit else term.value + parts * (end - term.value)
    residual = known.linear.residual
    effects = term.residuals(problem, known.theta, values.tolist()) - residual
    unit = max(np.sqrt(np.mean(residual**2)), MIN_RESIDUAL)
    sizes = np.sqrt(np.mean(effects**2, axis=1)) / unit
    acting = np.flatnonzero(np.isfinite(sizes) & (sizes > 0))
    if not limit:
        acting = acting[: max(int(np.sum(sizes[acting] <= LARGEST_EFFECT)), 1)][-1:]
    one_sided = limit or term.value in term.span
    scores: list[tuple[float, Score, float]] = []
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
