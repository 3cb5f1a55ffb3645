"""Sensitivity of each output to each parameter against time (article 3.1 and figure 10)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.progress import Progress, no_progress
from hydroid.uncertainty.jacobian import jacobian

SWEEP_POINTS = 20
"""values of each parameter within its bounds, as in the article"""


@dataclass(frozen=True, eq=False)
class Sweep:
    """Local and global sensitivity of all channels.

    Attributes:
        free: indices of the F free parameters, shape (F,).
        slopes: change of each channel per 1 % of each free parameter [rad or Pa], one array (F, T) per
            channel; NaN where the simulation diverges.
        values: of each free parameter within its bounds, shape (F, SWEEP_POINTS).
        responses: each channel at these [rad or Pa], one array (F, SWEEP_POINTS, T) per channel.
    """

    free: NDArray[np.intp]
    slopes: tuple[Array, ...]
    values: Array
    responses: tuple[Array, ...]


def sweep(problem: Problem, theta: Array, progress: Progress = no_progress) -> Sweep:
    """Return how the channels change with each free parameter, near theta, shape (P,), and over its bounds.

    Slopes are those of `jacobian`; 1 % of a value near 0 is 1 % of its scale.
    """
    parameters = problem.parameters
    free = np.flatnonzero(parameters.free)
    slopes = -0.01 * jacobian(problem, theta).slopes[free]
    values = np.linspace(parameters.lower[free], parameters.upper[free], SWEEP_POINTS, axis=1)
    count = len(free)
    responses = tuple(np.empty((count, SWEEP_POINTS, len(c.measured))) for c in problem.channels)
    for i, column in enumerate(free):
        points = np.tile(theta, (SWEEP_POINTS, 1))
        points[:, column] = values[i]
        rows = problem.residuals(points)
        for channel, response in zip(problem.channels, responses, strict=True):
            response[i] = channel.measured - rows[:, channel.rows] / channel.weight
        progress("values of parameters", SWEEP_POINTS * (i + 1), SWEEP_POINTS * count)
    changes = tuple(slopes[:, channel.rows] / channel.weight for channel in problem.channels)
    return Sweep(free, changes, values, responses)
