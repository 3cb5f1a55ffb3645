"""Which directions an estimate leaves open, and intervals without the linear
approximation."""

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy.stats import chi2

from hydroid.arrays import Array, record
from hydroid.errors import SettingsError
from hydroid.parameters import ParameterSet
from hydroid.posterior.posterior import COVERAGE
from hydroid.posterior.uncertainty import WEAK_ABOVE, Uncertainty
from hydroid.problem.problem import Problem
from hydroid.search.least_squares import least_squares
from hydroid.settings.search import RefinementSettings

# deviance beyond which a value lies outside the interval
THRESHOLD = float(chi2.ppf(COVERAGE, 1))
# points on each side before the steps grow: they reach three standard deviations, or
# the bound
STEPS = 6


@record
class Profile:
    """What a profile shows: where the deviance is below THRESHOLD, infinite where it
    never exceeds it.

    `lowest` is the least deviance of all points; clearly below 0 the estimate is no
    optimum. `points` are values and their deviances, from the lowest value up, shape
    (n, 2).
    """

    interval: tuple[float, float]
    lowest: float
    points: Array

    @property
    def better_optimum(self) -> bool:
        """Whether a point fits better than the estimate, by more than rounding."""
        return self.lowest < -0.1


def profile(problem: Problem, uncertainty: Uncertainty, name: str) -> Profile:
    """Hold a parameter at several values and fit the others, each time from the
    neighbour's result.

    The rise of the sum of squares is the deviance. Stage 1 minimises output errors,
    whose sum of squares is no likelihood: it is scaled so that its curvature is the
    estimate's variance (L. Pace, A. Salvan, N. Sartori, 2011).
    """
    parameters = problem.parameters
    free = parameters.named(parameters.free)
    if name not in free:
        raise SettingsError(
            f"no free parameter {name!r} to profile", hint=f"free: {', '.join(free)}"
        )
    i = parameters.names.index(name)
    held = _Held(
        parameters=parameters,
        index=i,
        residuals=uncertainty.likelihood.rows,
        estimate=uncertainty.theta,
        unit=_deviance_unit(uncertainty, i),
    )
    reach = 3.0 * uncertainty.standard_deviation[i]
    if np.isnan(reach):  # it lies at a bound
        reach = np.inf
    low, below = _one_side(held, parameters.lower[i], reach)
    high, above = _one_side(held, parameters.upper[i], reach)
    points = [(float(uncertainty.theta[i]), 0.0), *below, *above]
    lowest = min(deviance for _, deviance in points)
    # without a crossing within the bounds that side has no limit
    if low is None:
        low = -np.inf
    if high is None:
        high = np.inf
    return Profile((low, high), lowest, np.array(sorted(points)))


def _deviance_unit(uncertainty: Uncertainty, i: int) -> float:
    """Return the rise of the sum of squares that is a deviance of 1 of a parameter.

    It is the parameter's variance over (J J')^-1.
    """
    linear = uncertainty.linear
    variance = uncertainty.posterior.deviations**2
    units = linear.spread(variance / np.sum(linear.changes**2, axis=1))
    # one held at a bound has no variance: the others' largest
    if linear.box.varied[i]:
        return units[i]
    return np.nanmax(units)


@record
class _Held:
    """A parameter that is held at values while the others are fitted.

    Attributes:
        index: of the parameter.
        residuals: of candidates, (n, P) -> (n, R).
        estimate: of all parameters, shape (P,).
        unit: rise of the sum of squares that is a deviance of 1.
    """

    parameters: ParameterSet
    index: int
    residuals: Callable[[Array], Array]
    estimate: Array
    unit: float

    @cached_property
    def cost(self) -> float:
        """Sum of squares at the estimate."""
        return self._square(self.estimate)

    def at(self, value: float, start: Array) -> tuple[Array, float]:
        """Fit all but the held one from a start, shape (P,); return the result and its
        deviance."""
        parameters = list(self.parameters.parameters)
        parameters[self.index] = replace(parameters[self.index], fixed=value)
        others = ParameterSet(tuple(parameters))
        if not others.free.any():
            theta = start.copy()
            theta[self.index] = value
            return theta, (self._square(theta) - self.cost) / self.unit
        ended = least_squares(
            others.to_unit(start),
            lambda unit: self.residuals(others.from_unit(unit)),
            RefinementSettings(iterations=50, gain_tolerance=1e-6),
        )
        deviance = (2 * ended.cost - self.cost) / self.unit
        return others.from_unit(ended.point), deviance

    def _square(self, theta: Array) -> float:
        return np.sum(self.residuals(theta[None])[0] ** 2)


def _one_side(
    held: _Held, bound: float, reach: float
) -> tuple[float | None, list[tuple[float, float]]]:
    """Go from the estimate towards a bound, in steps by which `reach` is reached; until
    beyond THRESHOLD, at the bound, or after twelve points.

    Returns the value where the deviance passes THRESHOLD, None where it does not, and
    the points, values with their deviances.
    """
    value = held.estimate[held.index]
    length = (np.clip(bound, value - reach, value + reach) - value) / STEPS
    points = list[tuple[float, float]]()
    theta = held.estimate
    near = 0.0
    if not length:
        return None, points
    for number in range(2 * STEPS):
        before = value
        # in vain so far: further, faster
        if number >= STEPS:
            length *= 1.5
        beyond = (bound - value - length) / length
        value = bound if beyond < 1e-6 else value + length
        theta, deviance = held.at(value, theta)
        points.append((float(value), float(deviance)))
        if deviance > THRESHOLD:  # the root is about linear
            roots = np.sqrt(np.maximum([near, deviance], 0.0))
            return np.interp(np.sqrt(THRESHOLD), roots, [before, value]), points
        if value == bound:
            break
        near = deviance
    return None, points


@record
class Identifiability:
    """The directions that are determined, and those that are not.

    Attributes:
        alone: parameters that are not determined to WEAK_ABOVE, whatever the others
            are.
        combinations: of the other parameters that are not determined either, the least
            determined first: the relative changes, the largest +1, of those that take a
            tenth of it or more.
        rank: number of independent combinations that are determined.
    """

    alone: tuple[str, ...]
    combinations: tuple[dict[str, float], ...]
    rank: int


def identifiability(problem: Problem, uncertainty: Uncertainty) -> Identifiability:
    """Return the directions that are not determined at an estimate."""
    root = uncertainty.posterior.root
    names = np.array(problem.parameters.names)[uncertainty.linear.box.varied]
    alone = np.linalg.norm(root, axis=0) < 1 / WEAK_ABOVE
    _, values, axes = np.linalg.svd(root[:, ~alone], full_matrices=False)
    combinations: list[dict[str, float]] = []
    for axis in axes[values < 1 / WEAK_ABOVE][::-1]:
        changes = axis / axis[np.argmax(np.abs(axis))]
        largest_first = np.argsort(-np.abs(changes), kind="stable")
        some = largest_first[np.abs(changes[largest_first]) >= 0.1]
        pairs = zip(names[~alone][some].tolist(), changes[some].tolist(), strict=True)
        combinations.append(dict(pairs))
    rank = int(np.sum(~alone)) - len(combinations)
    return Identifiability(tuple(names[alone].tolist()), tuple(combinations), rank)
