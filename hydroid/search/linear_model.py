"""The linear model of a residual in the unit box: its derivatives, and its minimum."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from hydroid.search.axes import Function

Float = NDArray[np.float64]

WIDTH = 2.0**-26
"""of the differences: the root of the rounding unit"""
WIDER = 2.0**10
"""how much wider the step is that tells a weak effect from rounding noise"""
SUSPECT = 1e-3
"""a column this much shorter than the longest one may be noise, and is taken twice"""
TOLERANCE = 1e-12
"""of the box-constrained minimum: slope, in units of a column and the residual, that is only rounding"""


class LinearModel:
    """The linear model r + J s of a residual around a point, for the parameters with effect.

    Args:
        point: of the unit box, shape (p,).
        residual: r, shape (R,).
        jacobian: J, shape (R, p); a column of a parameter without effect is 0.
    """

    def __init__(self, point: Float, residual: Float, jacobian: Float) -> None:
        self._point, self.residual, self.jacobian = point, residual, jacobian
        length = np.linalg.norm(jacobian, axis=0)
        self._moving = np.flatnonzero(length > 0)
        self._scale = length[self._moving]
        self._triangle, self._right = self.reduced(residual)

    def reduced(self, row: Float) -> tuple[Float, Float]:
        """Triangle R and vector b such that |row + J s|² is |b + R s|² and a constant."""
        p = len(self._moving)
        both = np.asarray(np.linalg.qr(np.column_stack([self.jacobian[:, self._moving], row]), mode="r"))
        return both[:p, :p], both[:p, p]

    def step(self, damping: float, row: Float | None = None) -> Float:
        """Minimise |row + J s|² + damping |D s|² inside the box; s of shape (moving,)."""
        triangle, right = (self._triangle, self._right) if row is None else self.reduced(row)
        size = float(np.linalg.norm(right))
        if not size:
            return np.zeros(len(self._moving))
        # in lengths of the columns and of the residual, in which the solver's tolerances mean something
        there, unit = self._point[self._moving], self._scale / size
        matrix = np.vstack([triangle / self._scale, np.sqrt(damping) * np.eye(len(unit))])
        target = np.append(-right / size, np.zeros(len(unit)))
        limits = -there * unit, (1 - there) * unit
        most = 20 * len(unit) + 20  # changes of the active set: far more than it takes
        return lsq_linear(matrix, target, limits, method="bvls", tol=TOLERANCE, max_iter=most).x / unit

    def gain(self, s: Float) -> float:
        """Part of the cost that the linear model promises to save by a step."""
        after = self._right + self._triangle @ s
        return 0.5 * float(self._right @ self._right - after @ after)

    def reach(self, s: Float) -> Float:
        """Return the point of the box that a step leads to, shape (p,)."""
        point = self._point.copy()
        point[self._moving] = np.clip(point[self._moving] + s, 0.0, 1.0)
        return point

    def length(self, s: Float) -> float:
        """Length of a step, scaled."""
        return float(np.linalg.norm(self._scale * s))


def derivatives(residuals: Function, point: Float, row: Float) -> Float:
    """Derivatives by each parameter at a point of the box, (p,), with its residuals, (R,): shape (p, R).

    They are 0 without effect. All differences are one batch. Those that fail are taken to the other side in
    a second batch; where that fails too, they are not finite.
    """

    def quotients(which: NDArray[np.intp], width: float) -> Float:
        steps = np.where(point + abs(width) <= 1.0, width, -width)[which]
        points = np.tile(point, (len(which), 1))
        points[np.arange(len(which)), which] += steps
        with np.errstate(invalid="ignore", over="ignore"):
            return (residuals(np.clip(points, 0.0, 1.0)) - row) / steps[:, None]

    columns = quotients(np.arange(point.size), WIDTH)
    failed = np.flatnonzero(~np.isfinite(columns).all(axis=1))
    if len(failed):
        columns[failed] = quotients(failed, -WIDTH)
    length = np.linalg.norm(columns, axis=1)
    suspect = np.flatnonzero((length > 0) & (length < SUSPECT * length.max()))
    if len(suspect):
        # a derivative does not depend on the step; rounding noise divided by a wider step becomes smaller
        wider = np.linalg.norm(quotients(suspect, WIDER * WIDTH), axis=1)
        columns[suspect[wider < 0.1 * length[suspect]]] = 0.0
    return columns
