"""How well a fit reproduces a log: the article's table 9, and what others print beside it."""

from dataclasses import dataclass

import numpy as np

from hydroid.parameters import Array


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
    error = measured - simulated
    spread = np.linalg.norm(measured - measured.mean())
    return ErrorIndices(
        float(np.mean(np.abs(error))),
        float(np.sqrt(np.mean(error**2))),
        float(np.max(np.abs(error))),
        float(100 * (1 - np.linalg.norm(error) / spread)) if spread > 0 else float("nan"),
    )
