"""Objectives from the output error: norms (article 3.1), and segments of the record (3.2 and figure 18).

The error of equation (17), ε = y - ŷ, is an array (n, T): n candidates, T samples. Equation (18) is a *mean*
norm, (1/N Σ|ε|^p)^(1/p): the mean absolute error for p = 1, the root mean square for p = 2. For p = inf it is
the largest |ε|.

Equation (19) divides by "the p-norm of the measured data". We take the same mean norm (18) of y, so that (19)
has no unit and means the same for short and long segments. A sum without 1/N would differ by a constant
factor N^(-1/p) per segment.

A segment is a pair of sample indices [first, end). Segments cover the record without overlap, and none is
empty. Cuts at turning points divide it into single strokes of the joint.
"""

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import SettingsError
from hydroid.parameters import Array
from hydroid.settings.problem import ObjectiveSettings, SegmentSettings

Int = NDArray[np.int64]

SWING = 0.05
"""smallest prominence of a turning point, as a part of the output's range"""
_WHERE = "objective.segments"


def norm(error: Array, p: float | str) -> Array:
    """Return the p-norm (18) of each candidate's error, (n, T) -> (n,); p is 1, 2 or "inf".

    It is inf where the error is not finite or the norm overflows. A candidate's value does not depend, even
    in its last bit, on the other candidates.
    """
    # with the last axis contiguous numpy sums row by row; a transposed input would be summed in another order
    size = np.abs(np.ascontiguousarray(error))
    with np.errstate(over="ignore", invalid="ignore"):
        if p == 1:
            value = size.mean(axis=-1)
        elif p == 2:
            value = np.sqrt((size * size).mean(axis=-1))
        else:
            value = size.max(axis=-1)
    return np.where(np.isfinite(value), value, np.inf)


def overall_objective(error: Array, measured: Array, settings: ObjectiveSettings) -> Array:
    """Return the norm (18) of each candidate's error, (n, T) -> (n,); where relative, (19).

    Raises:
        SettingsError: relative, and the measured output, shape (T,), is zero throughout.
    """
    value = norm(error, settings.norm)
    if not settings.relative:
        return value
    scale = norm(measured[None, :], settings.norm)[0]
    if scale == 0:
        raise SettingsError(
            "a relative norm has nothing to divide by: the measured output of a segment is zero throughout",
            where="objective.relative",
            hint="use relative: false, or other segments",
        )
    return value / scale


def segment_objectives(error: Array, measured: Array, bounds: Int, settings: ObjectiveSettings) -> Array:
    """Return one objective per segment, equations (21) and (22), shape (n, S).

    A candidate whose error is not finite anywhere has inf in all segments: the first segments of a simulation
    that diverged later count for nothing.

    Args:
        error: output error of each candidate, shape (n, T).
        measured: measured output, shape (T,), in the unit of the error.
        bounds: [first, end) of each segment in samples, shape (S, 2).
        settings: the norm.

    Raises:
        SettingsError: relative, and the measured output is zero throughout a segment.
    """
    columns = [overall_objective(error[:, a:b], measured[a:b], settings) for a, b in bounds]
    objectives = np.stack(columns, axis=1)
    objectives[~np.isfinite(objectives).all(axis=1)] = np.inf
    return objectives


def segment_bounds(measured: Array, period: float, settings: SegmentSettings) -> Int:
    """Cut a record of measured angles, shape (T,), at a sample period [s] into segments.

    Returns:
        [first, end) of each segment in samples, shape (S, 2): increasing, gapless, from 0 to T.

    Raises:
        SettingsError: more segments than the record has samples or turning points, or a cut outside it.
    """
    samples = len(measured)
    if settings.equal is not None:
        cuts = np.arange(1, settings.equal) * samples // settings.equal
    elif settings.turning_points is not None:
        cuts = _turning_cuts(measured, settings.turning_points)
    else:
        cuts = np.rint(np.minimum(np.array(settings.times) / period, samples))
    edges = np.concatenate(([0], cuts, [samples]))
    if (np.diff(edges) < 1).any():
        raise SettingsError(
            f"{len(edges) - 1} segments do not fit into {samples} samples ({samples * period:g} s)",
            where=_WHERE,
            hint="each segment needs a sample of its own, and each cut lies inside the record",
        )
    return np.stack((edges[:-1], edges[1:]), axis=1).astype(np.int64)


def _turning_cuts(measured: Array, segments: int) -> Int:
    """Samples of the `segments` - 1 most prominent turning points, in order of time."""
    least = SWING * float(np.ptp(measured))
    extremes = _extremes(measured, least)
    count = len(extremes) - 2
    if count < segments - 1:
        raise SettingsError(
            f"{segments} segments need {segments - 1} turning points, the measured output has {count} "
            f"whose swing exceeds {SWING:g} of its range",
            where=f"{_WHERE}.turning_points",
            hint=f"at most {count + 1} segments",
        )
    while (surplus := len(extremes) - 2 - (segments - 1)) > 0:
        smallest = int(np.argmin(np.abs(np.diff(measured[extremes]))))
        extremes = np.delete(extremes, _swing(extremes, smallest)[-surplus:])
    # within a quarter, the plateaus around a peak and its trough do not overlap: they differ by `least`
    return np.array([_middle(measured, k, least / 4) for k in extremes[1:-1]], dtype=np.int64)


def _extremes(y: Array, least: float) -> Int:
    """Samples of alternating peaks and troughs, ends included, each `least` away from its neighbours.

    The smallest swing is removed until all are large enough. Noise, quantisation and plateaus make small
    swings only, so no filter is needed, and none shifts a peak.
    """
    direction = np.sign(np.diff(y))
    moving = np.flatnonzero(direction)
    at = moving[1:][direction[moving[1:]] != direction[moving[:-1]]]
    at = np.concatenate(([0], at, [len(y) - 1]))
    while len(at) > 2:
        swings = np.abs(np.diff(y[at]))
        k = int(np.argmin(swings))
        if swings[k] >= least:
            break
        at = np.delete(at, _swing(at, k))
    return at


def _swing(at: Int, k: int) -> list[int]:
    """What is removed with swing k: its peak and trough, or only an end of the record."""
    if k == 0:
        return [0]
    return [k + 1] if k == len(at) - 2 else [k, k + 1]


def _middle(y: Array, k: int, tolerance: float) -> int:
    """Middle of the stretch around sample k that stays within `tolerance` of it: of a plateau, its centre."""
    outside = np.flatnonzero(np.abs(y - y[k]) > tolerance)
    after = int(np.searchsorted(outside, k))
    return int(outside[after - 1] + outside[after]) // 2
