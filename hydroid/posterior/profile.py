"""Intervals without the linear approximation: profile likelihood."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from hydroid.errors import SettingsError
from hydroid.parameters import Array, ParameterSet
from hydroid.posterior.covariance import Uncertainty, at_bounds
from hydroid.posterior.open_start import with_open_start
from hydroid.posterior.posterior import COVERAGE
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
        bounded: other parameters that lie at a bound somewhere within the interval.
        gain: by which the sum of squares there is below the estimate's.
    """

    name: str
    values: Array
    deviance: Array
    interval: tuple[float, float]
    lowest: Array
    bounded: tuple[str, ...] = ()
    gain: float = 0.0

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
    parameters, theta = problem.parameters, uncertainty.theta
    known = {p.name: i for i, p in enumerate(parameters.parameters) if p.fixed is None}
    if name not in known:
        raise SettingsError(f"no free parameter {name!r} to profile", hint=f"free: {', '.join(known)}")
    i = known[name]
    opened, weight = with_open_start(problem, theta), uncertainty.jacobian.prior_weight

    def residuals(theta: Array) -> Array:
        return np.hstack([opened.residuals(theta), weight * problem.priors.scores(theta)])

    cost, unit = float(np.sum(residuals(theta[None])[0] ** 2)), _deviance_unit(uncertainty, i)

    def point(start: Array, value: float) -> tuple[float, Array]:
        best, square = _fit_others(parameters, residuals, start, i, value)
        return (square - cost) / unit, best

    deviation = float(uncertainty.standard_deviation[i])
    reach = np.inf if np.isnan(deviation) else 3.0 * deviation  # NaN: it lies at a bound
    sides = [_side(point, theta, i, float(ends[i]), reach) for ends in (parameters.lower, parameters.upper)]
    points = [*reversed(sides[0]), (0.0, theta), *sides[1]]
    deviance, rows = np.array([d for d, _ in points]), np.array([t for _, t in points])
    centre, values = len(sides[0]), rows[:, i]
    left = _crossing(values[centre::-1], deviance[centre::-1], -np.inf)
    interval = left, _crossing(values[centre:], deviance[centre:], np.inf)
    within, best = rows[deviance <= THRESHOLD], int(np.argmin(deviance))
    bounded = tuple(
        other
        for other, j in known.items()
        if j != i and any(at.any() for _, at in at_bounds(parameters.parameters[j], within[:, j]))
    )
    return Profile(name, values, deviance, interval, rows[best], bounded, -unit * float(deviance[best]))


def better_optimum(profiles: Sequence[Profile]) -> Array | None:
    """Return the best of all parameters that profiles reached, shape (P,); None: the estimate."""
    better = [one for one in profiles if one.better_optimum]
    return max(better, key=lambda one: one.gain).lowest if better else None


def _side(
    point: Callable[[Array, float], tuple[float, Array]], theta: Array, i: int, bound: float, reach: float
) -> Points:
    """Deviances and refitted parameters at values ever further from the estimate.

    The walk ends beyond THRESHOLD or at the bound, or after twelve points. Where fewer than three steps lead
    beyond THRESHOLD, they are taken again six times as fine.
    """
    points: Points = []
    end, room = float(np.clip(bound, theta[i] - reach, theta[i] + reach)), bound - float(theta[i])
    for _ in range(4 if room else 0):
        points, value, length = [], float(theta[i]), (end - float(theta[i])) / STEPS
        while value != bound and len(points) < 2 * STEPS and not (points and points[-1][0] > THRESHOLD):
            length *= 1.5 if len(points) >= STEPS else 1.0
            value += length
            if abs(bound - value) < 1e-6 * abs(length) or (value - bound) * length > 0:
                value = bound
            points.append(point(points[-1][1] if points else theta, value))
        if len(points) > 2 or points[-1][0] <= THRESHOLD:
            break
        end = float(points[-1][1][i])
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


def _deviance_unit(uncertainty: Uncertainty, i: int) -> float:
    """Rise of the sum of squares that is one unit of deviance of parameter i: its variance over (J J')^-1.

    Of one that is held at a bound, the largest of the others'.
    """
    varied = uncertainty.posterior.box.varied
    units = uncertainty.posterior.deviations**2 / np.sum(uncertainty.linear.changes**2, axis=1)
    return float(units[int(np.sum(varied[:i]))] if varied[i] else units.max())


def _crossing(values: Array, deviance: Array, unlimited: float) -> float:
    """Where the deviance rises above THRESHOLD, its root interpolated; `unlimited` where it does not."""
    above = np.flatnonzero(deviance > THRESHOLD)
    if not len(above):
        return unlimited
    b = int(above[0])
    root = np.sqrt(np.maximum(deviance[b - 1 : b + 1], 0.0))
    return float(np.interp(np.sqrt(THRESHOLD), root, values[b - 1 : b + 1]))
