"""Whether innovations are white: what else is left of an error is the model's, not the sensor's.

The error of a joint lasts until the autocorrelation of its innovations, over all logs, has fallen to 1/e of
that between two samples, or below `FAINT`. Of a first-order process that is its time constant, however
much white
noise is added. It is said only where the innovations are not white (G. M. Ljung and G. E. P. Box, 1978), and
clearly so: with thousands of samples the test alone finds what does not matter.
"""

import numpy as np
from scipy.stats import chi2

from hydroid.arrays import Array
from hydroid.posterior.error_model import Course, ErrorModel

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
        if signal.quantity == "angle":
            courses = [course for course, own in zip(errors.courses, errors.of, strict=True) if own == i]
            result[signal.joint] = _lasting(courses, innovations)
    return result


def _lasting(courses: list[Course], innovations: Array) -> float:
    """Return for how long what is left of one signal's error lasts [s]."""
    logs = [innovations[course.rows][course.used] for course in courses]
    samples, shortest = sum(map(len, logs)), min(map(len, logs))
    # between those that count
    period = sum(course.period * len(course.used) for course in courses) / max(samples, 1)
    lags = max(min(round(LONGEST / period), shortest // 4), 1)
    correlation = autocorrelation(logs, lags)
    square = float(np.sum(correlation**2))
    if chi2.sf(samples * square, lags) > LEVEL or square < CLEAR:
        return 0.0
    faint = max(FAINT, correlation[0] / np.e)
    below = int(np.flatnonzero(np.append(correlation, 0.0) < faint)[0])
    return period * max(below, 1)


def autocorrelation(logs: list[Array], lags: int) -> Array:
    """Return the autocorrelation at lags 1 to `lags` of signals of mean zero, pooled, shape (lags,)."""
    square = sum(float(log @ log) for log in logs)
    products = [sum(float(log[lag:] @ log[:-lag]) for log in logs) for lag in range(1, lags + 1)]
    return np.array(products) / max(square, np.finfo(float).tiny)
