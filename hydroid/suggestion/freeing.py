"""What freeing a term would gain: a projected step that is simulated, and a short refinement from there."""

from dataclasses import dataclass

import numpy as np

from hydroid.parameters import Array, ParameterSet
from hydroid.problem.problem import Problem
from hydroid.search.least_squares import least_squares
from hydroid.search.linear_model import LinearModel
from hydroid.settings.search import RefinementSettings
from hydroid.suggestion.terms import ExtendedModel
from hydroid.uncertainty.covariance import Uncertainty

PARTS = (0.25, 0.5, 1.0, 2.0)
"""of the projected step that are simulated"""
DAMPING = (1e-1, 1e-3, 1e-6)
"""of the projected step: less damping follows weak directions further"""
SHORT = RefinementSettings(iterations=10, gain_tolerance=1e-2)
"""of the refinement from the best of these"""


@dataclass(frozen=True)
class Freed:
    """What freeing one term, or none, leads to.

    rms: of the angles [rad]. value: of the term, in its unit; NaN without one.
    """

    rms: float
    value: float


class Freeing:
    """Frees one term at a time at an estimate, beside the free parameters."""

    def __init__(self, problem: Problem, uncertainty: Uncertainty, model: ExtendedModel) -> None:
        at, self._problem, self._model = uncertainty.jacobian, problem, model
        free = problem.parameters.free
        self._point = problem.parameters.to_unit(uncertainty.theta[None])[0]
        slopes = np.nan_to_num(np.hstack([at.slopes, at.prior_weight * at.prior_slopes])[free])
        self._columns = slopes * (_widths(problem.parameters, self._point) / at.scale[free])[:, None]
        self._prior_weight = at.prior_weight

    def without(self) -> Freed:
        """Refine the free parameters alone: an estimate that is no optimum gains without any term."""
        best = least_squares(self._point, lambda points: self._residuals(points, None), SHORT)
        return Freed(self._rms(best.residual), np.nan)

    def freed(self, term: int, change: float, effect: Array, *, refine: bool) -> Freed:
        """Free a term whose `change` has an effect on the residuals, shape (R,).

        Simulated are parts of Gauss-Newton steps within the bounds; then least squares may go on from there.
        """
        lowest = self._model.terms[term].lowest_change
        row = np.concatenate([effect, np.zeros(len(self._problem.priors))])
        columns = np.vstack([self._columns, (1.0 - lowest) / change * row])
        start = np.append(self._point, -lowest / (1.0 - lowest))

        def residuals(points: Array) -> Array:
            return self._residuals(points, term)

        linear = LinearModel(start, residuals(start[None])[0], columns.T)
        points = np.array([linear.reach(p * linear.step(d)) for d in DAMPING for p in PARTS])
        points = np.vstack([start, points])
        rows = np.vstack([linear.residual, residuals(points[1:])])
        cost = np.where(np.isfinite(rows).all(axis=1), np.sum(rows**2, axis=1), np.inf)
        best = int(np.argmin(cost))
        point, row = points[best], rows[best]
        if refine:
            state = least_squares(point, residuals, SHORT)
            point, row = state.point, state.residual
        change = lowest + (1.0 - lowest) * float(point[-1])
        return Freed(self._rms(row), self._model.terms[term].at(change))

    def _residuals(self, points: Array, term: int | None) -> Array:
        """Residuals and weighed priors at points of the unit box, the term's place last."""
        theta = self._problem.parameters.from_unit(points[:, : len(self._point)])
        if term is None:
            rows = self._model.residuals(theta)
        else:
            lowest = self._model.terms[term].lowest_change
            changes = lowest + (1.0 - lowest) * points[:, -1]
            rows = self._model.residuals(theta, [term] * len(points), changes.tolist())
        return np.hstack([rows, self._prior_weight * self._problem.priors.scores(theta)])

    def _rms(self, row: Array) -> float:
        return float(self._problem.rms(row[None, : self._problem.measured.size])[0])


def _widths(parameters: ParameterSet, unit: Array) -> Array:
    """Change of each free parameter per change of its place in the unit box, shape (p,)."""
    step = np.where(unit > 0.5, -1e-6, 1e-6)
    moved = parameters.from_unit(np.vstack([unit, unit + np.diag(step)]))[:, parameters.free]
    return np.diag(moved[1:] - moved[0]) / step
