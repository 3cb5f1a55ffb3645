"""What the model lacks: each term that a fit holds is tested, and what freeing it would really gain."""

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from hydroid.parameters import Array, ParameterSet
from hydroid.problem.problem import Problem
from hydroid.search.least_squares import least_squares
from hydroid.search.linear_model import LinearModel
from hydroid.settings.search import RefinementSettings
from hydroid.suggestion.score import Explained, Score, holm
from hydroid.suggestion.terms import ExtendedModel, Term
from hydroid.uncertainty.covariance import Uncertainty

LEVEL = 0.05
"""probability that any term is called missing where none is"""
MIN_GAIN = 0.05
"""part of the rms error that freeing a term must save"""
FIRST = 1e-3
"""change of a term that is tried first, as a part of its span"""
TRIES = 12
"""changes of a term that are tried"""
FASTEST = 64.0
"""largest ratio of one change to the next"""
EFFECT = (0.1, 0.5)
"""rms effect of the change from which the derivative is taken, in parts of the rms residual, which counts as
MIN_RESIDUAL at least: large enough for terms that act beyond a threshold, small enough for a derivative"""
MIN_RESIDUAL = float(np.deg2rad(0.05))
"""[rad]"""
VISIBLE = 3.0
"""statistic of the largest change, without noise; a term below it cannot be told from the free parameters"""
PARTS = (0.25, 0.5, 1.0, 2.0)
"""of the projected step that are simulated"""
DAMPING = (1e-1, 1e-3, 1e-6)
"""of the projected step: less damping follows weak directions further"""
QUICK = RefinementSettings(iterations=20, gain_tolerance=1e-2)
"""of the refinement from the best of them"""


_NO_SCORE = Score(0.0, 0.0, 0.0, 1.0)


class Verdict(StrEnum):
    """What a test says about a term."""

    FREE = "free it"
    LEAVE = "no gain"
    INVISIBLE = "cannot be told from the free parameters"
    """no change of it has an effect above the noise that the free parameters could not have too"""


@dataclass(frozen=True)
class TermTest:
    """The test of one term.

    Attributes:
        term: that was tested.
        verdict: what it says.
        statistic: score in units of its standard deviation; positive: the change lowers the error.
        chance: of such a score if the model lacks nothing.
        rms: of the angles with the term freed [rad]; without a simulation as the linear model has it.
        value: of the term there, in its unit.
        like: name of a term with nearly the same effect that gains more.
    """

    term: Term
    verdict: Verdict
    statistic: float
    chance: float
    rms: float
    value: float
    like: str | None = None


@dataclass(frozen=True)
class MissingTerms:
    """All tests, those to free first, by their gain.

    rms: of the angles at the estimate [rad], or where a few further steps of the free parameters lead.
    """

    tests: tuple[TermTest, ...]
    rms: float


@dataclass(frozen=True, eq=False)
class _Direction:
    """A change of a term (see `Term.at`), its effect on the residuals, shape (R,), and its score."""

    change: float
    effect: Array
    score: Score


def missing_terms(problem: Problem, uncertainty: Uncertainty) -> MissingTerms:
    """Test every term that a problem holds at its estimate."""
    explained = Explained.by(problem, uncertainty)
    model = ExtendedModel(problem, uncertainty.theta)
    directions = _directions(model, explained)
    chances = {
        i: d.score.chance(one_sided=model.terms[i].lowest_change == 0.0) for i, d in directions.items()
    }
    significant = dict(zip(chances, holm(list(chances.values()), LEVEL), strict=True))
    rms = _freed(problem, uncertainty, model, None)[0]
    tests: list[TermTest] = []
    for i, term in enumerate(model.terms):
        if i not in directions:
            tests.append(TermTest(term, Verdict.INVISIBLE, 0.0, 1.0, rms, term.value))
            continue
        least, value = rms, term.value
        if significant[i]:
            least, value = _freed(problem, uncertainty, model, (i, directions[i]))
        verdict = Verdict.FREE if least < (1 - MIN_GAIN) * rms else Verdict.LEAVE
        z = directions[i].score.statistic
        tests.append(TermTest(term, verdict, z, chances[i], min(least, rms), value))
    tests.sort(key=lambda t: (list(Verdict).index(t.verdict), t.rms, t.chance))
    return MissingTerms(tuple(tests), rms)


