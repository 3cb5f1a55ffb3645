"""Simulations over ranges of parameters: outputs over one of them, the error over two of them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import SettingsError
from hydroid.parameters import Array, Parameter
from hydroid.posterior.jacobian import jacobian
from hydroid.problem.problem import Problem
from hydroid.progress import Progress, no_progress

SWEEP_POINTS = 20
"""values of each parameter within its bounds, as in the article"""
BATCH = 256
"""points of a surface between two reports of progress"""
WIDE = 20.0
"""ratio of the bounds above which a surface has equal ratios instead of equal steps"""


@dataclass(frozen=True, eq=False)
class Sweep:
    """Local and global sensitivity of all channels (article 3.1 and figure 10).

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
    values = np.array([parameters.parameters[i].at(np.linspace(0, 1, SWEEP_POINTS)) for i in free])
    responses = tuple(np.empty((*values.shape, len(c.measured))) for c in problem.channels)
    for i, column in enumerate(free):
        points = np.tile(theta, (SWEEP_POINTS, 1))
        points[:, column] = values[i]
        rows = problem.residuals(points)
        for channel, response in zip(problem.channels, responses, strict=True):
            response[i] = channel.measured - rows[:, channel.rows] / channel.weight
        progress("values of parameters", SWEEP_POINTS * (i + 1), values.size)
    changes = tuple(slopes[:, channel.rows] / channel.weight for channel in problem.channels)
    return Sweep(free, changes, values, responses)


@dataclass(frozen=True, eq=False)
class Surface:
    """The overall objective on a grid of two parameters (article, figure 11).

    Attributes:
        parameters: the two.
        values: of each on the grid, shapes (n,) and (m,).
        error: the settings' norm [rad, or relative], shape (n, m); inf where infeasible.
        estimate: the two parameters' values at the estimate, a point of the grid where the grid reaches it.
        estimate_error: the error there.
    """

    parameters: tuple[Parameter, Parameter]
    values: tuple[Array, Array]
    error: Array
    estimate: tuple[float, float]
    estimate_error: float

    @property
    def lowest(self) -> tuple[float, float, float]:
        """The grid's point with the lowest error: both values, and the error."""
        row, column = np.unravel_index(int(np.argmin(self.error)), self.error.shape)
        return float(self.values[0][row]), float(self.values[1][column]), float(self.error[row, column])

    @property
    def infeasible(self) -> int:
        """Points whose simulation diverges or that no arm can have."""
        return int(np.sum(~np.isfinite(self.error)))


def surface(
    problem: Problem,
    theta: Array,
    names: tuple[str, str],
    points: int,
    around: float | None,
    progress: Progress = no_progress,
) -> Surface:
    """Evaluate the error over two parameters, the others held at theta, shape (P,).

    The grid has `points` values of each parameter: within a relative distance `around` of the estimate (0.2
    for ±20 %), or within its bounds (None).

    Raises:
        SettingsError: a parameter that does not exist, twice the same, or one without bounds.
    """
    known = problem.parameters.names
    for name in names:
        if name not in known:
            raise SettingsError(f"no parameter {name!r}", where="--over", hint=f"known: {', '.join(known)}")
    if names[0] == names[1]:
        raise SettingsError(f"{names[0]} stands there twice", where="--over", hint="name two parameters")
    first, second = (known.index(name) for name in names)
    chosen = problem.parameters.parameters[first], problem.parameters.parameters[second]
    values = _axis(chosen[0], theta[first], points, around), _axis(chosen[1], theta[second], points, around)
    shape = len(values[0]), len(values[1])
    grid = np.tile(theta, (shape[0] * shape[1] + 1, 1))  # the last row is the estimate
    grid[:-1, first], grid[:-1, second] = (a.ravel() for a in np.meshgrid(*values, indexing="ij"))
    error = np.empty(len(grid))
    for start in range(0, len(grid), BATCH):
        error[start : start + BATCH] = problem.evaluate(grid[start : start + BATCH]).overall
        progress(f"{names[0]}, {names[1]}: points", min(start + BATCH, len(grid)), len(grid))
    estimate = float(theta[first]), float(theta[second])
    return Surface(chosen, values, error[:-1].reshape(shape), estimate, float(error[-1]))


def _axis(parameter: Parameter, value: float, points: int, around: float | None) -> Array:
    """Values of one parameter on the grid, and the estimate where it lies within them and is none of them."""
    if around is None:
        low, high = parameter.lower, parameter.upper
        hint = "give a distance around the estimate with --around"
    else:
        low, high = sorted((value * (1 - around), value * (1 + around)))
        low = max(low, 0.0)  # no quantity may be negative
        hint = "leave --around out"
    if not low < high:
        raise SettingsError(
            f"{parameter.name} has no range from {low:g} to {high:g}", where="--over", hint=hint
        )
    wide = around is None and low > 0 and high > WIDE * low
    grid = np.geomspace(low, high, points) if wide else np.linspace(low, high, points)
    known = not low <= value <= high or np.isclose(grid, value, rtol=1e-12, atol=0.0).any()
    return grid if known else np.union1d(grid, value)
