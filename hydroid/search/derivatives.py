"""Derivatives of simulated residuals in the unit box, by finite differences of whole batches."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Residuals = Callable[[Float], Float]
"""points of the unit box (n, p) -> residuals (n, R); a row that is not finite is a failed candidate"""

WIDER = 2.0**10
"""how much wider the step is that tells a weak effect from rounding noise"""
SUSPECT = 1e-3
"""a column this much shorter than the longest one may be noise, and is taken twice"""


def derivatives(residuals: Residuals, point: Float, row: Float, width: float) -> Float:
    """Derivatives in each parameter by finite differences, shape (p, R): 0 without effect.

    All differences are one batch, towards the wider half of the box. Those that fail are taken to the other
    side in a second batch; where that fails too, or a bound is there, they are not finite.
    """
    h = width * np.where(point > 0.5, -1.0, 1.0)
    columns = _quotients(residuals, point, row, h, np.ones(point.size, dtype=bool))
    failed = np.logical_not(np.isfinite(columns).all(axis=1))
    if failed.any():
        columns[failed] = _quotients(residuals, point, row, -h, failed)
    length = np.linalg.norm(columns, axis=1)
    suspect = (length > 0) & (length < SUSPECT * length.max())
    if suspect.any():
        # a derivative does not depend on the step; rounding noise divided by a wider step becomes smaller
        wider = np.linalg.norm(_quotients(residuals, point, row, WIDER * h, suspect), axis=1)
        suspect[suspect] = wider < 0.1 * length[suspect]
        columns[suspect] = 0.0
    return columns


def _quotients(residuals: Residuals, point: Float, row: Float, h: Float, which: NDArray[np.bool_]) -> Float:
    """Difference quotients of the parameters `which`, shape (their number, R); nan beyond a bound."""
    points = (point + np.diag(h))[which]
    inside = np.all((points >= 0) & (points <= 1), axis=1)
    quotients = np.full((len(points), row.size), np.nan)
    if inside.any():
        rows = residuals(points[inside])
        taken = (points - point).sum(axis=1)[inside, None]
        with np.errstate(invalid="ignore", over="ignore"):
            quotients[inside] = (rows - row) / taken
    return quotients