def _directions(model: ExtendedModel, explained: Explained) -> dict[int, _Direction]:
    """Find a small change of each term, and its score; terms that cannot be told are left out."""
    unit = max(float(np.sqrt(np.mean(model.residual**2))), MIN_RESIDUAL)
    found: dict[int, _Direction] = {}
    search = dict.fromkeys(range(len(model.terms)), (0.0, np.inf, FIRST))  # too small, too large, next
    for _ in range(TRIES):
        tried, search = search, {}
        if not tried:
            break
        rows = model.residuals(
            np.tile(model.theta, (len(tried), 1)), list(tried), [c for *_, c in tried.values()]
        )
        for (i, (small, large, change)), row in zip(tried.items(), rows, strict=True):
            effect = row - model.residual
            size = float(np.sqrt(np.mean(effect**2))) / unit if np.isfinite(row).all() else np.inf
            if 0 < size < np.inf:
                found[i] = _Direction(change, effect, _NO_SCORE)
            small, large = (change, large) if size < EFFECT[0] else (small, change)
            if not EFFECT[0] <= size <= EFFECT[1] and small < 1.0:
                search[i] = (small, large, _next(small, large, change, size))
    scored = {i: replace(d, score=explained.score(d.effect)) for i, d in found.items()}
    return {i: d for i, d in scored.items() if d.score.strength >= VISIBLE * d.change}


def _next(small: float, large: float, change: float, size: float) -> float:
    """Return the next change: in the middle of the bracket, or as far as the effect grows in proportion."""
    if small > 0 and np.isfinite(large):
        return float(np.sqrt(small * large))
    ratio = np.sqrt(EFFECT[0] * EFFECT[1]) / max(size, 1e-9)
    return min(change * float(np.clip(ratio, 1 / FASTEST, FASTEST)), 1.0)


def _freed(
    problem: Problem, uncertainty: Uncertainty, model: ExtendedModel, freed: tuple[int, _Direction] | None
) -> tuple[float, float]:
    """Take projected steps with one more term free, or none; return the rms error [rad] and the term's value.

    Each step is a Gauss-Newton step with the derivatives of the estimate, kept within the bounds, of which
    several parts are simulated.
    """
    at, parameters, free = uncertainty.jacobian, problem.parameters, problem.parameters.free
    point = parameters.to_unit(uncertainty.theta[None])[0]
    slopes = np.nan_to_num(np.hstack([at.slopes, at.prior_weight * at.prior_slopes])[free])
    columns = slopes * (_widths(parameters, point) / at.scale[free])[:, None]
    terms, lowest = [], 0.0
    if freed is not None:
        i, direction = freed
        terms, lowest = [i], model.terms[i].lowest_change
        width = (1.0 - lowest) / direction.change
        effect = np.concatenate([direction.effect, np.zeros(len(problem.priors))])
        columns, point = np.vstack([columns, width * effect]), np.append(point, -lowest / (1.0 - lowest))

    def residuals(points: Array) -> Array:
        theta = parameters.from_unit(points[:, : len(slopes)])
        changes = lowest + (1.0 - lowest) * points[:, len(slopes) :].ravel()
        rows = model.residuals(theta, terms * len(points), changes.tolist())
        return np.hstack([rows, at.prior_weight * problem.priors.scores(theta)])

    row = residuals(point[None])[0]
    linear = LinearModel(point, row, columns.T)
    points = np.array([point, *(linear.reach(p * linear.step(d)) for d in DAMPING for p in PARTS)])
    rows = np.vstack([row, residuals(points[1:])])
    cost = np.where(np.isfinite(rows).all(axis=1), np.sum(rows**2, axis=1), np.inf)
    best = least_squares(points[int(np.argmin(cost))], residuals, QUICK)
    point, row = best.point, best.residual
    rms = float(problem.rms(row[None, : at.residual.size])[0])
    return rms, model.terms[terms[0]].at(lowest + (1.0 - lowest) * float(point[-1])) if terms else np.nan


def _widths(parameters: ParameterSet, unit: Array) -> Array:
    """Change of each free parameter per change of its place in the unit box, shape (p,)."""
    step = np.where(unit > 0.5, -1e-6, 1e-6)
    moved = parameters.from_unit(np.vstack([unit, unit + np.diag(step)]))[:, parameters.free]
    return np.diag(moved[1:] - moved[0]) / step
