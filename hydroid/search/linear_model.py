"""The linear model of a residual, and its minimum inside a box."""

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

ROUNDING = 1e-12
"""slope, relative to the problem's scale, that is no more than rounding"""


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
        matrix = np.vstack([triangle, np.sqrt(damping) * np.diag(self._scale)])
        there = self._point[self._moving]
        return box_least_squares(matrix, np.append(right, np.zeros(there.size)), -there, 1 - there)

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


def box_least_squares(matrix: Float, right: Float, low: Float, high: Float) -> Float:
    """Minimise |right + matrix s|² subject to low <= s <= high, with low <= 0 <= high.

    From s = 0: variables that would leave the box are held at their bounds; once the rest is optimal, the one
    that a bound holds back most is released (J. Nocedal, S. Wright, Numerical Optimization, 2006, 16.5).

    Args:
        matrix: of full column rank, shape (m, p).
        right: shape (m,).
        low: shape (p,).
        high: shape (p,).

    Returns:
        s, shape (p,).
    """
    s = np.zeros(matrix.shape[1])
    slope = matrix.T @ right
    tolerance = ROUNDING * np.linalg.norm(right) * np.linalg.norm(matrix, axis=0).max(initial=0.0)
    held = ((low >= 0) & (slope >= 0)) | ((high <= 0) & (slope <= 0))
    for _ in range(20 * s.size + 20):  # far more than it takes; a cycle by rounding ends here
        free = ~held
        if free.any():
            rest = right + matrix[:, held] @ s[held]
            way = np.linalg.lstsq(matrix[:, free], -rest, rcond=None)[0] - s[free]
            room = np.where(way > 0, high[free] - s[free], low[free] - s[free])
            with np.errstate(divide="ignore", invalid="ignore"):
                part = np.where(way == 0, np.inf, room / way)
            first = part.min()
            if first < 1:
                hit = np.flatnonzero(free)[part <= first]
                s[free] += first * way
                s[hit] = np.where(way[part <= first] > 0, high[hit], low[hit])
                held[hit] = True
                continue
            s[free] += way
        slope = matrix.T @ (right + matrix @ s)
        pull = np.where(held & (low < high), np.where(s <= low, -slope, slope), 0.0)
        if not held.any() or pull.max() <= tolerance:
            break
        held[np.argmax(pull)] = False
    return s
