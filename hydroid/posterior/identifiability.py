"""Which directions an estimate leaves open, and intervals without the linear
approximation."""

from dataclasses import replace

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
    parameters, linear, theta = (
        problem.parameters,
        uncertainty.linear,
        uncertainty.theta,
    )
    free = parameters.named(parameters.free)
    if name not in free:
        raise SettingsError(
            f"no free parameter {name!r} to profile", hint=f"free: {', '.join(free)}"
        )
    i, residuals = parameters.names.index(name), uncertainty.likelihood.rows
    cost = np.sum(residuals(theta[None])[0] ** 2)
    # what a deviance of 1 is: the parameter's variance over (J J')^-1; held at a bound,
    # the others' largest
    units = linear.spread(
        uncertainty.posterior.deviations**2 / np.sum(linear.changes**2, axis=1)
    )
    unit = units[i] if linear.box.varied[i] else np.nanmax(units)

    def fit_others(start: Array, value: float) -> tuple[Array, float]:
        """Fit all but the one, held at a value; return the result, shape (P,), and its
        sum of squares."""
        held = [
            replace(p, fixed=value) if j == i else p
            for j, p in enumerate(parameters.parameters)
        ]
        others, theta = (
            ParameterSet(tuple(held)),
            np.where(np.arange(len(held)) == i, value, start),
        )
        if not others.free.any():
            return theta, np.sum(residuals(theta[None])[0] ** 2)
        how = RefinementSettings(iterations=50, gain_tolerance=1e-6)
        ended = least_squares(
            others.to_unit(start), lambda unit: residuals(others.from_unit(unit)), how
        )
        return others.from_unit(ended.point), 2 * ended.cost

    reach = 3.0 * uncertainty.standard_deviation[i]
    reach = np.inf if np.isnan(reach) else reach  # it lies at a bound
    ends = list[float]()
    points = [(float(theta[i]), 0.0)]
    for bound, end in ((parameters.lower[i], -np.inf), (parameters.upper[i], np.inf)):
        # from the estimate outwards, until beyond THRESHOLD or at the bound, or after
        # twelve points
        near, start, value, crossing = 0.0, theta, theta[i], end
        length = (np.clip(bound, value - reach, value + reach) - value) / STEPS
        for number in range(2 * STEPS if length else 0):
            before, length = value, length * (1.5 if number >= STEPS else 1.0)
            value = (
                bound if (bound - value - length) / length < 1e-6 else value + length
            )
            start, square = fit_others(start, value)
            deviance = (square - cost) / unit
            points.append((float(value), float(deviance)))
            if deviance > THRESHOLD:  # the root is about linear
                roots = np.sqrt(np.maximum([near, deviance], 0.0))
                crossing = np.interp(np.sqrt(THRESHOLD), roots, [before, value])
            if deviance > THRESHOLD or value == bound:
                break
            near = deviance
        ends.append(crossing)
    lowest = min(deviance for _, deviance in points)
    return Profile((ends[0], ends[1]), lowest, np.array(sorted(points)))


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
        order = [
            i
            for i in np.argsort(-np.abs(changes), kind="stable")
            if abs(changes[i]) >= 0.1
        ]
        combinations.append({str(names[~alone][i]): float(changes[i]) for i in order})
    rank = int(np.sum(~alone)) - len(combinations)
    return Identifiability(tuple(names[alone].tolist()), tuple(combinations), rank)
