"""The error over two parameters, all others held: the search's landscape (article, figure 11)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hydroid.errors import SettingsError
from hydroid.parameters import Array, Parameter
from hydroid.problem.problem import Problem

BATCH = 256
"""points evaluated together; in between, progress is told"""
WIDE = 20.0
"""bounds with a larger ratio are cut in equal ratios instead of equal steps"""


@dataclass(frozen=True, eq=False)
class Surface:
    """The objective over the whole record on a grid of two parameters.

    parameters: the two. values: of each on the grid, shapes (n,) and (m,). error: the settings' norm [rad, or
    relative], shape (n, m); inf where infeasible. estimate: the two parameters' values where the others are
    held, a point of the grid unless outside it. estimate_error: the error there.
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
        return (
            float(self.values[0][row]),
            float(self.values[1][column]),
            float(self.error[row, column]),
        )

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
    tell: Callable[[str, int, int], None],
) -> Surface:
    """Evaluate the error on a grid of two parameters.

    Args:
        problem: the problem.
        theta: the estimate at which all others are held, shape (P,).
        names: of the two parameters.
        points: of the grid, each way.
        around: relative distance from the estimate to the grid's ends, 0.2 for ±20 %; None: the bounds.
        tell: is told how many points are done.

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
    values = axis(chosen[0], theta[first], points, around), axis(chosen[1], theta[second], points, around)
    shape = len(values[0]), len(values[1])
    grid = np.tile(theta, (shape[0] * shape[1] + 1, 1))
    grid[:-1, first], grid[:-1, second] = (a.ravel() for a in np.meshgrid(*values, indexing="ij"))
    error = np.empty(len(grid))
    for start in range(0, len(grid), BATCH):
        error[start : start + BATCH] = problem.evaluate(grid[start : start + BATCH]).overall
        tell(f"{names[0]}, {names[1]}: points", min(start + BATCH, len(grid)), len(grid))
    estimate = float(theta[first]), float(theta[second])
    return Surface(chosen, values, error[:-1].reshape(shape), estimate, float(error[-1]))


def axis(parameter: Parameter, value: float, points: int, around: float | None) -> Array:
    """Values of one parameter on the grid: `points` in equal steps, or ratios over wide bounds, and the estimate.

    The estimate is added where it lies within the grid and is none of its points.

    Raises:
        SettingsError: neither bounds nor a distance that leads anywhere.
    """
    if around is None:
        low, high = parameter.lower, parameter.upper
        hint = "say how far around the estimate with --around"
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
