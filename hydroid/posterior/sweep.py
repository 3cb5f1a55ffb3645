"""Sensitivity: how the outputs change with each parameter, near the estimate and over its bounds."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydroid.parameters import Array
from hydroid.posterior.linear import linearised
from hydroid.problem.problem import Problem
from hydroid.progress import Progress, no_progress


@dataclass(frozen=True, eq=False)
class Sweep:
    """Local and global sensitivity of all channels (article 3.1 and figure 10).

    Attributes:
        free: indices of the F free parameters, shape (F,).
        slopes: change of each channel per 1 % of each free parameter [rad or Pa], one array (F, T) per
            channel; 0 where the simulation diverges.
        values: of each free parameter, 20 within its bounds as in the article, shape (F, 20).
        responses: each channel at these [rad or Pa], one array (F, 20, T) per channel.
    """

    free: NDArray[np.intp]
    slopes: tuple[Array, ...]
    values: Array
    responses: tuple[Array, ...]


def sweep(problem: Problem, theta: Array, progress: Progress = no_progress) -> Sweep:
    """Return how the channels change with each free parameter, near theta, shape (P,), and over its bounds.

    1 % of a value near 0 is 1 % of its scale.
    """
    parameters, channels = problem.parameters, problem.channels
    free = np.flatnonzero(parameters.free)
    slopes = -0.01 * linearised(problem, theta).slopes
    values = np.array([parameters.parameters[i].at(np.linspace(0, 1, 20)) for i in free])
    rows: list[Array] = []
    for column, swept in zip(free, values, strict=True):
        points = np.tile(theta, (len(swept), 1))
        points[:, column] = swept
        rows.append(problem.residuals(points))
        progress("values of parameters", len(rows) * len(swept), values.size)
    residuals = np.array(rows)
    return Sweep(
        free,
        tuple(slopes[:, c.rows] / c.weight for c in channels),
        values,
        tuple(c.measured - residuals[:, :, c.rows] / c.weight for c in channels),
    )
