"""Derivatives by finite differences along the axes of a covariance,
with steps as wide as the uncertainty.

Where parameters trade, their effects nearly cancel: what is left of the derivatives of
single parameters is the error of their differences. So the step goes along the
combination itself, as far as the combination is uncertain. Its effect is then as large
as the noise, and large against rounding and the small jumps that events make.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hydroid.arrays import Array, Ints, Mask, record

Function = Callable[[Array], Array]
"""points (n, P) -> values (n, R); a row that is not finite is a point that cannot be
simulated"""

LARGEST = 0.1
"""largest relative change of a coordinate in a step:
nothing holds over the width of an unknown direction"""
# standard deviations from a bound, below which a coordinate counts as held by it
EDGE = 0.1
# part of a step within which both sides must have room; else it goes twice to one side
UNBALANCED = 0.3
# a step whose effect may be mostly curvature is taken again, this part as long
SHORTER = 0.1
CURVED = 0.3
"""part of the long step's slope; where the short step's is smaller,
the long one's is mostly curvature"""


SHARED = -1
"""owner of a coordinate that is not of one owner alone"""


@record
class Box:
    """A point between its bounds, (P,), what a relative change of 1 is,
    and which p coordinates move."""

    at: Array
    lower: Array
    upper: Array
    scale: Array
    varied: Mask

    def restricted(self, kept: Mask) -> "Box":
        """Return it with only some of the p coordinates varied, shape (p,)."""
        varied = self.varied.copy()
        varied[varied] = kept
        return replace(self, varied=varied)

    @property
    def room(self) -> Array:
        """Relative changes to the lower and to the upper bound, shape (2, p)."""
        to_lower = self.at - self.lower
        to_upper = self.upper - self.at
        # rounding may put a point a little beyond a bound
        away = np.maximum([to_lower, to_upper], 0.0)
        return away[:, self.varied] / self.scale[self.varied]

    def points(self, changes: Array) -> Array:
        """Return points, (n, P), at relative changes, (n, p);
        rounding does not lead out of the bounds."""
        moved = np.tile(self.at, (len(changes), 1))
        moved[:, self.varied] += changes * self.scale[self.varied]
        # a point that stands beyond a bound may stay there
        lowest = np.minimum(self.lower, self.at)
        highest = np.maximum(self.upper, self.at)
        return np.clip(moved, lowest, highest)


@record
class Axes:
    """Steps from a point along p directions of its varied coordinates, one a row,
    all within the bounds.

    `steps` are signed lengths along each: to both sides, or one and two steps to one
    side, shape (p, 2); to one side only, shape (p, 1).
    """

    directions: Array
    steps: Array

    @property
    def one_sided(self) -> "Axes":
        """These axes with a step to one side only, as derivatives of first order need
        them."""
        return Axes(self.directions, self.steps[:, :1])


def differentiate(
    function: Function,
    at: Box,
    axes: Axes,
    value: Array | None = None,
    former: Array | None = None,
) -> Array:
    """Differentiate a function at a point by relative changes of its p varied
    coordinates, shape (p, R).

    Along each axis the derivative is that of the parabola through the values at the
    point and at both steps, or of the line where there is one step or where one of two
    fails. Where both sides differ more than they have in common, or where the slope
    exceeds the former one by far, a shorter step tells whether the effect of the long
    one is mostly curvature.

    The function is called with all points of the differences at once, and with those of
    the shorter steps. Its `value` at the point, shape (R,), is given where it is known.
    `former` derivatives, (p, R), are kept along axes that fail; without them, axes that
    are not single coordinates must not: a coordinate's row is NaN.
    """
    centre = value
    if centre is None:
        centre = function(at.at[None])[0]
    expected = None
    if former is not None:
        expected = axes.directions @ former
    slopes, curved = _slopes(function, at, axes, centre)
    if axes.steps.shape[1] == 2:
        if expected is not None:
            curved |= _far_below(expected, slopes)
        if curved.any():
            shorter = Axes(axes.directions[curved], SHORTER * axes.steps[curved])
            short, _ = _slopes(function, at, shorter, centre)
            mostly_curvature = _far_below(short, slopes[curved])
            replaced = np.flatnonzero(curved)[mostly_curvature]
            slopes[replaced] = short[mostly_curvature]
    failed = ~np.isfinite(slopes).all(axis=1)
    if expected is not None:
        slopes[failed] = expected[failed]
    # along single coordinates the slopes are the derivatives, to the bit
    single = np.eye(len(slopes))
    if np.array_equal(axes.directions, single):
        return slopes
    return np.linalg.solve(axes.directions, slopes).astype(float)


def _far_below(slopes: Array, others: Array) -> Mask:
    """Return where slopes, (p, R), are shorter than CURVED times others, (p,)."""
    length = np.linalg.norm(slopes, axis=1)
    other_length = np.linalg.norm(others, axis=1)
    return length < CURVED * other_length


def single_axes(at: Box, step: float) -> Axes:
    """Return a relative step along each varied coordinate."""
    room = at.room
    coordinates = room.shape[1]
    wanted = np.full(coordinates, step)
    return _fitted(np.eye(coordinates), wanted, room)


