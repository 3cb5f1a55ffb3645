"""What freeing a term would gain: a projected step that is simulated, and a short refinement from there."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hydroid.advice.terms import ExtendedModel
from hydroid.parameters import Array
from hydroid.posterior.covariance import Uncertainty
from hydroid.problem.problem import Problem
from hydroid.search.least_squares import least_squares
from hydroid.search.linear_model import LinearModel
from hydroid.settings.search import RefinementSettings

PARTS = (0.25, 0.5, 1.0, 2.0)
"""of the projected step that are simulated"""
DAMPING = (1e-1, 1e-3, 1e-6)
"""of the projected step: less damping follows weak directions further"""
LIMITS = (1.0, 1.25, 1.6, 2.0, 2.5)
"""changes of a limit that is switched off from which it is freed, as multiples of the one that just touches:
there is no derivative before it acts, and what it explains depends on where it lies"""
NEAR = 0.98
"""part of such a change; the difference gives the derivative"""
SHORT = RefinementSettings(iterations=30, gain_tolerance=1e-3)
"""of the refinement from the best of these"""


@dataclass(frozen=True, eq=False)
class Freed:
    """What freeing one term, or none, leads to.

    rms: of the angles [rad]. value: of the term, in its unit; NaN without one. residual: shape (R,).
    """

    rms: float
    value: float
    residual: Array


class Freeing:
    """Frees one term at a time at an estimate, beside the free parameters."""

    def __init__(self, problem: Problem, uncertainty: Uncertainty, model: ExtendedModel) -> None:
        at, self._problem, self._model = uncertainty.jacobian, problem, model
        free = problem.parameters.free
        self._point = problem.parameters.to_unit(uncertainty.theta)
        slopes = np.nan_to_num(np.hstack([at.slopes, at.prior_weight * at.prior_slopes])[free])
        widths = problem.parameters.width(uncertainty.theta)[free]
        self._columns = slopes * (widths / at.scale[free])[:, None]
        self._prior_weight = at.prior_weight

    def without(self) -> Freed:
        """Refine the free parameters alone: an estimate that is no optimum gains without any term."""
        best = least_squares(self._point, lambda points: self._residuals(points, None), SHORT)
        return self._freed(best.residual, np.nan)

    def freed(self, term: int, change: float, effect: Array, *, refine: bool) -> Freed:
        """Free a term whose `change` has an effect on the residuals, shape (R,).

        Simulated are parts of Gauss-Newton steps within the bounds; then least squares may go on from there.
        """
        lowest = self._model.terms[term].lowest_change

        def place(change: float) -> Array:
            return np.append(self._point, (change - lowest) / (1.0 - lowest))

        def residuals(points: Array) -> Array:
            return self._residuals(points, term)

        slopes = np.append(effect, np.zeros(len(self._problem.priors))) / change
        if math.isinf(self._model.terms[term].value):  # it has no derivative where it is switched off
            places = [place(min(factor * change, 1.0)) for factor in LIMITS]
            rows = residuals(np.array(places + [place(min(f * change, 1.0) * NEAR) for f in LIMITS]))
            starts = [
                (at, row, (row - near) / ((1 - NEAR) * (lowest + (1 - lowest) * at[-1])))
                for at, row, near in zip(places, rows, rows[len(places) :], strict=False)
            ]
        else:
            at = place(0.0)
            starts = [(at, residuals(at[None])[0], slopes)]
        best = min((self._stepped(start, lowest, residuals) for start in starts), key=lambda found: found[0])
        point, row = best[1:]
        if refine:
            state = least_squares(point, residuals, SHORT)
            point, row = state.point, state.residual
        change = lowest + (1.0 - lowest) * float(point[-1])
        return self._freed(row, self._model.terms[term].at(change))

    def _stepped(
        self,
        start: tuple[Array, Array, Array],
        lowest: float,
        residuals: Callable[[Array], Array],
    ) -> tuple[float, Array, Array]:
        """Return the cost, the point and the residuals of the best of some steps.

        `start` is a point, its residuals, and their derivative per change of the term.
        """
        at, row, slopes = start
        linear = LinearModel(at, row, np.vstack([self._columns, (1.0 - lowest) * slopes]).T)
        steps = np.array([linear.reach(p * linear.step(d)) for d in DAMPING for p in PARTS])
        points, rows = np.vstack([at, steps]), np.vstack([row, residuals(steps)])
        cost = np.where(np.isfinite(rows).all(axis=1), np.sum(rows**2, axis=1), np.inf)
        best = int(np.argmin(cost))
        return float(cost[best]), points[best], rows[best]

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

    def _freed(self, row: Array, value: float) -> Freed:
        residual = row[: self._problem.measured.size]
        return Freed(float(self._problem.rms(residual[None])[0]), value, residual)
