"""How well the numbers of an error model are known: its degrees of freedom.

A standard deviation that comes from errors is uncertain itself, the more so the longer
they last and the shorter the logs are. Let log v be the logarithm of the variance that
a signal's errors bring into the parameters, g its derivatives by the logarithms of the
error's numbers, and C the covariance of these. Then Student's t with

    2 / (g' C g)      (F. E. Satterthwaite, 1946)

degrees of freedom takes the place of the normal distribution. C is the inverse of the
sum of outer products of the derivatives of each sample's log-density (E. K. Berndt, B.
H. Hall, R. E. Hall, J. A. Hausman, 1974).
"""

from dataclasses import replace

import numpy as np

from hydroid.arrays import Array
from hydroid.posterior.error_model import ErrorModel

STEP = 0.02
"""of the logarithms of the numbers in the differences"""
VAGUE = 3.0
"""standard deviation of the logarithm of a number that the errors say nothing of
(ours)"""
LEAST = 2.0
"""degrees of freedom at least: with fewer an interval says nothing (ours)"""


def degrees_of_freedom(
    shown: ErrorModel, fitted: ErrorModel, errors: Array, effects: Array, scatter: Array
) -> float:
    """Return the degrees of freedom of the signal whose errors are known least.

    Args:
        shown: the model of the errors, as they are.
        fitted: the model that weighs them.
        errors: weighted output errors, shape (R,), that gave `shown` its numbers.
        effects: orthonormal rows of what parameters do to innovations, shape (p, R) or
            with more columns.
        scatter: covariance of the effects, shape (p, p).
    """
    weights = np.asarray(np.linalg.inv(scatter), dtype=float)
    least = np.inf
    for i in range(len(shown.signals)):
        variance = _variance(shown, fitted, i, effects, weights)
        if variance == 0.0:
            continue
        slopes = list[float]()
        scores = list[Array]()
        for number in _estimated(shown, i):
            below = _changed(shown, i, number, -STEP)
            above = _changed(shown, i, number, STEP)
            change = _variance(above, fitted, i, effects, weights)
            change -= _variance(below, fitted, i, effects, weights)
            slopes.append(change / (2 * STEP * variance))
            score = _densities(above, i, errors) - _densities(below, i, errors)
            scores.append(score / (2 * STEP))
        if not slopes:
            continue
        rows = np.array(scores)
        information = rows @ rows.T + np.eye(len(rows)) / VAGUE**2
        slope = np.array(slopes)
        of_logarithm = float(slope @ np.linalg.solve(information, slope))
        if of_logarithm > 0.0:
            least = min(least, 2.0 / of_logarithm)
    return max(least, LEAST)


def _estimated(shown: ErrorModel, i: int) -> list[int]:
    """Return which numbers of signal i come from the errors."""
    there = shown.numbers[i] != 0.0
    if np.isfinite(shown.given[i]):
        there[0] = False
    if shown.numbers[i, 3] == 0.0:
        there[4] = False  # nothing lasts for this time
    return np.flatnonzero(there).tolist()


def _changed(shown: ErrorModel, i: int, number: int, step: float) -> ErrorModel:
    """Return the model with a step of the logarithm of a number of signal i."""
    numbers = shown.numbers.copy()
    numbers[i, number] *= np.exp(step)
    return replace(shown, numbers=numbers)


def _variance(
    shown: ErrorModel, fitted: ErrorModel, i: int, effects: Array, weights: Array
) -> float:
    """Return the weighted sum of the variances that signal i's errors bring into the
    effects."""
    total = 0.0
    for number, course in enumerate(shown.courses):
        if shown.of[number] == i:
            scatter = shown.scatter(number, effects[:, course.rows], fitted)
            total += float(np.sum(weights * scatter))
    return total


def _densities(shown: ErrorModel, i: int, errors: Array) -> Array:
    """Return the log-density of each sample of signal i, shape (T,)."""
    rows = [course.rows for course in shown.courses_of(i)]
    densities = shown.log_density(shown.innovations(errors[None])[0])
    return np.concatenate([densities[one] for one in rows])
