"""Intervals without the linear approximation: profile likelihood."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from hydroid.errors import SettingsError
from hydroid.parameters import Array, ParameterSet
from hydroid.posterior.open_start import with_open_start
from hydroid.posterior.posterior import COVERAGE
from hydroid.posterior.uncertainty import Uncertainty
from hydroid.problem.problem import Problem
from hydroid.search.least_squares import least_squares
from hydroid.settings.search import RefinementSettings

THRESHOLD = float(chi2.ppf(COVERAGE, 1))
"""deviance beyond which a value lies outside the interval"""
STEPS = 6
"""points on each side before the steps grow: they reach three standard deviations, or the bound"""
Points = list[tuple[float, Array]]
"""deviances, and all parameters there, shape (P,)"""


@dataclass(frozen=True, eq=False)
class Profile:
    """Deviance of a parameter held at several values, the others fitted again.

    Attributes:
        name: of the parameter.
        values: it was held at, increasing, the estimate among them, shape (n,); they end beyond the interval.
        deviance: rise of the cost in units of the noise, (n,): about ((value - estimate) / sd)² near it.
        interval: where the deviance is below THRESHOLD; infinite on a side where it never exceeds it.
        lowest: all parameters at the point of the lowest deviance, shape (P,).
    """

    name: str
    values: Array
    deviance: Array
    interval: tuple[float, float]
    lowest: Array

    @property
    def better_optimum(self) -> bool:
        """Whether a point fits better than the estimate, which then is no optimum, by more than rounding."""
        return bool(self.deviance.min() < -0.1)


def profile(problem: Problem, uncertainty: Uncertainty, name: str) -> Profile:
    """Hold a parameter at several values and fit the others, each time from the neighbour's result.

    With autocorrelated noise the rise of a sum of squares is no likelihood ratio. It is scaled so that its
    curvature is the estimate's variance (L. Pace, A. Salvan, N. Sartori, 2011).

    Raises:
        SettingsError: no free parameter of that name.
    """
    parameters, linear, theta = problem.parameters, uncertainty.linear, uncertainty.theta
    free = [p.name for p in parameters.parameters if p.fixed is None]
    if name not in free:
        raise SettingsError(f"no free parameter {name!r} to profile", hint=f"free: {', '.join(free)}")
    i, opened = parameters.names.index(name), with_open_start(problem, theta)

    def residuals(theta: Array) -> Array:
        return np.hstack([opened.residuals(theta), linear.prior_weight * problem.priors.scores(theta)])

    cost = float(np.sum(residuals(theta[None])[0] ** 2))
    # what a deviance of 1 is: the parameter's variance over (J J')^-1; held at a bound, the others' largest
    units = linear.spread(uncertainty.posterior.deviations**2 / np.sum(linear.changes**2, axis=1))
    unit = units[i] if linear.box.varied[i] else np.nanmax(units)

    def point(start: Array, value: float) -> tuple[float, Array]:
        best, square = _fit_others(parameters, residuals, start, i, value)
        return (square - cost) / unit, best

    deviation = float(uncertainty.standard_deviation[i])
    reach = np.inf if np.isnan(deviation) else 3.0 * deviation  # NaN: it lies at a bound
    below, above = (
        _side(point, theta, i, float(ends[i]), reach) for ends in (parameters.lower, parameters.upper)
    )
    points = [*reversed(below), (0.0, theta), *above]
    deviance, rows = np.array([d for d, _ in points]), np.array([t for _, t in points])
    centre, values = len(below), rows[:, i]
    left = _crossing(values[centre::-1], deviance[centre::-1], -np.inf)
    interval = left, _crossing(values[centre:], deviance[centre:], np.inf)
    return Profile(name, values, deviance, interval, rows[int(np.argmin(deviance))])


def _side(
    point: Callable[[Array, float], tuple[float, Array]], theta: Array, i: int, bound: float, reach: float
) -> Points:
    """Deviances and refitted parameters at values ever further from the estimate.

    The walk ends beyond THRESHOLD or at the bound, or after twelve points.
    """
    points, value = list[tuple[float, Array]](), float(theta[i])
    length = (float(np.clip(bound, value - reach, value + reach)) - value) / STEPS
    while value != bound and len(points) < 2 * STEPS and not (points and points[-1][0] > THRESHOLD):
        length *= 1.5 if len(points) >= STEPS else 1.0
        value += length
        if abs(bound - value) < 1e-6 * abs(length) or (value - bound) * length > 0:
            value = bound
        points.append(point(points[-1][1] if points else theta, value))
    return points


def _fit_others(
    parameters: ParameterSet, residuals: Callable[[Array], Array], start: Array, i: int, value: float
) -> tuple[Array, float]:
    """Fit all but parameter i, held at a value; return the result, shape (P,), and its sum of squares."""
    held = [replace(p, fixed=value) if j == i else p for j, p in enumerate(parameters.parameters)]
    others, theta = ParameterSet(tuple(held)), start.copy()
    theta[i] = value
    if others.free.any():
        unit, how = others.to_unit(start[None])[0], RefinementSettings(iterations=50, gain_tolerance=1e-6)
        ended = least_squares(unit, lambda points: residuals(others.from_unit(points)), how)
        return others.from_unit(ended.point[None])[0], 2 * ended.cost
    return theta, float(np.sum(residuals(theta[None])[0] ** 2))


def _crossing(values: Array, deviance: Array, unlimited: float) -> float:
    """Where the deviance rises above THRESHOLD, its root interpolated; `unlimited` where it does not."""
    above = np.flatnonzero(deviance > THRESHOLD)
    if not len(above):
        return unlimited
    b = int(above[0])
    root = np.sqrt(np.maximum(deviance[b - 1 : b + 1], 0.0))
    return float(np.interp(np.sqrt(THRESHOLD), root, values[b - 1 : b + 1]))
