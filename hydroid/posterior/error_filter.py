"""The Kalman filter of one channel's error: sensor's noise, drift and lasting error.

The model of the error, and what each of its NUMBERS is, stand in `error_model`. Its
state has two parts, drift and lasting error. The filter foretells them from the past of
the log. What it did not foretell of a sample is the innovation, which is divided by its
standard deviation. Gains and standard deviations depend on the course alone, so the
filter is a linear map of the errors.

Compiled functions run over the T samples of a course. `gain`, `carry`, `scale` and
`step` are those of a `Filter`.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.optimize import OptimizeResult, minimize

from hydroid.arrays import Array, Mask
from hydroid.posterior.course import Course

NUMBERS = ("sensor", "rate", "way", "lasting", "time")
"""of an error: variance of the sensor's noise [rad²], growth of the drift's variance
with time [rad²/s] and with the way [rad²/rad], variance of the lasting error [rad²],
and its time constant [s]; pressures in Pa"""
SHORTEST = 0.05
"""time constant of a lasting error at least [s]: what is shorter is noise (ours)"""
LONGEST = 30.0
"""time constant of a lasting error at most [s]: what is longer is drift (ours)"""
FIRST_TIME = 0.3
"""time constant of a lasting error with which the search for the numbers begins [s]"""
DIFFERENCE = 1e-7
"""of a logarithm, by which its derivative is taken"""
NONE = 1e-12
"""growth of a drift, as a part of the residual's mean square, that counts as none"""


def noise_and_drift(sensor: float, rate: float = 0.0) -> Array:
    """Return NUMBERS, shape (5,), of noise of a variance, with a drift that grows at a
    rate; nothing lasts."""
    return np.array([sensor, rate, 0.0, 0.0, SHORTEST])


class Filter(NamedTuple):
    """A Kalman filter of one channel: arrays over its T samples.

    Attributes:
        gain: of drift and lasting error, shape (2, T).
        carry: part of each that reaches the next sample, shape (2, T).
        scale: 1 over the standard deviation of the innovation, shape (T,); 0 where a
            sample does not count.
        step: variance of what is added to each before the next sample, shape (2, T).
    """

    gain: Array
    carry: Array
    scale: Array
    step: Array

    def innovations(self, errors: Array) -> Array:
        """Return the innovations [1] of errors, (n, T): 0 where a sample does not
        count."""
        return _innovations(np.ascontiguousarray(errors), *self[:3])

    def errors(self, innovations: Array) -> Array:
        """Return the errors, (n, T), that leave these innovations.

        Of samples that do not count it is what those before foretell.
        """
        return _errors(np.ascontiguousarray(innovations), *self[:3])

    def adjoint(self, rows: Array) -> Array:
        """Return rows that give the same products with errors as `rows`, (p, T), give
        with their innovations."""
        return _adjoint(np.ascontiguousarray(rows), *self[:3])

    def drift_ahead(self, rows: Array) -> Array:
        """Return what a step of the drift at each sample adds to products of errors
        with rows, (p, T)."""
        return _summed_ahead(rows, self.carry[0])

    def lasting_ahead(self, rows: Array) -> Array:
        """Return the same for a step of the lasting error."""
        return _summed_ahead(rows, self.carry[1])

    def unseen_variance(self, start: float) -> Array:
        """Return the variance of drift and lasting error together where nothing is
        measured, (T,).

        The drift begins with a variance `start`.
        """
        drift = _variances(start, self.step[0], self.carry[0])
        lasting = _variances(0.0, self.step[1], self.carry[1])
        return drift + lasting


def make_filter(course: Course, numbers: Array) -> Filter:
    """Return the filter of a course by NUMBERS, shape (5,)."""
    carry, step = _model(course.period, course.way, course.stops, numbers)
    sensor = float(numbers[0])
    start = sensor / course.readings
    gain, scale = _gains(course.used, sensor, start, step, carry)
    return Filter(gain, carry, scale, step)


