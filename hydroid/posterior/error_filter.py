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
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from scipy.optimize import lsq_linear

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
NONE = 1e-12
"""growth of a drift, as a part of the residual's mean square, that counts as none"""
STEPS = 60
"""steps of the search for the numbers at most"""
LONGEST_STEP = 2.0
"""change of the logarithm of a number in one step at most"""
ENOUGH = 1e-3
"""gain of the log-likelihood below which the search for the numbers ends"""
SETTLED = 1.0
"""gain of the log-likelihood below which one set of numbers is as good as another"""
DAMPING = 1e-3
"""of the first step of the search for the numbers"""
MOST_DAMPING = 1e6
"""of a step that is too short to gain anything"""


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
        return _innovations(np.ascontiguousarray(errors), *self)

    def errors(self, innovations: Array) -> Array:
        """Return the errors, (n, T), that leave these innovations.

        Of samples that do not count it is what those before foretell.
        """
        return _errors(np.ascontiguousarray(innovations), *self)

    def adjoint(self, rows: Array) -> Array:
        """Return rows that give the same products with errors as `rows`, (p, T), give
        with their innovations."""
        return _adjoint(np.ascontiguousarray(rows), *self)

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
    carry, step = _model(course, numbers)
    sensor = float(numbers[0])
    start = sensor / course.readings
    gain, scale = _gains(course.used, sensor, start, step, carry)
    return Filter(gain, carry, scale, step)


