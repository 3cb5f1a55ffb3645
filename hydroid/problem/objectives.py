"""Objectives from the output error: norms (article 3.1), and segments of the record (3.2 and figure 18).

The error of equation (17), ε = y - ŷ, is an array (n, T): n candidates, T samples. Equation (18) is a *mean*
norm, (1/N Σ|ε|^p)^(1/p): the mean absolute error for p = 1, the root mean square for p = 2. For p = inf it is
the largest |ε|.

Equation (19) divides by "the p-norm of the measured data". We take the same mean norm (18) of y, so that (19)
has no unit and means the same for short and long segments. A sum without 1/N would differ by a constant
factor N^(-1/p) per segment.

A segment is a pair of sample indices [first, end). Segments cover the record without overlap, and none is
empty.
"""

import numpy as np

from hydroid.arrays import Array, Ints
from hydroid.errors import SettingsError
from hydroid.settings.problem import ObjectiveSettings


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


def segment_objectives(error: Array, measured: Array, bounds: Ints, settings: ObjectiveSettings) -> Array:
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


def segment_bounds(samples: int, segments: int) -> Ints:
    """Cut a record of so many samples into segments of equal length.

    Returns:
        [first, end) of each segment in samples, shape (S, 2): increasing, gapless, from 0 to T.

    Raises:
        SettingsError: more segments than samples.
    """
    if segments > samples:
        what = f"{segments} segments do not fit into {samples} samples"
        raise SettingsError(what, where="objective.segments", hint="each segment needs a sample of its own")
    edges = np.arange(segments + 1, dtype=np.int64) * samples // segments
    return np.stack((edges[:-1], edges[1:]), axis=1)