def whitened(rows: Array, period: float, sensor: float, rate: float) -> Array:
    """Return innovations of rows [rad], (n, T), for a sensor's variance and a drift
    that grows with time."""
    samples = rows.shape[1]
    still = np.zeros(samples)
    course = Course(
        rows=slice(0),
        weight=1.0,
        period=period,
        way=still,
        moved=still,
        stops=np.zeros(samples, dtype=np.bool_),
        readings=np.inf,
        used=np.ones(samples, dtype=np.bool_),
    )
    return make_filter(course, noise_and_drift(sensor, rate)).innovations(rows)


Pairs = Sequence[tuple[Course, Array]]
"""courses of one signal, each with its errors, (T,)"""


def most_likely(
    pairs: Pairs, least: float, given: float, start: Array | None = None
) -> Array:
    """Return the most likely NUMBERS of one signal's errors.

    `least` is the smallest variance of the sensor's noise; where it is `given`, it is
    that (NaN: it is not). The search is over logarithms. It begins at `start`; None: at
    a guess that is mostly noise, and at one that is mostly drift.
    """
    square = max(mean_square(pairs), least)
    bounds = np.log(_bounds(square, least, given))

    def cost(logarithms: Array) -> tuple[float, Array]:
        total = np.zeros(len(logarithms) + 1)
        for course, error in pairs:
            total += _cost_and_slopes(course, error, logarithms)
        return total[0], total[1:]

    starts = _guesses(pairs, square) if start is None else (start,)
    options = {"maxiter": 60, "ftol": 1e-6}  # of a log-likelihood in the thousands
    ended = list[OptimizeResult]()
    for numbers in starts:
        # a number may be 0, which has no logarithm
        begin = np.clip(np.log(np.maximum(numbers, 1e-300)), *bounds.T)
        result = minimize(
            cost, begin, method="L-BFGS-B", jac=True, bounds=bounds, options=options
        )
        ended.append(result)
    best = min(ended, key=lambda result: result.fun)
    return np.exp(best.x)


def _cost_and_slopes(course: Course, error: Array, logarithms: Array) -> Array:
    """Return the cost of an error, (T,), at logarithms of NUMBERS, (5,), and its
    derivatives by them, in one array of shape (6,)."""
    numbers = _around(logarithms)
    carry, step = _models(course.period, course.way, course.stops, numbers)
    sensor = numbers[:, 0].copy()
    start = sensor / course.readings
    costs = _costs(error, course.used, sensor, start, step, carry)
    costs[1:] = (costs[1:] - costs[0]) / DIFFERENCE
    return costs


def _bounds(square: float, least: float, given: float) -> Array:
    """Return the bounds of NUMBERS, shape (5, 2), for errors of a mean square; the
    others are arguments of `most_likely`."""
    none = NONE * square
    lower = np.array([least, none, none, none, SHORTEST])
    upper = np.array([square * 4, square * 100, square * 1e4, square * 4, LONGEST])
    if np.isfinite(given):
        lower[0] = given
        upper[0] = given
    return np.stack([lower, upper], axis=1)


def _guesses(pairs: Pairs, square: float) -> tuple[Array, Array]:
    """Return NUMBERS that are mostly noise, and NUMBERS that are mostly drift, for
    errors of a mean square."""
    seconds = sum(course.period * len(error) for course, error in pairs) / len(pairs)
    ways = [float(course.way.sum()) for course, _ in pairs]
    # a joint may stand still
    way = max(sum(ways) / len(pairs), 1e-3)
    steady = np.array([0.5, 0.1 / seconds, 0.1 / way, 0.1, 0.0]) * square
    drifting = np.array([1e-3, 10 / seconds, 10 / way, 1e-2, 0.0]) * square
    # the last number is a time, not a part of the mean square
    steady[4] = FIRST_TIME
    drifting[4] = FIRST_TIME
    return steady, drifting


