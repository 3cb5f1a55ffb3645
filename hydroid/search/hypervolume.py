"""Hypervolume: how much a Pareto set dominates, as one number for a learning curve.

Measured from the reference point, each member is a box with one corner there; the volume sought is that
of their union. Slicing one objective at a time (HSO: While, Hingston, Barone, Huband 2006) leaves, for
every slice, the same question with fewer objectives and the members that reach it. Two things keep the
slices few: those that the same members reach are merged, adding their thicknesses, and a member that
another one covers in all remaining objectives is forgotten. Only positive terms are added.

The members that reach a slice are a row of bits, packed into words of 64.
"""

import numpy as np
from numpy.typing import NDArray

from hydroid.search.pareto import dominates, feasible

Float = NDArray[np.float64]
Bool = NDArray[np.bool_]
Words = NDArray[np.uint64]


def hypervolume(objectives: Float, reference: Float) -> float:
    """Volume that the members dominate, up to a reference point; exact.

    The cost grows steeply with members times objectives: 20 members and 8 objectives take some
    milliseconds, 70 and 8 some seconds, 100 and 3 again milliseconds.

    Args:
        objectives: to be small, shape (n, m).
        reference: shape (m,); a member that does not lie below it in every objective adds nothing.

    Returns:
        The volume, in the product of the objectives' units.
    """
    inside = feasible(objectives) & np.all(objectives < reference, axis=1)
    sizes = reference - objectives[inside]
    sizes = sizes[~dominates(-sizes).any(axis=0)]
    n, m = sizes.shape
    if n == 0:
        return 0.0
    members, weight = _words(np.ones((1, n), dtype=bool)), np.ones(1)
    for k in range(m - 1):
        members, weight = _slice(members, weight, sizes[:, k])
        members, weight = _merge(_forget(members, sizes[:, k + 1 :]), weight)
    return float(weight @ _longest(members, sizes[:, -1]))


def _slice(members: Words, weight: Float, size: Float) -> tuple[Words, Float]:
    """Cut each slice along one objective, at the ends of all boxes."""
    levels = np.unique(size)
    reach = _words(size >= levels[:, None])
    members = (members[:, None] & reach).reshape(-1, reach.shape[1])
    weight = (weight[:, None] * np.diff(levels, prepend=0.0)).ravel()
    reached = members.any(axis=1)
    return _merge(members[reached], weight[reached])


def _forget(members: Words, rest: Float) -> Words:
    """Drop from each slice the members that another of its members covers in what is left to slice."""
    covers = dominates(-rest)
    bit, covered = _words(np.eye(len(rest), dtype=bool)), _words(covers)
    for i in np.flatnonzero(covers.any(axis=1)):
        present = (members & bit[i]).any(axis=1, keepdims=True)
        members = np.where(present, members & ~covered[i], members)
    return members


def _merge(members: Words, weight: Float) -> tuple[Words, Float]:
    """One slice for all that the same members reach."""
    key = members.view(f"V{members.itemsize * members.shape[1]}")[:, 0]
    _, first, same = np.unique(key, return_index=True, return_inverse=True)
    return members[first], np.bincount(same, weight).astype(np.float64)


def _longest(members: Words, size: Float) -> Float:
    """The largest size among the members of each slice."""
    longest = np.zeros(len(members))
    for bit, length in zip(_words(np.eye(len(size), dtype=bool)), size, strict=True):
        longest = np.maximum(longest, np.where((members & bit).any(axis=1), length, 0.0))
    return longest


def _words(bits: Bool) -> Words:
    """Rows of bits, shape (..., n), packed into words of 64."""
    padding = np.zeros((*bits.shape[:-1], -bits.shape[-1] % 64), dtype=bool)
    return np.packbits(np.concatenate((bits, padding), axis=-1), axis=-1).view(np.uint64)
