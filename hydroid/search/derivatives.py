"""Derivatives of simulated residuals in the unit box, by finite differences of whole batches."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Bool = NDArray[np.bool_]

STEP = 2.0**-26
"""Finite-difference step in the unit box: the square root of the rounding unit."""
WIDER = 2.0**10
"""How much wider the step is that tells a weak effect from rounding noise."""
SUSPECT = 1e-3
"""A derivative this much shorter than the longest one may be noise, and is looked at twice."""


def derivatives(
    residuals: Callable[[Float], Float], point: Float, row: Float, width: float = 1.0
) -> tuple[Float, Bool]:
    """Derivatives of the residuals in each parameter.

    All steps are one batch, into the wider half of the box. Those that fail are taken to the other side, in
    a second batch, unless the bound is there.

    Args:
        residuals: points (n, p) -> residuals (n, R); a row that is not finite is a failed candidate.
        point: shape (p,), within [0, 1].
        row: residual there, shape (R,).
        width: the step in units of STEP; a wider one looks over small jumps of the residual.

    Returns:
        The derivatives, shape (p, R), not finite where both steps failed; and whether each parameter has an
        effect at all, shape (p,).
    """
    step = width * np.where(point > 0.5, -STEP, STEP)
    everyone = np.ones(point.size, dtype=bool)
    columns = _quotients(residuals, point, row, step, everyone)
    failed = np.logical_not(np.all(np.isfinite(columns), axis=1))
    if failed.any():
        columns[failed] = _quotients(residuals, point, row, -step, failed)
    return columns, _effective(residuals, point, row, step, columns)


def _effective(
    residuals: Callable[[Float], Float], point: Float, row: Float, step: Float, columns: Float
) -> Bool:
    """Whether each derivative is more than zero or rounding.

    A derivative does not depend on the step; rounding divided by a wider step becomes smaller.
    """
    length = np.linalg.norm(columns, axis=1)
    effective = length > 0
    suspect = effective & (length < SUSPECT * length.max())
    if suspect.any():
        wider = np.linalg.norm(_quotients(residuals, point, row, WIDER * step, suspect), axis=1)
        effective[suspect] = np.logical_not(wider < 0.1 * length[suspect])
    return effective


def _quotients(
    residuals: Callable[[Float], Float], point: Float, row: Float, step: Float, which: Bool
) -> Float:
    """Difference quotients of the parameters `which`, shape (their number, R); nan beyond a bound."""
    points = (point + np.diag(step))[which]
    inside = np.all((points >= 0) & (points <= 1), axis=1)
    quotients = np.full((len(points), row.size), np.nan)
    if inside.any():
        rows = residuals(points[inside])
        taken = (points - point).sum(axis=1)[inside, None]
        with np.errstate(invalid="ignore", over="ignore"):
            quotients[inside] = (rows - row) / taken
    return quotients
