"""Intervals without the linear approximation: profile likelihood."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from hydroid.errors import SettingsError
from hydroid.parameters import Array
from hydroid.posterior.covariance import Uncertainty, at_bounds, linearise
from hydroid.posterior.open_start import with_open_start
from hydroid.posterior.posterior import COVERAGE
from hydroid.problem.problem import Problem
from hydroid.search.least_squares import least_squares
from hydroid.settings.search import RefinementSettings

THRESHOLD = float(chi2.ppf(COVERAGE, 1))
"""deviance beyond which a value lies outside the interval"""
STEPS_PER_REACH = 6
"""points of a profile on each side, if the deviance is the parabola of the linear approximation"""
REACH = 3.0
"""standard deviations that these points then reach; they reach the bound of an unidentifiable parameter"""
MAX_POINTS = 12
"""points on each side at most; the steps grow after STEPS_PER_REACH"""
ZOOMS = 4
"""times that steps are made smaller because the interval ends within the first two"""
BETTER_BELOW = -0.1
"""deviance below which a profile has reached a better optimum; above it, only rounding"""
QUICK = RefinementSettings(iterations=50, gain_tolerance=1e-6)
Residuals = Callable[[Array], Array]
"""(n, P) -> (n, R + M): residuals with the priors' weighted scores behind them, as in a refinement"""


@dataclass(frozen=True, eq=False)
class Profile:
    """Deviance of a parameter held at several values, the others fitted again.

    Attributes:
        name: of the parameter.
        values: it was held at, increasing, the estimate among them, shape (n,); they end beyond the interval.
        deviance: rise of the cost in units of the noise, (n,): about ((value - estimate) / sd)² near it.
        interval: where the deviance is below THRESHOLD; infinite on a side where it never exceeds it.
        lowest: all parameters at the point of the lowest deviance, shape (P,).
        bounded: other parameters that lie at a bound somewhere within the interval.
    """

    name: str
    values: Array
    deviance: Array
    interval: tuple[float, float]
    lowest: Array
    bounded: tuple[str, ...] = ()

    @property
    def better_optimum(self) -> bool:
        """Whether a point fits better than the estimate, which then is no optimum."""
        return bool(self.deviance.min() < BETTER_BELOW)


def profile(problem: Problem, uncertainty: Uncertainty, name: str) -> Profile:
    """Hold a parameter at several values and fit the others, each time from the neighbour's result.

    With autocorrelated noise the rise of a sum of squares is no likelihood ratio. It is scaled so that its
    curvature is the estimate's variance (L. Pace, A. Salvan, N. Sartori, 2011).

    Raises:
        SettingsError: no free parameter of that name.
    """
    names = problem.parameters.names
    if name not in names or not uncertainty.free[names.index(name)]:
        free = ", ".join(n for n, is_free in zip(names, uncertainty.free, strict=True) if is_free)
        raise SettingsError(f"no free parameter {name!r} to profile", hint=f"free: {free}")
    i = names.index(name)
    theta, residuals = uncertainty.theta, _with_priors(problem, uncertainty)
    cost, unit = float(np.sum(residuals(theta[None])[0] ** 2)), _deviance_unit(uncertainty, i)

    def point(start: Array, value: float) -> tuple[float, Array]:
        others, square = _fit_others(problem, residuals, start, i, value)
        return (square - cost) / unit, others

    reach = REACH * float(uncertainty.standard_deviation[i])
    sides: list[list[tuple[float, Array]]] = []
    for bound in (problem.parameters.lower[i], problem.parameters.upper[i]):
        room = float(bound - theta[i])
        step = float(np.sign(room)) * min(abs(room), reach) / STEPS_PER_REACH
        sides.append(_walk(point, theta, i, float(bound), step))
    points = [*reversed(sides[0]), (0.0, theta), *sides[1]]
    deviance, values = np.array([d for d, _ in points]), np.array([t[i] for _, t in points])
    centre = len(sides[0])
    interval = (
        _crossing(values[centre::-1], deviance[centre::-1], -np.inf),
        _crossing(values[centre:], deviance[centre:], np.inf),
    )
    within = np.array([t for d, t in points if d <= THRESHOLD])
    bounded = tuple(
        parameter.name
        for j, parameter in enumerate(problem.parameters.parameters)
        if j != i and uncertainty.free[j] and any(at.any() for _, at in at_bounds(parameter, within[:, j]))
    )
    return Profile(name, values, deviance, interval, points[int(np.argmin(deviance))][1], bounded)


