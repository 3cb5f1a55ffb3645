"""Whether innovations are white: what else is left of an error is the model's, not the sensor's or the drift's.

A time in which the error of a joint lasts is that until the autocorrelation of its innovations, over all logs,
has fallen below `FAINT`. It is said only where the innovations are not white (G. M. Ljung and G. E. P. Box,
1978), and clearly so: with thousands of samples the test alone finds what does not matter.
"""

import numpy as np
from scipy.stats import chi2

from hydroid.arrays import Array
from hydroid.posterior.error_model import ErrorModel

LONGEST = 5.0  # lag up to which innovations are compared [s]
LEVEL = 0.01  # probability of the finding where innovations are white
CLEAR = 0.05
"""sum of the squares of the autocorrelations from which innovations are not white for any use of them"""
FAINT = 0.1  # autocorrelation that counts as none


def lasting(errors: ErrorModel, innovations: Array) -> dict[int, float]:
    """Return for how long what is left of each joint's angle error lasts [s], by joint (from 1); 0: white.

    `innovations` are a row, shape (R,).
    """
    result = dict[int, float]()
    for i, signal in enumerate(errors.signals):
        if signal.quantity != "angle":
            continue
        of_signal = [c for c, own in zip(errors.courses, errors.of, strict=True) if own == i]
        period = of_signal[0].period
        logs = [innovations[course.rows][course.used] for course in of_signal]
        shortest = min(map(len, logs))
        lags = max(min(round(LONGEST / period), shortest // 4), 1)
        correlation = autocorrelation(logs, lags)
        samples = sum(map(len, logs))
        statistic = samples * float(np.sum(correlation**2))
        white = chi2.sf(statistic, lags) > LEVEL or np.sum(correlation**2) < CLEAR
        below = np.flatnonzero(np.append(correlation, 0.0) < FAINT)
        result[signal.joint] = 0.0 if white else period * float(below[0])
    return result


def autocorrelation(logs: list[Array], lags: int) -> Array:
    """Return the autocorrelation at lags 1 to `lags` of signals of mean zero, pooled, shape (lags,)."""
    square = sum(float(log @ log) for log in logs)
    products = [sum(float(log[lag:] @ log[:-lag]) for log in logs) for lag in range(1, lags + 1)]
    return np.array(products) / max(square, np.finfo(float).tiny)
