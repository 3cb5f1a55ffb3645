"""Simulations over ranges of parameters: outputs over one of them, the error over two of them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import SettingsError
from hydroid.parameters import Array, Parameter
from hydroid.posterior.jacobian import jacobian
from hydroid.problem.problem import Problem
from hydroid.progress import Progress, no_progress

WIDE = 20.0
"""ratio of the bounds above which a surface has equal ratios instead of equal steps"""


@dataclass(frozen=True, eq=False)
class Sweep:
    """Local and global sensitivity of all channels (article 3.1 and figure 10).

    Attributes:
        free: indices of the F free parameters, shape (F,).
        slopes: change of each channel per 1 % of each free parameter [rad or Pa], one array (F, T) per
            channel; NaN where the simulation diverges.
        values: of each free parameter, 20 within its bounds as in the article, shape (F, 20).
        responses: each channel at these [rad or Pa], one array (F, 20, T) per channel.
    """

    free: NDArray[np.intp]
    slopes: tuple[Array, ...]
    values: Array
    responses: tuple[Array, ...]


def sweep(problem: Problem, theta: Array, progress: Progress = no_progress) -> Sweep:
    """Return how the channels change with each free parameter, near theta, shape (P,), and over its bounds.

    Slopes are those of `jacobian`; 1 % of a value near 0 is 1 % of its scale.
    """
    parameters, channels = problem.parameters, problem.channels
    free = np.flatnonzero(parameters.free)
    slopes = -0.01 * jacobian(problem, theta).slopes[free]
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
    at = [known.index(name) for name in names]
    first, second = (problem.parameters.parameters[i] for i in at)
    values = _axis(first, theta[at[0]], points, around), _axis(second, theta[at[1]], points, around)
    pairs = np.stack(np.meshgrid(*values, indexing="ij"), axis=-1)
    grid = np.tile(theta, (pairs.size // 2 + 1, 1))  # the last row is the estimate
    grid[:-1, at] = pairs.reshape(-1, 2)
    error = np.empty(len(grid))
    for start in range(0, len(grid), 256):
        error[start : start + 256] = problem.evaluate(grid[start : start + 256]).overall
        progress(f"{names[0]}, {names[1]}: points", min(start + 256, len(grid)), len(grid))
    estimate = float(theta[at[0]]), float(theta[at[1]])
    return Surface((first, second), values, error[:-1].reshape(pairs.shape[:2]), estimate, float(error[-1]))


def _axis(parameter: Parameter, value: float, points: int, around: float | None) -> Array:
    """Values of one parameter on the grid, and the estimate where it lies within them and is none of them."""
    low, high, hint = parameter.lower, parameter.upper, "give a distance around the estimate with --around"
    if around is not None:
        low, high = sorted((value * (1 - around), value * (1 + around)))
        low, hint = max(low, 0.0), "leave --around out"  # no quantity may be negative
    if not low < high:
        what = f"{parameter.name} has no range from {low:g} to {high:g}"
        raise SettingsError(what, where="--over", hint=hint)
    wide = around is None and low > 0 and high > WIDE * low
    grid = np.geomspace(low, high, points) if wide else np.linspace(low, high, points)
    known = not low <= value <= high or np.isclose(grid, value, rtol=1e-12, atol=0.0).any()
    return grid if known else np.union1d(grid, value)
