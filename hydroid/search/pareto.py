"""Pareto sets: dominance, ranks, crowding, utopia,
and one estimate from a set (article 3.2 and 6.1).

All objectives are to be small. A candidate with an objective that is not finite is
infeasible: every feasible candidate dominates it.
"""

import numpy as np

from hydroid.arrays import Array, Ints, Mask
from hydroid.errors import SettingsError


def feasible(objectives: Array) -> Mask:
    """Candidates all of whose objectives (n, m) are finite, shape (n,)."""
    return np.all(np.isfinite(objectives), axis=1)


def dominates(values: Array) -> Mask:
    """Whether candidate i (row) dominates j (column): nowhere worse, somewhere better;
    shape (n, n)."""
    no_worse = np.ones((len(values), len(values)), dtype=bool)
    better = ~no_worse
    for column in values.T:
        no_worse &= column[:, None] <= column
        better |= column[:, None] < column
    return no_worse & better


def ranks(objectives: Array) -> Ints:
    """Fast non-dominated sorting (Deb 2002): the front of each candidate, (n,), by
    objectives, (n, m).

    0 for those that nobody dominates, 1 for those that only these dominate, ...;
    infeasible ones are last.
    """
    values = np.where(feasible(objectives)[:, None], objectives, np.inf)
    above = dominates(values)
    waiting = above.sum(axis=0)
    rank = np.full(len(values), -1)
    front = waiting == 0
    current = 0
    while front.any():
        rank[front] = current
        waiting = waiting - above[front].sum(axis=0)
        front = (waiting == 0) & (rank < 0)
        current += 1
    return rank


def non_dominated(objectives: Array) -> Mask:
    """The Pareto set among the candidates, shape (n,); empty if none is feasible."""
    return (ranks(objectives) == 0) & feasible(objectives)


def crowding(objectives: Array, rank: Ints) -> Array:
    """Crowding distance (Deb 2002), (n,): the room that each of (n, m) has on its
    front, `rank`.

    The sum over the objectives of the gap between its two neighbours, in parts of the
    front's range; inf at the ends of a front, 0 for the infeasible.
    """
    crowd = np.zeros(objectives.shape)
    usable = feasible(objectives)
    for number in np.unique(rank[usable]):
        candidates = (rank == number) & usable
        front = objectives[candidates]
        order = np.argsort(front, axis=0, kind="stable")
        sorted_ = np.take_along_axis(front, order, axis=0)
        span = sorted_[-1] - sorted_[0]
        gaps = np.full(front.shape, np.inf)
        # An objective in which all are equal has no ends and no gaps.
        gaps[:, span == 0] = 0.0
        between_neighbours = sorted_[2:] - sorted_[:-2]
        gaps[1:-1] = between_neighbours / np.where(span == 0, 1.0, span)
        # back to the order of the candidates
        np.put_along_axis(front, order, gaps, axis=0)
        crowd[candidates] = front
    return crowd.sum(axis=1)


def segment_best(objectives: Array) -> Ints:
    """The best candidate of each segment, (S,), by objectives, (n, S):
    the thin traces of figure 19."""
    return _ranked(objectives).argmin(axis=0)


def average(points: Array, objectives: Array) -> Array:
    """The article's estimate, (p,): the mean of the best of points, (n, p), of all
    segments, (n, S).

    As a rule no candidate of the set, and inside the bounds where all are. The points'
    coordinates are linear in the parameters.
    """
    return points[segment_best(objectives)].mean(axis=0)


def utopia(points: Array, objectives: Array) -> Array:
    """Return the candidate nearest to the utopia point F⁰, (p,), of a Pareto set of
    points, (n, p), by (n, S).

    The article's criterion 1 is the sum of squares of F - F⁰. Segments in which the arm
    moves far would decide alone, so each objective is first divided by its range over
    the set; one without range is left out.
    """
    values = _ranked(objectives)
    usable = objectives[feasible(objectives)]
    nearest = usable.min(axis=0)
    span = np.ptp(usable, axis=0)
    relative = (values - nearest) / np.where(span > 0, span, 1.0)
    distance = (relative**2).sum(axis=1)
    return points[distance.argmin()]


def _ranked(objectives: Array) -> Array:
    """Objectives with inf throughout for infeasible candidates."""
    usable = feasible(objectives)
    if not usable.any():
        raise SettingsError(
            "no candidate of the population could be simulated",
            hint="check the bounds of the parameters, and the model with `hydroid simulate`",
        )
    return np.where(usable[:, None], objectives, np.inf)
