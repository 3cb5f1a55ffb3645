"""One estimate from a Pareto set, article 3.2 and 6.1: three ways, all pure functions of the set."""

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import SettingsError
from hydroid.search.pareto import feasible, ideal

Float = NDArray[np.float64]
Int = NDArray[np.int64]


def segment_best(objectives: Float) -> Int:
    """The best candidate of each segment, the thin traces of figure 19.

    Args:
        objectives: shape (n, S).

    Returns:
        Indices, shape (S,); one candidate may be best in several segments.

    Raises:
        SettingsError: no candidate is feasible.
    """
    return _ranked(objectives).argmin(axis=0)


def average(points: Float, objectives: Float) -> Float:
    """The article's estimate: the mean, parameter by parameter, of the best points of all segments.

    Args:
        points: shape (n, p), any coordinates that are linear in the parameters.
        objectives: shape (n, S).

    Returns:
        Shape (p,): as a rule not a candidate of the set, and inside the bounds where all candidates are.

    Raises:
        SettingsError: no candidate is feasible.
    """
    return points[segment_best(objectives)].mean(axis=0)


def utopia(points: Float, objectives: Float) -> Float:
    """The candidate nearest to the utopia point F⁰.

    The article's criterion 1 is the sum of squares of F - F⁰. Segments in which the arm moves far would
    decide alone, so each objective is first divided by its range over the set; one without range is left
    out.

    Args:
        points: shape (n, p).
        objectives: shape (n, S), of the Pareto set only: other candidates would widen the ranges.

    Returns:
        Shape (p,), the first of equals.

    Raises:
        SettingsError: no candidate is feasible.
    """
    values = _ranked(objectives)
    nearest = ideal(objectives)
    span = objectives[feasible(objectives)].max(axis=0) - nearest
    distance = (((values - nearest) / np.where(span > 0, span, 1.0)) ** 2).sum(axis=1)
    return points[distance.argmin()]


def best(points: Float, overall: Float) -> Float:
    """The candidate with the lowest norm over the whole record.

    Args:
        points: shape (n, p).
        overall: shape (n,).

    Returns:
        Shape (p,), the first of equals.

    Raises:
        SettingsError: no candidate is feasible.
    """
    return points[segment_best(overall[:, None])[0]]


def _ranked(objectives: Float) -> Float:
    """Objectives with inf throughout for infeasible candidates."""
    usable = feasible(objectives)
    if not usable.any():
        raise SettingsError(
            "no candidate of the population could be simulated",
            hint="check the bounds of the parameters, and the model with `hydroid simulate`",
        )
    return np.where(usable[:, None], objectives, np.inf)
