"""What each parameter does to each output against time (article 3.1 and figure 10)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.uncertainty.jacobian import jacobian

COUNT = 20
"""values of each parameter within its bounds, as in the article"""


@dataclass(frozen=True, eq=False)
class Sweep:
    """Local and global sensitivity of all channels.

    free: indices of the F free parameters, shape (F,). slopes: change of each channel per 1 % of each of
    them [rad or Pa], one array (F, T) a channel; NaN where the changed set diverges. values: of each within
    its bounds, shape (F, COUNT). responses: each channel at these [rad or Pa], (F, COUNT, T) a channel.
    """

    free: NDArray[np.intp]
    slopes: tuple[Array, ...]
    values: Array
    responses: tuple[Array, ...]


def sweep(problem: Problem, theta: Array, tell: Callable[[str, int, int], None]) -> Sweep:
    """Return how the channels depend on each free parameter around theta, shape (P,), and over its bounds.

    Slopes are those of `jacobian`; 1 % of a value near 0 is 1 % of its scale.
    """
    parameters = problem.parameters
    free = np.flatnonzero(parameters.free)
    slopes = -0.01 * jacobian(problem, theta).slopes[free]
    values = np.linspace(parameters.lower[free], parameters.upper[free], COUNT, axis=1)
    count = len(free)
    responses = tuple(np.empty((count, COUNT, len(c.measured))) for c in problem.channels)
    for i, column in enumerate(free):
        points = np.tile(theta, (COUNT, 1))
        points[:, column] = values[i]
        rows = problem.residuals(points)
        for channel, response in zip(problem.channels, responses, strict=True):
            response[i] = channel.measured - rows[:, channel.rows] / channel.weight
        tell("values of parameters", COUNT * (i + 1), COUNT * count)
    changes = tuple(slopes[:, channel.rows] / channel.weight for channel in problem.channels)
    return Sweep(free, changes, values, responses)
