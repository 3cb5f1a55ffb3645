"""Derivatives along the axes of a covariance, with steps of its own width.

Where parameters trade, their effects nearly cancel: what is left of the derivatives of single parameters is
the error of their differences. So the step goes along the combination itself, as far as the combination is
uncertain. Its effect is then as large as the noise, and large against rounding and the small jumps that
events make. The steps that follow from a first covariance give a better one.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydroid.parameters import Array, ParameterSet

LARGEST = 0.1
"""largest relative change of any parameter in a step: nothing holds over the width of an unknown direction"""
EDGE = 0.1
"""standard deviations from a bound, below which a parameter counts as held by it"""
UNBALANCED = 0.3
"""part of a step within which both sides must have room; else it goes twice to one side"""
RANK_TOLERANCE = 1e-12
"""singular values below this part of the largest are zero"""


@dataclass(frozen=True, eq=False)
class Axes:
    """Steps from an estimate along p directions of the free parameters, all within the bounds.

    Attributes:
        directions: relative changes, independent of each other, one a row, shape (p, p).
        steps: two signed lengths along each, shape (p, 2): to both sides, or one and two steps to one side.
    """

    directions: Array
    steps: Array

    def slopes(self, function: Callable[[Array], Array], value: Array) -> Array:
        """Derivatives of a function of relative changes, (n, p) -> (n, R), along each direction, (p, R).

        A derivative is that of the parabola through `value`, the function at the estimate, and the two steps'
        values; that of a line where one of these is not finite, and NaN where neither is.
        """
        first, second = self.steps.T[:, :, None]
        rows = function(np.vstack([first * self.directions, second * self.directions]))
        near, far = (rows[: len(first)] - value) / first, (rows[len(first) :] - value) / second
        both = (near * second - far * first) / (second - first)
        return np.where(np.isfinite(both), both, np.where(np.isfinite(near), near, far))

    def shortened(self, factor: float) -> "Axes":
        """Return the same directions with shorter steps."""
        return Axes(self.directions, factor * self.steps)

    def by_parameter(self, slopes: Array) -> Array:
        """Derivatives by each parameter, (p, R), from those along each direction, (p, R)."""
        return np.asarray(np.linalg.solve(self.directions, slopes), dtype=float)


def room(parameters: ParameterSet, theta: Array, scale: Array) -> Array:
    """Return how far each free parameter is from its bounds, in relative changes, shape (2, p)."""
    free = parameters.free
    away = np.stack([theta - parameters.lower, parameters.upper - theta])[:, free]
    return np.maximum(away, 0.0) / scale[free]


def changed(parameters: ParameterSet, theta: Array, changes: Array) -> Array:
    """Return theta, (P,), with changes, (n, P); rounding does not lead out of its bounds."""
    low, high = np.minimum(parameters.lower, theta), np.maximum(parameters.upper, theta)
    return np.clip(theta + changes, low, high)


def single_axes(step: float, within: Array) -> Axes:
    """Return a relative step along each parameter; `within` is its room, shape (2, p)."""
    count = within.shape[1]
    return _fitted(np.eye(count), np.full(count, step), within)


def covariance_axes(root: Array, within: Array, step: float) -> Axes:
    """Return steps of so many standard deviations along the axes of a covariance.

    The axes are those of the parameters off their bounds. A parameter at a bound has a direction of its own:
    the others change with it as the covariance says. So no direction leads out of the bounds to both sides.

    Args:
        root: G of C^-1 = G' G, shape (k, p): a relative change v is |G v| standard deviations long.
        within: the room of each parameter, shape (2, p).
        step: in standard deviations.
    """
    deviation = np.minimum(deviations(root), LARGEST)
    edge = within.min(axis=0) < EDGE * deviation
    inner, at_edge = np.flatnonzero(~edge), np.flatnonzero(edge)
    left, values, axes = np.linalg.svd(root[:, inner], full_matrices=False)
    directions = np.eye(root.shape[1])[[*inner, *at_edge]]
    if len(inner):
        missing = len(inner) - len(values)
        if missing:  # fewer rows than parameters: complete the basis
            axes = np.linalg.svd(root[:, inner])[2]
            values, left = np.append(values, np.zeros(missing)), np.pad(left, ((0, 0), (0, missing)))
        directions[: len(inner), inner] = axes
        known = values > RANK_TOLERANCE * values.max(initial=0.0)
        follow = axes[known].T @ ((left[:, known].T @ root[:, at_edge]) / values[known, None])
        directions[len(inner) :, inner] = -follow.T
    length = np.linalg.norm(root @ directions.T, axis=0)
    with np.errstate(divide="ignore"):
        return _fitted(directions, step / length, within)


def deviations(root: Array) -> Array:
    """Relative standard deviation of each parameter, shape (p,), from G, (k, p); inf where not measured."""
    _, values, axes = np.linalg.svd(root)
    values = np.append(values, np.zeros(len(axes) - len(values)))
    measured = values > RANK_TOLERANCE * values.max(initial=0.0)
    known = np.linalg.norm(axes[measured] / values[measured, None], axis=0)
    return np.where(np.linalg.norm(axes[~measured], axis=0) > 1e-6, np.inf, known)


def _fitted(directions: Array, wanted: Array, within: Array) -> Axes:
    """Return steps of wanted lengths, (p,), shortened to LARGEST and to the room."""
    share = np.abs(directions)
    wanted = np.minimum(wanted, LARGEST / share.max(axis=1))
    towards: NDArray[np.bool_] = directions > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        ahead = np.where(share > 0, np.where(towards, within[1], within[0]) / share, np.inf).min(axis=1)
        behind = np.where(share > 0, np.where(towards, within[0], within[1]) / share, np.inf).min(axis=1)
    both = np.minimum(wanted, np.minimum(ahead, behind))
    one = np.minimum(wanted, np.maximum(ahead, behind) / 2)
    balanced = (both >= UNBALANCED * wanted) | (both >= one)
    first = np.where(balanced, both, np.where(ahead >= behind, one, -one))
    return Axes(directions, np.stack([first, np.where(balanced, -first, 2 * first)], axis=1))
