"""Segments of a record, one objective each: equations (21) and (22), article 3.2 and figure 18.

A segment is a pair of sample indices [first, end). The segments of a record cover it without overlap
and none is empty. Cut at its turning points, a record falls apart into single strokes of the joint.
"""

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import SettingsError
from hydroid.problem.norms import overall_objective
from hydroid.settings.problem import ObjectiveSettings, SegmentSettings

Float = NDArray[np.float64]
Int = NDArray[np.int64]

_WHERE = "objective.segments"


def segment_objectives(error: Float, measured: Float, bounds: Int, settings: ObjectiveSettings) -> Float:
    """One objective a segment, equations (21) and (22).

    Args:
        error: output error of each candidate, shape (n, T).
        measured: measured output, shape (T,), the unit of the error.
        bounds: [first, end) of each segment in samples, shape (S, 2).
        settings: which norm, absolute or relative to the measured output of the same segment.

    Returns:
        Shape (n, S). A candidate whose error is not finite anywhere in the segments is inf in all of them:
        a simulation that broke down late says nothing that its first segments could be praised for.

    Raises:
        SettingsError: relative, and the measured output is zero throughout a segment.
    """
    columns = [overall_objective(error[:, a:b], measured[a:b], settings) for a, b in bounds]
    objectives = np.stack(columns, axis=1)
    objectives[~np.isfinite(objectives).all(axis=1)] = np.inf
    return objectives


def segment_bounds(measured: Float, period: float, settings: SegmentSettings) -> Int:
    """Cut a record into segments.

    Args:
        measured: the output whose turning points count, shape (T,), any unit.
        period: sample period [s].
        settings: how to cut.

    Returns:
        [first, end) of each segment in samples, shape (S, 2): increasing, gapless, from 0 to T.

    Raises:
        SettingsError: more segments than the record has samples or turning points, or a cut outside it.
    """
    samples = len(measured)
    if settings.equal is not None:
        cuts = np.arange(1, settings.equal) * samples // settings.equal
    elif settings.turning_points is not None:
        cuts = _turning_cuts(measured, settings.turning_points, settings.swing)
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


def _turning_cuts(measured: Float, segments: int, swing: float) -> Int:
    """Samples of the `segments` - 1 most prominent turning points, in order of time."""
    least = swing * float(np.ptp(measured))
    extremes = _extremes(measured, least)
    found = len(extremes) - 2
    if found < segments - 1:
        raise SettingsError(
            f"{segments} segments need {segments - 1} turning points, the measured output has {found} "
            f"whose swing exceeds {swing:g} of its range",
            where=f"{_WHERE}.turning_points",
            hint=f"at most {found + 1} segments, or a smaller swing",
        )
    kept = _most_prominent(measured, extremes, segments - 1)
    # A quarter keeps the stretches around a peak and its trough apart: their values differ by `least`.
    return np.array([_middle(measured, k, least / 4) for k in kept], dtype=np.int64)


def _extremes(y: Float, least: float) -> Int:
    """Samples of alternating peaks and troughs, ends included, each `least` away from its neighbours.

    The smallest swing is taken out until all are large enough. Noise, quantisation and plateaus make
    small swings only, so no filter is needed and no peak is shifted by one.
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


def _most_prominent(y: Float, extremes: Int, count: int) -> Int:
    """The `count` turning points that outlast the others when swings are taken out, smallest first."""
    at = extremes
    while (surplus := len(at) - 2 - count) > 0:
        gone = _swing(at, int(np.argmin(np.abs(np.diff(y[at])))))
        at = np.delete(at, gone[-surplus:])
    return at[1:-1]


def _swing(at: Int, k: int) -> list[int]:
    """What goes with swing k: its peak and its trough, or the end of the record that it starts from."""
    if k == 0:
        return [0]
    return [k + 1] if k == len(at) - 2 else [k, k + 1]


def _middle(y: Float, k: int, tolerance: float) -> int:
    """Middle of the stretch around sample k that stays within `tolerance` of it: of a plateau, its centre."""
    outside = np.flatnonzero(np.abs(y - y[k]) > tolerance)
    after = int(np.searchsorted(outside, k))
    return int(outside[after - 1] + outside[after]) // 2