def mean_square(pairs: Pairs) -> float:
    """Return the mean square of one signal's errors, over the samples that count."""
    used = np.concatenate([error[course.used] for course, error in pairs])
    return float(np.mean(used**2))


@njit(cache=True)
def _model(
    period: float, way: Array, stops: Mask, numbers: Array
) -> tuple[Array, Array]:
    """Carry and step of drift and lasting error, by `Filter`: both end where the joint
    stands at a stop then."""
    samples = len(way)
    kept = np.exp(-period / numbers[4])
    carry = np.empty((2, samples))
    step = np.empty((2, samples))
    for k in range(samples):
        goes_on = 1.0
        if k + 1 < samples and stops[k + 1]:
            goes_on = 0.0
        carry[0, k] = goes_on
        carry[1, k] = goes_on * kept
        step[0, k] = numbers[1] * period + numbers[2] * way[k]
        # it is added as much as is forgotten, so that the variance stays as it is
        step[1, k] = numbers[3] * (1.0 - kept**2)
    return carry, step


@njit(cache=True)
def _gains(
    used: Mask, sensor: float, start: float, step: Array, carry: Array
) -> tuple[Array, Array]:
    """Kalman gains, (2, T), and 1 over the standard deviation of the innovations, (T,);
    0 if not used."""
    samples = len(used)
    gain = np.zeros((2, samples))
    scale = np.zeros(samples)
    # variances of what is not known of drift and lasting error, and their covariance
    drift_variance = start
    lasting_variance = 0.0
    covariance = 0.0
    for k in range(samples):
        if used[k]:
            total = drift_variance + 2.0 * covariance + lasting_variance + sensor
            first = (drift_variance + covariance) / total
            second = (lasting_variance + covariance) / total
            gain[0, k] = first
            gain[1, k] = second
            scale[k] = 1.0 / np.sqrt(total)
            drift_variance -= first * first * total
            lasting_variance -= second * second * total
            covariance -= first * second * total
        if carry[0, k] > 0.0:
            drift_variance += step[0, k]
            lasting_variance = carry[1, k] ** 2 * lasting_variance + step[1, k]
            covariance *= carry[1, k]
        else:  # at a stop nothing is added either
            drift_variance = 0.0
            lasting_variance = 0.0
            covariance = 0.0
    return gain, scale


@njit(cache=True)
def _innovations(errors: Array, gain: Array, carry: Array, scale: Array) -> Array:
    """Innovations over their standard deviation, (n, T), of errors, (n, T)."""
    result = np.empty_like(errors)
    for i in range(len(errors)):
        drift = 0.0
        lasting = 0.0
        for k in range(errors.shape[1]):
            new = errors[i, k] - drift - lasting
            result[i, k] = new * scale[k]
            drift = carry[0, k] * (drift + gain[0, k] * new)
            lasting = carry[1, k] * (lasting + gain[1, k] * new)
    return result


@njit(cache=True)
def _errors(innovations: Array, gain: Array, carry: Array, scale: Array) -> Array:
    """The errors, (n, T), that leave these innovations, (n, T)."""
    result = np.empty_like(innovations)
    for i in range(len(innovations)):
        drift = 0.0
        lasting = 0.0
        for k in range(innovations.shape[1]):
            new = 0.0
            if scale[k] > 0.0:
                new = innovations[i, k] / scale[k]
            result[i, k] = new + drift + lasting
            drift = carry[0, k] * (drift + gain[0, k] * new)
            lasting = carry[1, k] * (lasting + gain[1, k] * new)
    return result


@njit(cache=True)
def _adjoint(rows: Array, gain: Array, carry: Array, scale: Array) -> Array:
    """`_innovations` transposed: the same recursion from the last sample to the
    first."""
    result = np.empty_like(rows)
    for i in range(len(rows)):
        drift = 0.0
        lasting = 0.0
        for k in range(rows.shape[1] - 1, -1, -1):
            of_drift = carry[0, k] * gain[0, k] * drift
            of_lasting = carry[1, k] * gain[1, k] * lasting
            new = scale[k] * rows[i, k] + (of_drift + of_lasting)
            result[i, k] = new
            drift = carry[0, k] * drift - new
            lasting = carry[1, k] * lasting - new
    return result


