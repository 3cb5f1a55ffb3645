"""Norms of the output error, article 3.1.

The error of equation (17), ε = y - ŷ, enters as an array (n, T): n candidates, T samples. Equation (18)
is a *mean* norm, (1/N Σ|ε|^p)^(1/p): mean absolute error for p = 1, root mean square for p = 2; for
p = inf the 1/N has no effect in the limit and it is the largest |ε|.

Equation (19) divides by "the p-norm of the measured data". We read that as the same mean norm, (18) of
y: then (19) has no unit and means the same for a short and a long segment (for p = inf, largest error
over largest |y|). The other reading, a sum without 1/N, differs by a constant factor N^(-1/p) a segment.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import SettingsError
from hydroid.settings.problem import ObjectiveSettings

Float = NDArray[np.float64]


def norm(error: Float, p: Literal[1, 2, "inf"]) -> Float:
    """p-norm of each candidate's error, equation (18).

    A candidate's value never depends, not in its last bit, on the other candidates: the sum runs along the
    contiguous last axis only.

    Args:
        error: shape (n, T), any unit.
        p: order of the norm.

    Returns:
        Shape (n,), the unit of the error; inf for a row that is not finite or whose norm overflows.
    """
    # A transposed input would sum in another order; with the last axis contiguous numpy sums row by row.
    size = np.abs(np.ascontiguousarray(error))
    with np.errstate(over="ignore", invalid="ignore"):
        if p == 1:
            value = size.mean(axis=-1)
        elif p == 2:
            value = np.sqrt((size * size).mean(axis=-1))
        else:
            value = size.max(axis=-1)
    return np.where(np.isfinite(value), value, np.inf)


def relative_norm(error: Float, measured: Float, p: Literal[1, 2, "inf"]) -> Float:
    """p-norm of each candidate's error in terms of the measured output's, equation (19).

    Args:
        error: shape (n, T).
        measured: y over the same samples, shape (T,), the unit of the error.
        p: order of the norm.

    Returns:
        Shape (n,), no unit; inf for a row that is not finite.

    Raises:
        SettingsError: the measured output is zero throughout.
    """
    scale = norm(measured[None, :], p)[0]
    if scale == 0:
        raise SettingsError(
            "a relative norm has nothing to divide by: the measured output of a segment is zero throughout",
            where="objective.relative",
            hint="use relative: false, or other segments",
        )
    return norm(error, p) / scale


def overall_objective(error: Float, measured: Float, settings: ObjectiveSettings) -> Float:
    """The single objective of each candidate: equation (18), or (19) where relative, over the whole record.

    Args:
        error: shape (n, T).
        measured: shape (T,).
        settings: which norm.

    Returns:
        Shape (n,).
    """
    if settings.relative:
        return relative_norm(error, measured, settings.norm)
    return norm(error, settings.norm)
