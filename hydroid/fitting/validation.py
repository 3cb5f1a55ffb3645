"""How well a fit reproduces a log: the article's table 9, and what others print beside it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hydroid.parameters import Array

STILL = 1e-9
"""an angle whose rms distance from its mean is below this does not move, but for rounding [rad]"""


@dataclass(frozen=True)
class ErrorIndices:
    """Indices of an output error: mean absolute, rms and largest [rad], and fit [%].

    fit = 100 (1 - |y - y_hat| / |y - mean(y)|), 100 for a perfect response, 0 for the mean of the data;
    NaN where the data do not move.
    """

    mean_absolute: float
    rms: float
    largest: float
    fit: float


def error_indices(measured: Array, simulated: Array) -> ErrorIndices:
    """Compare a simulated response with a measured one [rad], both of shape (T,)."""
    return pooled_indices([(measured, simulated)])


def pooled_indices(pairs: Sequence[tuple[Array, Array]]) -> ErrorIndices:
    """Compare several channels at once: measured and simulated [rad], both of shape (T,), T of each its own.

    In `fit` each channel has its own mean: how far apart the poses of two joints are is no motion.
    """
    error = np.concatenate([measured - simulated for measured, simulated in pairs])
    motion = np.concatenate([measured - measured.mean() for measured, _ in pairs])
    rms, spread = (float(np.sqrt(np.mean(a**2))) for a in (error, motion))
    return ErrorIndices(
        float(np.mean(np.abs(error))),
        rms,
        float(np.max(np.abs(error))),
        100 * (1 - rms / spread) if spread > STILL else float("nan"),
    )