@njit(cache=True)
def _costs(
    error: Array, used: Mask, sensor: Array, start: Array, step: Array, carry: Array
) -> Array:
    """Negative log-likelihoods of an error, (T,), but for a constant, by n filters,
    (n,).

    `_gains` and `_innovations` in one pass, which a search for the numbers repeats some
    hundred times. `step` and `carry` are (n, 2, T). The filters take each sample
    together: they do not wait for one another's divisions.
    """
    count = len(sensor)
    drift_variance = start.copy()
    lasting_variance = np.zeros(count)
    covariance = np.zeros(count)
    drift = np.zeros(count)
    lasting = np.zeros(count)
    cost = np.zeros(count)
    for k in range(len(error)):
        for i in range(count):
            if used[k]:
                both = covariance[i]
                to_drift = drift_variance[i] + both
                to_lasting = lasting_variance[i] + both
                total = to_drift + to_lasting + sensor[i]
                new = error[k] - drift[i] - lasting[i]
                cost[i] += 0.5 * (new * new / total + np.log(total))
                first = to_drift / total
                second = to_lasting / total
                drift[i] += first * new
                lasting[i] += second * new
                drift_variance[i] -= first * to_drift
                lasting_variance[i] -= second * to_lasting
                covariance[i] -= first * to_lasting
            kept = carry[i, 1, k]
            if carry[i, 0, k] > 0.0:
                drift_variance[i] += step[i, 0, k]
                lasting_variance[i] = kept**2 * lasting_variance[i] + step[i, 1, k]
                covariance[i] *= kept
            else:
                drift_variance[i] = 0.0
                lasting_variance[i] = 0.0
                covariance[i] = 0.0
            drift[i] *= carry[i, 0, k]
            lasting[i] *= kept
    return cost


@njit(cache=True)
def _around(logarithms: Array) -> Array:
    """NUMBERS at their logarithms, (5,), and with each of these changed by DIFFERENCE,
    (6, 5)."""
    numbers = np.empty((len(logarithms) + 1, len(logarithms)))
    for i in range(len(numbers)):
        changed = logarithms.copy()
        if i > 0:
            changed[i - 1] += DIFFERENCE
        numbers[i] = np.exp(changed)
    return numbers


@njit(cache=True)
def _models(
    period: float, way: Array, stops: Mask, numbers: Array
) -> tuple[Array, Array]:
    """What `_model` returns, for n sets of NUMBERS, (n, 5): each of shape (n, 2, T)."""
    carry = np.empty((len(numbers), 2, len(way)))
    step = np.empty((len(numbers), 2, len(way)))
    for i in range(len(numbers)):
        carry[i], step[i] = _model(period, way, stops, numbers[i])
    return carry, step


@njit(cache=True)
def _variances(start: float, step: Array, carry: Array) -> Array:
    """Variance of drift or lasting error where nothing is measured, (T,)."""
    result = np.empty(len(step))
    variance = start
    for k in range(len(step)):
        result[k] = variance
        # nothing outlasts a stop, and nothing is added there
        after = 0.0
        if carry[k] > 0.0:
            after = carry[k] ** 2 * variance + step[k]
        variance = after
    return result


@njit(cache=True)
def _summed_ahead(rows: Array, carry: Array) -> Array:
    """What an error of 1 at each sample adds to products with rows, (p, T): sums of all
    that it reaches."""
    result = np.empty_like(rows)
    for i in range(len(rows)):
        total = 0.0
        for k in range(rows.shape[1] - 1, -1, -1):
            total = rows[i, k] + carry[k] * total
            result[i, k] = total
    return result