def better_optimum(problem: Problem, uncertainty: Uncertainty, profiles: Sequence[Profile]) -> Array | None:
    """Return the best of all parameters that profiles reached, shape (P,); None: the estimate."""
    lowest = [p.lowest for p in profiles if p.better_optimum]
    if not lowest:
        return None
    cost = np.sum(_with_priors(problem, uncertainty)(np.array(lowest)) ** 2, axis=1)
    return lowest[int(np.argmin(cost))]


def _walk(
    point: Callable[[Array, float], tuple[float, Array]], theta: Array, i: int, bound: float, step: float
) -> list[tuple[float, Array]]:
    """Deviances and refitted parameters at values ever further from the estimate.

    The walk ends beyond THRESHOLD or at the bound. Where fewer than three steps lead there, shorter ones are
    taken.
    """
    points: list[tuple[float, Array]] = []
    for _ in range(ZOOMS if step else 0):
        points, value, length = [], float(theta[i]), step
        while value != bound and len(points) < MAX_POINTS and not (points and points[-1][0] > THRESHOLD):
            length *= 1.5 if len(points) >= STEPS_PER_REACH else 1.0
            value += length
            if abs(bound - value) < 1e-6 * abs(length) or (value - bound) * step > 0:
                value = bound
            points.append(point(points[-1][1] if points else theta, value))
        if len(points) > 2 or points[-1][0] <= THRESHOLD:
            break
        step = (float(points[-1][1][i]) - float(theta[i])) / STEPS_PER_REACH
    return points


def _with_priors(problem: Problem, uncertainty: Uncertainty) -> Residuals:
    weight, problem = uncertainty.jacobian.prior_weight, with_open_start(problem, uncertainty.theta)
    return lambda theta: np.hstack([problem.residuals(theta), weight * problem.priors.scores(theta)])


def _fit_others(
    problem: Problem, residuals: Residuals, start: Array, i: int, value: float
) -> tuple[Array, float]:
    """Fit all but parameter i, held at a value; return the result, shape (P,), and its sum of squares."""
    parameters, column = problem.parameters, int(np.sum(problem.parameters.free[:i]))

    def full(unit: Array) -> Array:
        theta = parameters.from_unit(np.insert(unit, column, 0.5, axis=1))
        theta[:, i] = value
        return theta

    unit = np.delete(parameters.to_unit(start[None])[0], column)
    if not unit.size:
        theta = full(np.empty((1, 0)))
        return theta[0], float(np.sum(residuals(theta)[0] ** 2))
    result = least_squares(unit, lambda points: residuals(full(points)), QUICK)
    return full(result.point[None])[0], 2 * result.cost


def _deviance_unit(uncertainty: Uncertainty, i: int) -> float:
    """Rise of the sum of squares that is one unit of deviance of parameter i: its variance over (J J')^-1."""
    free = uncertainty.free
    bread = np.sum(linearise(free, uncertainty.jacobian).changes ** 2, axis=1)
    relative = uncertainty.relative[free]
    known, column = np.isfinite(relative), int(np.sum(free[:i]))
    if known[column]:
        return float(relative[column] ** 2 / bread[column])
    if known.any():
        return float(np.max(relative[known] ** 2 / bread[known]))
    return float(np.mean([noise.level**2 for noise in uncertainty.noise]))


def _crossing(values: Array, deviance: Array, unlimited: float) -> float:
    """Where the deviance rises above THRESHOLD, its root interpolated; `unlimited` where it does not."""
    above = np.flatnonzero(deviance > THRESHOLD)
    if not len(above):
        return unlimited
    b = int(above[0])
    root = np.sqrt(np.maximum(deviance[b - 1 : b + 1], 0.0))
    part = (np.sqrt(THRESHOLD) - root[0]) / (root[1] - root[0])
    return float(values[b - 1] + part * (values[b] - values[b - 1]))
