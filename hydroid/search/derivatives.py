"""Derivatives of simulated residuals in the unit box, by narrow differences of whole batches."""

import numpy as np
from numpy.typing import NDArray

from hydroid.search.axes import Array, Axes, Box, Function, differentiate, single_axes

WIDTH = 2.0**-26
"""of the differences: the root of the rounding unit"""
WIDER = 2.0**10
"""how much wider the step is that tells a weak effect from rounding noise"""
SUSPECT = 1e-3
"""a column this much shorter than the longest one may be noise, and is taken twice"""


def derivatives(residuals: Function, point: Array, row: Array) -> Array:
    """Derivatives by each parameter at a point of the box, (p,), with its residuals, (R,): shape (p, R).

    They are 0 without effect. All differences are one batch. Those that fail are taken to the other side in
    a second batch; where that fails too, they are not finite.
    """

    def quotients(which: NDArray[np.bool_], step: float) -> Array:
        box = Box(point, np.zeros_like(point), np.ones_like(point), np.ones_like(point), which)
        axes = single_axes(box, abs(step)).one_sided
        return differentiate(residuals, box, Axes(axes.directions, np.sign(step) * axes.steps), row)

    columns = quotients(np.ones(point.size, dtype=bool), WIDTH)
    failed = np.logical_not(np.isfinite(columns).all(axis=1))
    if failed.any():
        columns[failed] = quotients(failed, -WIDTH)
    length = np.linalg.norm(columns, axis=1)
    suspect = (length > 0) & (length < SUSPECT * length.max())
    if suspect.any():
        # a derivative does not depend on the step; rounding noise divided by a wider step becomes smaller
        wider = np.linalg.norm(quotients(suspect, WIDER * WIDTH), axis=1)
        suspect[suspect] = wider < 0.1 * length[suspect]
        columns[suspect] = 0.0
    return columns
