"""Any rate -> one period: commands are held, angles interpolated.

A faster log is thinned by plain interpolation, without a filter before it: the fit compares angles sample by
sample, and white sensor noise stays what it was, while a filter would colour it and delay the angle.
"""

import numpy as np

from hydroid.log.log import Floats

ON_GRID = 0.01  # of a period: where all samples are this near to the first one's grid, values pass unchanged
_ROUNDING = 1e-6  # of a period


def resample(
    time: Floats, command: Floats, angle: Floats, period: float, delay: float = 0.0
) -> tuple[Floats, Floats, Floats]:
    """Bring a recording to the grid k · period, from its first sample to its last.

    Pressures are interpolated as angles are.

    Args:
        time: [s], shape (R,), strictly increasing.
        command: [%], shape (R, J).
        angle: [rad] (and other signals that are measured), shape (R, M).
        period: [s].
        delay: the command acts this much later [s] than logged; before the first one acts it is 0 %.

    Returns:
        Grid [s] from 0, shape (T,); command and angle, shapes (T, J) and (T, M).
    """
    time, grid = time - time[0], _grid(time, period)
    if is_on_grid(time, period):
        time = grid
    else:
        angle = np.stack([np.interp(grid, time, column) for column in angle.T], axis=1)
    return grid, hold(time, command, grid - delay, period), angle


def is_on_grid(time: Floats, period: float) -> bool:
    """Return whether the samples already stand on the grid, so that their values pass unchanged."""
    grid = _grid(time, period)
    return len(time) == len(grid) and bool((np.abs(time - time[0] - grid) <= ON_GRID * period).all())


def hold(time: Floats, command: Floats, at: Floats, period: float) -> Floats:
    """Return the last command at or before each time in `at` [s]; 0 before the first, shape (len(at), J)."""
    index = np.searchsorted(time, at + _ROUNDING * period, side="right") - 1
    return np.where(index[:, None] >= 0, command[index], 0.0)


def _grid(time: Floats, period: float) -> Floats:
    return period * np.arange(int((time[-1] - time[0]) / period + ON_GRID) + 1, dtype=np.float64)