def _model(course: Course, numbers: Array) -> tuple[Array, Array]:
    """Return carry and step of drift and lasting error: both end where the joint stands
    at a stop then."""
    _, rate, way, lasting, time = numbers.tolist()
    samples = len(course.way)
    kept = np.exp(-course.period / time)
    carry = np.ones((2, samples))
    carry[1] = kept
    before_stop = np.append(course.stops[1:], False)
    carry[:, before_stop] = 0.0
    step = np.empty((2, samples))
    step[0] = rate * course.period + way * course.way
    # it is added as much as is forgotten, so that the variance stays as it is
    step[1] = lasting * (1.0 - kept**2)
    return carry, step


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
    a guess that is mostly noise, and at one that is mostly drift, which must end at
    clearly likelier numbers: logs tell less where errors drift.
    """
    square = max(mean_square(pairs), least)
    bounds = np.log(_bounds(square, least, given))
    starts = _guesses(pairs, square) if start is None else (start,)
    ends = list[_Scored]()
    for numbers in starts:
        # a number may be 0, which has no logarithm
        begin = np.log(np.maximum(numbers, 1e-300))
        ends.append(_by_scoring(pairs, np.clip(begin, *bounds.T), bounds))
    best = ends[0]
    for other in ends[1:]:
        if other.cost < best.cost - SETTLED:
            best = other
    return np.exp(best.logarithms)


class _Scored(NamedTuple):
    """Logarithms of NUMBERS, shape (5,), with the negative log-likelihood there, its
    gradient, (5,), and the expected information, (5, 5)."""

    logarithms: Array
    cost: float
    gradient: Array
    information: Array


def _by_scoring(pairs: Pairs, begin: Array, bounds: Array) -> _Scored:
    """Return the most likely numbers near `begin`, (5,), within bounds, (5, 2), all of
    them logarithms.

    Fisher's scoring: Newton's steps with the expected information in place of the
    second derivatives (A. C. Harvey, *Forecasting, Structural Time Series Models and
    the Kalman Filter*, 1989, section 3.4), damped as in Levenberg-Marquardt's method.
    """
    now = _scored(pairs, begin)
    damping = DAMPING
    for _ in range(STEPS):
        step = _scoring_step(now, bounds, damping)
        after = _scored(pairs, np.clip(now.logarithms + step, *bounds.T))
        gain = now.cost - after.cost
        if gain > 0.0:
            now = after
            damping = max(0.1 * damping, DAMPING)
            if gain < ENOUGH:
                break
        else:
            damping *= 10.0
            if damping > MOST_DAMPING:
                break
    return now


def _scoring_step(now: _Scored, bounds: Array, damping: float) -> Array:
    """Return the damped step within the bounds, (5, 2), and within LONGEST_STEP."""
    diagonal = np.diagonal(now.information)
    # a number without effect would have no step that is best
    least = np.finfo(float).eps * diagonal.max() + np.finfo(float).tiny
    damped = now.information + np.diag(damping * diagonal + least)
    # |L' s + L⁻¹ g|² is twice the quadratic model, but for a constant
    factor = np.linalg.cholesky(damped)
    target = -np.linalg.solve(factor, now.gradient)
    lower = np.maximum(bounds[:, 0] - now.logarithms, -LONGEST_STEP)
    upper = np.minimum(bounds[:, 1] - now.logarithms, LONGEST_STEP)
    free = upper > lower
    step = np.zeros(len(free))
    limits = (lower[free], upper[free])
    step[free] = lsq_linear(factor.T[:, free], target, limits, method="bvls").x
    return step


def _scored(pairs: Pairs, logarithms: Array) -> _Scored:
    """Return the negative log-likelihood of the errors of all pairs, and how it
    changes."""
    cost = 0.0
    gradient = np.zeros(len(NUMBERS))
    information = np.zeros((len(NUMBERS), len(NUMBERS)))
    numbers = np.exp(logarithms)
    for course, error in pairs:
        times = (course.used, course.stops, course.way, course.period, course.readings)
        of_one = _score(error, times, numbers)
        cost += of_one[0]
        gradient += of_one[1]
        information += of_one[2]
    return _Scored(logarithms, cost, gradient, information)


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
def _innovations(
    errors: Array, gain: Array, carry: Array, scale: Array, step: Array
) -> Array:
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
def _errors(
    innovations: Array, gain: Array, carry: Array, scale: Array, step: Array
) -> Array:
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
def _adjoint(
    rows: Array, gain: Array, carry: Array, scale: Array, step: Array
) -> Array:
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
def _score(error: Array, times: Any, numbers: Array) -> tuple[float, Array, Array]:
    """Negative log-likelihood of an error, (T,), but for a constant; its gradient by the
    logarithms of NUMBERS, (5,); the expected information on these, (5, 5).

    `times` are used, stops, way, period and readings of a course. It is `_gains` and
    `_innovations` in one pass, with their derivatives: `of_` is by each logarithm.
    """
    used, stops, way, period, readings = times
    gradient = np.zeros(len(numbers))
    information = np.zeros((len(numbers), len(numbers)))
    count = len(numbers)
    sensor, rate, per_way, lasting_level, time = numbers
    kept = np.exp(-period / time)
    of_kept = kept * period / time
    lasting_step = lasting_level * (1.0 - kept**2)
    drift_variance = sensor / readings
    lasting_variance = 0.0
    covariance = 0.0
    drift = 0.0
    lasting = 0.0
    of_drift_variance = np.zeros(count)
    of_lasting_variance = np.zeros(count)
    of_covariance = np.zeros(count)
    of_drift = np.zeros(count)
    of_lasting = np.zeros(count)
    of_total = np.zeros(count)
    of_new = np.zeros(count)
    of_drift_variance[0] = drift_variance
    cost = 0.0
    for k in range(len(error)):
        if used[k]:
            with_drift = drift_variance + covariance
            with_lasting = lasting_variance + covariance
            total = with_drift + with_lasting + sensor
            new = error[k] - drift - lasting
            cost += 0.5 * (new * new / total + np.log(total))
            first = with_drift / total
            second = with_lasting / total
            shrinks = 0.5 * (1.0 - new * new / total) / total
            for i in range(count):
                of_with_drift = of_drift_variance[i] + of_covariance[i]
                of_with_lasting = of_lasting_variance[i] + of_covariance[i]
                by = of_with_drift + of_with_lasting
                if i == 0:
                    by += sensor
                of_total[i] = by
                changes = -of_drift[i] - of_lasting[i]
                of_new[i] = changes
                gradient[i] += new / total * changes + shrinks * by
                of_first = (of_with_drift - first * by) / total
                of_second = (of_with_lasting - second * by) / total
                of_drift[i] += of_first * new + first * changes
                of_lasting[i] += of_second * new + second * changes
                of_drift_variance[i] -= first * (2.0 * of_with_drift - first * by)
                of_lasting_variance[i] -= second * (2.0 * of_with_lasting - second * by)
                of_covariance[i] -= (
                    second * of_with_drift
                    + first * of_with_lasting
                    - first * second * by
                )
            half = 0.5 / total**2
            for i in range(count):
                for j in range(i + 1):
                    information[i, j] += (
                        of_new[i] * of_new[j] / total + half * of_total[i] * of_total[j]
                    )
            drift += first * new
            lasting += second * new
            drift_variance -= first * with_drift
            lasting_variance -= second * with_lasting
            covariance -= first * with_lasting
        if k + 1 < len(error) and stops[k + 1]:
            # nothing outlasts a stop, and nothing is added there
            drift_variance = 0.0
            lasting_variance = 0.0
            covariance = 0.0
            drift = 0.0
            lasting = 0.0
            of_drift_variance[:] = 0.0
            of_lasting_variance[:] = 0.0
            of_covariance[:] = 0.0
            of_drift[:] = 0.0
            of_lasting[:] = 0.0
            continue
        for i in range(count):
            of_lasting_variance[i] *= kept**2
            of_covariance[i] *= kept
            of_lasting[i] *= kept
        of_drift_variance[1] += rate * period
        of_drift_variance[2] += per_way * way[k]
        of_lasting_variance[3] += lasting_step
        of_lasting_variance[4] += (
            2.0 * kept * of_kept * (lasting_variance - lasting_level)
        )
        of_covariance[4] += of_kept * covariance
        of_lasting[4] += of_kept * lasting
        drift_variance += rate * period + per_way * way[k]
        lasting_variance = kept**2 * lasting_variance + lasting_step
        covariance *= kept
        lasting *= kept
    for i in range(count):
        for j in range(i):
            information[j, i] = information[i, j]
    return cost, gradient, information


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
