"""Hypervolume: how much a Pareto set dominates, as one number for a learning curve.

Measured from the reference point, each candidate is a box with one corner there; the volume sought is that
of their union. Slicing one objective at a time (HSO: While, Hingston, Barone, Huband 2006) leaves, for
every slice, the same question with fewer objectives and the candidates that reach it. Two things keep the
slices few: those that the same candidates reach are merged, adding their thicknesses, and a candidate that
another one covers in all remaining objectives is forgotten. Only positive terms are added.

The candidates that reach a slice are a row of bits, packed into words of 64.
"""

import numpy as np
from numpy.typing import NDArray

from hydroid.search.pareto import dominates, feasible

Float = NDArray[np.float64]
Bool = NDArray[np.bool_]
Words = NDArray[np.uint64]


def hypervolume(objectives: Float, reference: Float) -> float:
    """Volume that the candidates dominate, up to a reference point; exact.

    The cost grows steeply with candidates times objectives: 20 candidates and 8 objectives take some
    milliseconds, 70 and 8 some seconds, 100 and 3 again milliseconds.

    Args:
        objectives: to be small, shape (n, m).
        reference: shape (m,); a candidate that does not lie below it in every objective adds nothing.

    Returns:
        The volume, in the product of the objectives' units.
    """
    inside = feasible(objectives) & np.all(objectives < reference, axis=1)
    sizes = reference - objectives[inside]
    sizes = sizes[~dominates(-sizes).any(axis=0)]
    n, m = sizes.shape
    if n == 0:
        return 0.0
    candidates, weight = _words(np.ones((1, n), dtype=bool)), np.ones(1)
    for k in range(m - 1):
        candidates, weight = _slice(candidates, weight, sizes[:, k])
        candidates, weight = _merge(_forget(candidates, sizes[:, k + 1 :]), weight)
    return float(weight @ _longest(candidates, sizes[:, -1]))


def _slice(candidates: Words, weight: Float, size: Float) -> tuple[Words, Float]:
    """Cut each slice along one objective, at the ends of all boxes."""
    levels = np.unique(size)
    reach = _words(size >= levels[:, None])
    candidates = (candidates[:, None] & reach).reshape(-1, reach.shape[1])
    weight = (weight[:, None] * np.diff(levels, prepend=0.0)).ravel()
    reached = candidates.any(axis=1)
    return _merge(candidates[reached], weight[reached])


def _forget(candidates: Words, rest: Float) -> Words:
    """Drop from each slice the candidates that another of its candidates covers in what is left to slice."""
    covers = dominates(-rest)
    bit, covered = _words(np.eye(len(rest), dtype=bool)), _words(covers)
    for i in np.flatnonzero(covers.any(axis=1)):
        present = (candidates & bit[i]).any(axis=1, keepdims=True)
        candidates = np.where(present, candidates & ~covered[i], candidates)
    return candidates


def _merge(candidates: Words, weight: Float) -> tuple[Words, Float]:
    """One slice for all that the same candidates reach."""
    key = candidates.view(f"V{candidates.itemsize * candidates.shape[1]}")[:, 0]
    _, first, same = np.unique(key, return_index=True, return_inverse=True)
    return candidates[first], np.bincount(same, weight).astype(np.float64)


def _longest(candidates: Words, size: Float) -> Float:
    """The largest size among the candidates of each slice."""
    longest = np.zeros(len(candidates))
    for bit, length in zip(_words(np.eye(len(size), dtype=bool)), size, strict=True):
        longest = np.maximum(longest, np.where((candidates & bit).any(axis=1), length, 0.0))
    return longest


def _words(bits: Bool) -> Words:
    """Rows of bits, shape (..., n), packed into words of 64."""
    padding = np.zeros((*bits.shape[:-1], -bits.shape[-1] % 64), dtype=bool)
    return np.packbits(np.concatenate((bits, padding), axis=-1), axis=-1).view(np.uint64)
