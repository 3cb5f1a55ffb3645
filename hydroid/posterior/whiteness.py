"""Whether innovations are white, and owe nothing to the command: else the model errs,
not the sensor.

The error of a joint lasts until the autocorrelation of its innovations, over all logs,
has fallen to 1/e of that between two samples, or below `FAINT`. Of a first-order
process that is its time constant, however much white noise is added. It is said only
where the innovations are not white (G. M. Ljung and G. E. P. Box, 1978), and clearly
so: with thousands of samples the test alone finds what does not matter.

Innovations of a model that takes from a command all that is in it are not correlated
with it at any lag (L. Ljung, *System Identification*, 1999, chapter 16). At negative
lags only a controller would correlate them: there the command answers to the error.
"""

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from hydroid.arrays import Array, record
from hydroid.log import Log
from hydroid.posterior.course import Course
from hydroid.posterior.error_model import ErrorModel
from hydroid.posterior.posterior import NORMAL

LONGEST = 5.0  # lag up to which innovations are compared [s]
LEVEL = 0.01  # probability of the finding where innovations are white
CLEAR = 0.05
"""sum of the squares of the autocorrelations from which innovations are not white for
any use of them"""
FAINT = 0.1  # autocorrelation that counts as none
SHOWN = 3.0  # lag up to which the tests of a residual show correlations [s]


@record
class ResidualTest:
    """Correlations of the innovations of one joint's angle over all logs.

    Attributes:
        lags: between two samples [s], from the first one on, shape (L,).
        autocorrelation: of the innovations at these lags, shape (L,).
        command_lags: from a command to an innovation [s], negative ones too, shape
            (M,).
        with_command: correlation with the joint's own command at these, shape (M,).
        bound: within which 95 % of either lie if nothing is left.
    """

    lags: Array
    autocorrelation: Array
    command_lags: Array
    with_command: Array
    bound: float

    @property
    def outside(self) -> tuple[float, float]:
        """Parts of the autocorrelations, and of the correlations with the command,
        beyond the bound.
        """
        in_time = np.mean(np.abs(self.autocorrelation) > self.bound)
        with_command = np.mean(np.abs(self.with_command) > self.bound)
        return float(in_time), float(with_command)


def residual_tests(
    errors: ErrorModel, innovations: Array, logs: Sequence[Log]
) -> dict[int, ResidualTest]:
    """Return the tests of each joint's angle, by joint (from 1).

    `innovations` are a row of all the channels of the logs, shape (R,).
    """
    tests = dict[int, ResidualTest]()
    for i, signal in enumerate(errors.signals):
        if signal.quantity != "angle":
            continue
        courses = errors.courses_of(i)
        rows = [innovations[course.rows] for course in courses]
        used = list[Array]()
        for course, row in zip(courses, rows, strict=True):
            used.append(row[course.used])
        commands = [log.command_of(signal.joint) for log in logs]
        period = _between(courses)
        lags = _lags(SHOWN, period, used)
        # every sample has a command, whether it counts or not
        steps = _lags(SHOWN, courses[0].period, rows)
        tests[signal.joint] = ResidualTest(
            lags=period * np.arange(1.0, lags + 1),
            autocorrelation=autocorrelation(used, lags),
            command_lags=courses[0].period * np.arange(-steps, steps + 1.0),
            with_command=cross_correlation(rows, commands, steps),
            bound=NORMAL / float(np.sqrt(sum(map(len, used)))),
        )
    return tests


def lasting(errors: ErrorModel, innovations: Array) -> dict[int, float]:
    """Return for how long what is left of each joint's angle error lasts [s], by joint
    (from 1).

    0: white.

    `innovations` are a row, shape (R,).
    """
    result = dict[int, float]()
    for i, signal in enumerate(errors.signals):
        if signal.quantity == "angle":
            result[signal.joint] = _lasting(errors.courses_of(i), innovations)
    return result


def _lasting(courses: list[Course], innovations: Array) -> float:
    """Return for how long what is left of one signal's error lasts [s]."""
    logs = [innovations[course.rows][course.used] for course in courses]
    samples = sum(map(len, logs))
    period = _between(courses)
    lags = _lags(LONGEST, period, logs)
    correlation = autocorrelation(logs, lags)
    square = float(np.sum(correlation**2))
    chance = chi2.sf(samples * square, lags)
    # of many samples even a correlation that nobody minds is certain
    if chance > LEVEL or square < CLEAR:
        return 0.0
    faint = max(FAINT, correlation[0] / np.e)
    below = int(np.flatnonzero(np.append(correlation, 0.0) < faint)[0])
    return period * max(below, 1)


def _between(courses: Sequence[Course]) -> float:
    """Return the mean time between two samples that count [s]."""
    samples = sum(int(np.sum(course.used)) for course in courses)
    duration = sum(course.period * len(course.used) for course in courses)
    return duration / max(samples, 1)


def _lags(longest: float, period: float, logs: Sequence[Array]) -> int:
    """Return how many lags go up to the longest one [s].

    Of short logs, up to a quarter of the shortest.
    """
    shortest = min(map(len, logs))
    # of longer lags too few products are left to mean anything
    wanted = min(round(longest / period), shortest // 4)
    return max(wanted, 1)


def autocorrelation(logs: list[Array], lags: int) -> Array:
    """Return the autocorrelation at lags 1 to `lags` of signals of mean zero, pooled,
    shape (lags,).
    """
    square = sum(float(log @ log) for log in logs)
    products = np.zeros(lags)
    for log in logs:
        for lag in range(1, lags + 1):
            products[lag - 1] += log[lag:] @ log[:-lag]
    return products / max(square, np.finfo(float).tiny)


def cross_correlation(logs: list[Array], causes: list[Array], lags: int) -> Array:
    """Return the correlation of signals with causes `-lags` to `lags` samples before,
    shape (2 lags + 1,).

    The signals have mean zero; each cause is taken without its mean, and all logs count
    together. 0 where a cause never changes.
    """
    products = np.zeros(2 * lags + 1)
    squares = np.zeros(2)
    for log, cause in zip(logs, causes, strict=True):
        change = cause - cause.mean()
        squares += log @ log, change @ change
        for lag in range(lags + 1):
            shared = len(log) - lag
            products[lags + lag] += log[lag:] @ change[:shared]
            # without a lag both would be the same product, which counts once
            if lag:
                products[lags - lag] += log[:shared] @ change[lag:]
    return products / max(np.sqrt(squares.prod()), np.finfo(float).tiny)
