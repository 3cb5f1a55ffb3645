"""Linear least squares inside a box, by a primal active-set method."""

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

ROUNDING = 1e-12
"""slope, relative to the problem's scale, that is no more than rounding"""


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
