"""What holds at the true parameters without a fit: each parameter's effect, and minima of the error."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.uncertainty.jacobian import jacobian
from hydroid.uncertainty.sweep import Surface, surface


def ranking(problem: Problem, theta: Array, order: Sequence[str]) -> str:
    """Say whether the effects of some parameters fall in a stated order, the strongest first."""
    effects = dict(zip(problem.parameters.names, np.degrees(jacobian(problem, theta).effects), strict=True))
    found = sorted(order, key=lambda name: -effects[name])
    outcome = "confirmed" if found == list(order) else "contradicted"
    sizes = ", ".join(f"{name} {effects[name]:.2g}" for name in found)
    said = ", ".join(order)
    return f"The effect on the output falls in the order {said}: {outcome} (deg rms per 1 %: {sizes})."


def minima(found: Surface) -> str:
    """Say whether a surface has several minima."""
    count = local_minima(found.error)
    outcome = "confirmed" if count > 1 else "not confirmed"
    names, shape = " and ".join(p.name for p in found.parameters), " by ".join(map(str, found.error.shape))
    return f"The error over {names} has several minima: {outcome} ({count} on a grid of {shape} points)."


def local_minima(error: Array) -> int:
    """Return how many points of a grid, shape (n, m), lie below all of their up to eight neighbours."""
    known = np.where(np.isfinite(error), error, np.inf)
    padded = np.pad(known, 1, constant_values=np.inf)
    n, m = error.shape
    around = [padded[i : i + n, j : j + m] for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    return int(np.sum(known < np.min(around, axis=0)))


def landscape(problem: Problem, theta: Array, names: tuple[str, ...], points: int) -> Surface:
    """Return the error over two parameters within their bounds, all others at theta, shape (P,)."""
    return _landscape(problem, tuple(theta.tolist()), names, points)


@lru_cache(maxsize=4)  # it is drawn and put into words
def _landscape(problem: Problem, theta: tuple[float, ...], names: tuple[str, ...], points: int) -> Surface:
    first, second = names
    return surface(problem, np.array(theta), (first, second), points, None)