def covariance_axes(
    at: Box, root: Array, step: float, owner: Ints | None = None
) -> Axes:
    """Return steps of so many standard deviations along the axes of a covariance.

    The axes are those of the coordinates off their bounds. A coordinate at a bound has
    a direction of its own: the others change with it as the covariance says. So no
    direction leads out of the bounds to both sides. `root` is G of C^-1 = G' G, of full
    rank, (p, p): a relative change v is
    |G v| standard deviations long.

    With an `owner` of each coordinate, (p,), the axes are of one owner's coordinates
    alone, while the others stay. Those that are SHARED have axes of their own, and all
    owners' coordinates change with them.
    """
    room = at.room
    deviation = np.linalg.norm(np.linalg.inv(root), axis=1)
    held = held_by_bound(room, deviation)
    inner = np.flatnonzero(~held)
    if owner is None:
        owner = np.full(len(root), SHARED)
    of_inner = owner[inner]
    shared = inner[of_inner == SHARED]
    owned = inner[of_inner != SHARED]
    none = np.array([], dtype=int)
    rows = list[Array]()
    for one in np.unique(owner[owned]):
        rows.append(_axes_of(root, owned[owner[owned] == one], none))
    rows.append(_axes_of(root, shared, owned))
    for coordinate in np.flatnonzero(held):
        rows.append(_axes_of(root, np.array([coordinate]), inner))
    directions = np.vstack(rows)
    lengths = np.linalg.norm(root @ directions.T, axis=0)
    return _fitted(directions, step / lengths, room)


def _axes_of(root: Array, chosen: Ints, following: Ints) -> Array:
    """Return the axes of the covariance of some coordinates, (c, p), while those that
    follow change so that each axis stays as short as can be."""
    follow = np.linalg.lstsq(root[:, following], -root[:, chosen], rcond=None)[0]
    left = root[:, chosen] + root[:, following] @ follow
    axes = np.linalg.svd(left, full_matrices=False)[2]
    rows = np.zeros((len(chosen), len(root)))
    rows[:, chosen] = axes
    rows[:, following] = axes @ follow.T
    return rows


def held_by_bound(room: Array, deviation: Array) -> Mask:
    """Return whether coordinates are held by a bound, (p,), from the room to both, (2,
    p), and their deviations."""
    return room.min(axis=0) < EDGE * np.minimum(deviation, LARGEST)


def _slopes(
    function: Function, at: Box, axes: Axes, value: Array
) -> tuple[Array, Mask]:
    """Return slopes along each axis, (p, R), and where both sides differ more than they
    have in common, (p,)."""
    steps = axes.steps.T[:, :, None]
    changes = steps * axes.directions
    # the points of all differences in one batch
    points = at.points(changes.reshape(-1, axes.directions.shape[1]))
    rows = function(points).reshape(*steps.shape[:2], -1)
    with np.errstate(all="ignore"):
        first = (rows[0] - value) / steps[0]
        if len(steps) == 1:
            return first, np.zeros(len(first), dtype=bool)
        second = (rows[1] - value) / steps[1]
        # the slope at the point of the parabola through all three
        weighed = first * steps[1] - second * steps[0]
        parabola = weighed / (steps[1] - steps[0])
        difference = np.linalg.norm(first - parabola, axis=1)
        in_common = np.linalg.norm(parabola, axis=1)
        curved = difference > in_common
    # where one of two steps fails (a simulation diverges), the other tells the slope
    line = np.where(np.isfinite(first), first, second)
    slopes = np.where(np.isfinite(parabola), parabola, line)
    return slopes, curved


def _fitted(directions: Array, wanted: Array, room: Array) -> Axes:
    """Return steps of wanted lengths, (p,), shortened to LARGEST and to the room, (2,
    p)."""
    largest = np.abs(directions).max(axis=1)
    wanted = np.minimum(wanted, LARGEST / largest)
    below, above = room
    ahead = _longest(directions, above, below)
    behind = _longest(directions, below, above)
    nearer = np.minimum(ahead, behind)
    farther = np.maximum(ahead, behind)
    to_both = np.minimum(wanted, nearer)
    # of two steps to one side, the second one is twice as long
    to_one = np.minimum(wanted, farther / 2)
    is_long_enough = to_both >= UNBALANCED * wanted
    balanced = is_long_enough | (to_both >= to_one)
    towards_more_room = np.where(ahead >= behind, to_one, -to_one)
    first = np.where(balanced, to_both, towards_more_room)
    second = np.where(balanced, -first, 2 * first)
    return Axes(directions, np.stack([first, second], axis=1))


def _longest(directions: Array, rising: Array, falling: Array) -> Array:
    """Return how far one can go along directions, (p, p), before a coordinate meets a
    bound, (p,).

    `rising` and `falling` are the room of coordinates that the direction raises or
    lowers, (p,).
    """
    share = np.abs(directions)
    room = np.where(directions > 0, rising, falling)
    with np.errstate(all="ignore"):
        lengths = np.where(share > 0, room / share, np.inf)
    return lengths.min(axis=1)
