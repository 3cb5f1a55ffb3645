"""The polish of an estimate: least squares over all channels, with what is known as further measurements."""

from collections.abc import Callable

import numpy as np

from hydroid.identification.problem import Problem
from hydroid.parameters import Array
from hydroid.search.least_squares import Polish, polish
from hydroid.settings.search import PolishSettings

ROUNDS = 4
"""times at most that the noise is estimated, to weigh the logs against what is known"""
SETTLED = 0.02
"""relative change of the noise below which another round would change nothing"""


def polish_estimate(
    problem: Problem, theta: Array, settings: PolishSettings, watch: Callable[[int], None]
) -> Polish:
    """Improve an estimate by bounded least squares.

    Statements of `problem.knowledge` join as residuals of (value - known) / sd times the rms residual of the
    logs. That noise is taken at the start, and again at the result, until it settles.

    Args:
        problem: the problem.
        theta: where to start, shape (P,).
        settings: when to end.
        watch: is told how many simulations were made so far.

    Returns:
        Its point is one of the unit box of the free parameters.
    """
    simulated, parameters, knowledge = 0, problem.parameters, problem.knowledge
    noise = _noise(problem, theta) if len(knowledge) else 0.0

    def residuals(unit: Array) -> Array:
        nonlocal simulated
        simulated += len(unit)
        watch(simulated)
        points = parameters.from_unit(unit)
        rows = problem.residuals(points)
        return np.column_stack([rows, noise * knowledge.scores(points)]) if len(knowledge) else rows

    result = polish(parameters.to_unit(theta[None])[0], residuals, settings)
    for _ in range(ROUNDS - 1 if len(knowledge) else 0):
        before, noise = noise, _noise(problem, parameters.from_unit(result.point[None])[0])
        if not abs(noise - before) > SETTLED * before:
            break
        result = polish(result.point, residuals, settings)
    return result


def _noise(problem: Problem, theta: Array) -> float:
    """Rms residual of the logs [rad]."""
    return float(np.sqrt(np.mean(problem.residuals(theta[None]) ** 2)))
