"""The error of a model: the sensor's noise, and a drift that grows with time and with the way travelled.

A joint on a valve integrates. A command that changes between two samples, oil that warms, a spool that sticks:
each moves all that follows in a log by a little. So what a perfect model leaves of a measured signal y is not
white noise but

    y_k = ŷ_k(θ) + d_k + v_k,    d_{k+1} = φ d_k + w_k,
    Var v = σ²,    Var w_k = (rate) h + (way) |Δy_k|,    φ = exp(-h / relaxation),

the local-level model (A. C. Harvey, *Forecasting, Structural Time Series Models and the Kalman Filter*, 1989),
whose drift d starts as uncertain as the start angle, and is 0 where the joint stands at a stop. Its four
numbers are those of a joint's angle, or of a chamber's pressure, in all logs. They follow from the residual by
maximum likelihood.

A scalar Kalman filter turns the residual into *innovations*: what the past of the log does not foretell of
each sample (L. Ljung, *System Identification*, 1999, chapters 3, 7 and 14). Divided by their standard
deviation they are white with variance 1. The filter's gain depends on the measured way, not on θ: the filter
is a linear map of the residual, and least squares of innovations is maximum likelihood.

Stage 1 puts a gain in place of the hydraulics, and the article fits it by output errors. Its least squares
weighs them as white noise (`ErrorModel.white`); its covariance is that of the errors as they are.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.ndimage import binary_erosion
from scipy.optimize import minimize

from hydroid.arrays import Array, Mask, record
from hydroid.log import Log
from hydroid.problem.channels import Channel
from hydroid.problem.problem import Problem

NUMBERS = ("sensor", "rate", "way", "relaxation")
"""of an error: variance of the sensor's noise [rad²], growth of the drift's variance with time [rad²/s] and
with the way travelled [rad²/rad], and the time in which the drift is forgotten [s]; pressures in Pa for rad"""
LEAST_NOISE = {"angle": np.deg2rad(0.01), "pressure_a": 1e4, "pressure_b": 1e4}
"""smallest standard deviation of a sensor's noise that a residual can show [rad, Pa]: no potentiometer or
gauge is better (ours)"""
LONGEST = 1e4
"""relaxation of a drift that is never forgotten [s]"""
SHORTEST = 0.05
"""shortest relaxation of a drift [s]: what is forgotten sooner is noise"""
NONE = 1e-12
"""growth of a drift, as a part of the residual's mean square, that counts as none"""
WAY_OVER = 0.25
"""time over which a way is measured [s]: the sensor's noise is no way"""
AT_STOP = 0.002
"""part of a joint's range within which it stands at the end of it"""


class Signal(NamedTuple):
    """What an error model describes: the angle or a pressure of a joint (number, from 1), in all logs."""

    joint: int
    quantity: str


@record
class Course:
    """One channel's times as its error sees them: the same for all parameters of the model.

    Attributes:
        rows: of the channel in a row of all channels' residuals.
        weight: of the channel's errors.
        period: between samples [s].
        way: travelled from each sample to the next [rad], shape (T,).
        stops: whether the joint stands at an end of its range, shape (T,).
        readings: of which the start angle is the mean; inf where it is taken for exact.
        used: samples that count, shape (T,); of the others nothing is taken to be measured.
    """

    rows: slice
    weight: float
    period: float
    way: Array
    stops: Mask
    readings: float
    used: Mask


def make_course(channel: Channel, log: Log, problem: Problem) -> Course:
    """Return the course of a channel of a problem, which compares `log`."""
    joint = channel.joint - 1
    stops = np.zeros(len(channel.measured), dtype=bool)
    readings = np.inf
    if channel.quantity == "angle":
        ends = [*problem.settings.arm.ranges.values()][joint]
        stops = at_stops(channel.measured, ends, log.period)
        if channel.joint in problem.started(log) and problem.settings.free_start:
            readings = max(float(log.start_samples[joint]), 1.0)
    way = travelled(channel.measured, log.period)
    used = np.ones(len(way), dtype=bool) if log.recorded is None else log.recorded
    return Course(channel.rows, channel.weight, log.period, way, stops, readings, used)


def travelled(signal: Array, period: float) -> Array:
    """Return the way of a signal, (T,), from each sample to the next, without the noise of single samples."""
    half = max(round(0.5 * WAY_OVER / period), 1)
    padded = np.pad(signal, half, mode="edge")
    return np.abs(padded[2 * half :] - padded[: -2 * half]) / (2 * half)


def at_stops(angle: Array, ends: tuple[float, float], period: float) -> Mask:
    """Return where angles [rad], (T,), rest at an end of a joint's range, which may be infinite.

    A joint that turns back at once has not been at its stop.
    """
    lower, upper = ends
    margin = AT_STOP * (upper - lower)
    if not np.isfinite(margin):
        return np.zeros(len(angle), dtype=bool)
    there = (angle < lower + margin) | (angle > upper - margin)
    window = 2 * max(round(0.5 * WAY_OVER / period), 1) + 1
    return np.asarray(binary_erosion(there, np.ones(window, dtype=bool), border_value=1))


@record
class ErrorModel:
    """The errors of the channels of a problem.

    Attributes:
        signals: S different ones.
        numbers: NUMBERS of each, shape (S, 4).
        courses: of each channel.
        of: the index of each channel's signal.
        given: whether the settings give the sensor's noise, shape (S,).
        stays: whether the drift is never forgotten, shape (S,).
    """

    signals: tuple[Signal, ...]
    numbers: Array
    courses: tuple[Course, ...]
    of: tuple[int, ...]
    given: Mask
    stays: Mask

    @cached_property
    def _filters(self) -> list[tuple[Array, Array, Array]]:
        """Gain, carry and scale of each channel's filter, each of shape (T,)."""
        return [_filter(course, self.numbers[i]) for course, i in zip(self.courses, self.of, strict=True)]

    def innovations(self, errors: Array) -> Array:
        """Return the innovations [1] of weighted output errors, (n, R): 0 where a sample does not count."""
        result = np.empty(errors.shape)
        for course, (gain, carry, scale) in zip(self.courses, self._filters, strict=True):
            part = np.ascontiguousarray(errors[:, course.rows]) / course.weight
            result[:, course.rows] = _innovations(part, gain, carry, scale)
        return result

    def errors(self, innovations: Array) -> Array:
        """Return the weighted output errors, (n, R), that leave these innovations.

        Of samples that do not count it is the drift that those before foretell.
        """
        result = np.empty(innovations.shape)
        for course, (gain, carry, scale) in zip(self.courses, self._filters, strict=True):
            part = np.ascontiguousarray(innovations[:, course.rows])
            result[:, course.rows] = course.weight * _errors(part, gain, carry, scale)
        return result

    @cached_property
    def used(self) -> Mask:
        """Samples that count, shape (R,)."""
        return np.concatenate([course.used for course in self.courses])

    def without(self, samples: Mask) -> "ErrorModel":
        """Return the model of the same errors if some samples, (R,), had not been measured."""
        courses = [replace(one, used=one.used & ~samples[one.rows]) for one in self.courses]
        return replace(self, courses=tuple(courses))

    @cached_property
    def log_scale(self) -> Array:
        """Logarithm of each sample's density at an innovation of 0, shape (R,); 0 where it does not count."""
        scales = np.concatenate([scale for _, _, scale in self._filters])
        scales[~self.used] = 1.0
        return np.where(self.used, np.log(scales) - 0.5 * np.log(2 * np.pi), 0.0)

    def log_density(self, innovations: Array) -> Array:
        """Return the logarithm of each sample's predictive density, from a row of innovations, shape (R,)."""
        return self.log_scale - 0.5 * innovations**2

    def estimated(self, errors: Array) -> "ErrorModel":
        """Return the error model whose numbers make weighted output errors, (R,), most likely."""
        numbers = self.numbers.copy()
        for i, signal in enumerate(self.signals):
            pairs = [
                (course, errors[course.rows] / course.weight)
                for course, own in zip(self.courses, self.of, strict=True)
                if own == i
            ]
            least = LEAST_NOISE[signal.quantity] ** 2
            held = np.array([self.given[i], False, False, self.stays[i]])
            numbers[i] = _most_likely(pairs, self.numbers[i], least, held)
        return replace(self, numbers=numbers)

    def white(self, errors: Array) -> "ErrorModel":
        """Return the model that takes errors, (R,), for white noise alone, but for the starts."""
        numbers = np.zeros_like(self.numbers)
        numbers[:, 3] = LONGEST
        for i, signal in enumerate(self.signals):
            parts = [
                errors[course.rows][course.used] / course.weight
                for course, own in zip(self.courses, self.of, strict=True)
                if own == i
            ]
            shown = float(np.mean(np.concatenate(parts) ** 2))
            numbers[i, 0] = self.numbers[i, 0] if self.given[i] else max(shown, LEAST_NOISE[signal.quantity] ** 2)
        return replace(self, numbers=numbers)

    def scatter(self, channel: int, rows: Array, fitted: "ErrorModel") -> Array:
        """Covariance of `rows` times a channel's innovations, shape (p, p), where its errors are as here.

        The innovations are those by the model that was `fitted`; `rows`, (p, T), are of the channel.
        """
        course, i = self.courses[channel], self.of[channel]
        sensor, rate, way, relaxation = self.numbers[i]
        gain, carry, scale = fitted._filters[channel]
        on_errors = _adjoint(np.ascontiguousarray(rows), gain, carry, scale)
        # the errors are sensor's noise, steps of the drift, and the start: each reaches what comes after it
        carry = _carry(course, relaxation)
        ahead = _summed_ahead(on_errors, carry)
        step = np.sqrt(rate * course.period + way * course.way)
        later = ahead[:, 1:] * np.where(course.stops[1:], 0.0, step[:-1])
        start = ahead[:, :1] * np.sqrt(sensor / course.readings)
        parts = np.hstack([np.sqrt(sensor) * on_errors, later, start])
        return parts @ parts.T

    def drift(self, course: Course, i: int) -> Array:
        """Return the variance of signal i's drift from the start of a course on [rad², Pa²], shape (T,)."""
        sensor, rate, way, relaxation = self.numbers[i]
        step = rate * course.period + way * course.way
        return _variances(sensor / course.readings, step, _carry(course, relaxation))


def make_error_model(problem: Problem) -> ErrorModel:
    """Return an error model of a problem without drift, whose numbers are still to be estimated."""
    channels, logs, objective = problem.channels, problem.logs, problem.settings.objective
    of_channel = [Signal(channel.joint, channel.quantity) for channel in channels]
    signals = tuple(dict.fromkeys(of_channel))
    numbers = np.zeros((len(signals), len(NUMBERS)))
    noises = [objective.noise_of(s.joint) if s.quantity == "angle" else None for s in signals]
    # a hydraulic joint integrates; a pressure, or a joint on a gain and a spring, does not
    stays = [s.quantity == "angle" and problem.settings.stage == "hyd" for s in signals]
    for i, signal in enumerate(signals):
        noise = noises[i]
        numbers[i, 0] = LEAST_NOISE[signal.quantity] ** 2 if noise is None else np.deg2rad(noise) ** 2
        numbers[i, 3] = LONGEST
    courses = tuple(make_course(channel, logs[channel.log], problem) for channel in channels)
    given = np.array([noise is not None for noise in noises])
    of = tuple(map(signals.index, of_channel))
    return ErrorModel(signals, numbers, courses, of, given, np.array(stays))


@record
class Likelihood:
    """What least squares minimises: innovations and the priors' scores, all of variance 1.

    Attributes:
        problem: whose output errors these are.
        errors: the model of these errors.
    """

    problem: Problem
    errors: ErrorModel

    def innovations(self, theta: Array) -> Array:
        """Return innovations [1] of theta, shape (n, P): (n, R); NaN where a simulation diverged."""
        return self.errors.innovations(self.problem.output_errors(theta))

    def rows(self, theta: Array) -> Array:
        """Return innovations and the M priors' scores, (n, R + M)."""
        return np.hstack([self.innovations(theta), self.problem.priors.scores(theta)])

    def negative_log(self, rows: Array) -> float:
        """Return the negative logarithm of likelihood and priors, from a row of `rows`, but for a constant."""
        return 0.5 * float(rows @ rows) - float(self.errors.log_scale.sum())

    def estimated(self, errors: Array) -> "Likelihood":
        """Return the likelihood for what weighted output errors, (R,), show of their model.

        Stage 1 takes them for white noise: it is fitted by output errors, as in the article.
        """
        drifts = self.problem.settings.stage == "hyd"
        model = self.errors.estimated(errors) if drifts else self.errors.white(errors)
        return replace(self, errors=model)


def make_likelihood(problem: Problem) -> Likelihood:
    """Return the likelihood of a problem whose errors are still to be estimated."""
    return Likelihood(problem, make_error_model(problem))


def likelihood_at(problem: Problem, theta: Array, numbers: Array | None = None) -> Likelihood:
    """Return the likelihood of a problem with the errors that it shows at theta, shape (P,).

    With `numbers`, (S, 4), these are taken.
    """
    likelihood = make_likelihood(problem)
    if numbers is not None:
        return replace(likelihood, errors=replace(likelihood.errors, numbers=numbers))
    return likelihood.estimated(problem.output_errors(theta[None])[0])


def _most_likely(
    pairs: Sequence[tuple[Course, Array]], numbers: Array, least: float, held: Mask
) -> Array:
    """Return the most likely NUMBERS of one signal's errors, each of shape (T,), with their courses.

    `least` is the smallest variance of the sensor's noise; numbers that are `held`, (4,), stay.
    The search is over logarithms. It starts from the numbers before and from two guesses: mostly noise, and
    mostly drift.
    """
    square = float(np.mean(np.concatenate([error[course.used] for course, error in pairs]) ** 2))
    square = max(square, least)
    seconds = sum(course.period * len(error) for course, error in pairs) / len(pairs)
    way = sum(float(course.way.sum()) for course, _ in pairs) / len(pairs)
    way = max(way, 1e-3)
    lower = np.array([least, NONE * square, NONE * square, SHORTEST])
    upper = np.array([square * 4, square * 100, square * 1e4, LONGEST])
    lower[held] = upper[held] = numbers[held]
    bounds = np.log(np.stack([lower, upper], axis=1))

    def cost(logarithms: Array) -> float:
        values = np.exp(logarithms)
        return sum(_negative_log_likelihood(course, error, values) for course, error in pairs)

    steady = np.array([0.5 * square, 0.1 * square / seconds, 0.1 * square / way, LONGEST / 10])
    drifting = np.array([1e-3 * square, 10 * square / seconds, 10 * square / way, LONGEST / 10])
    starts = [steady, drifting]
    if numbers[1:3].any():
        starts = [numbers, steady]
    best = None
    for start in starts:
        begin = np.clip(np.log(np.maximum(start, 1e-300)), *bounds.T)
        ended = minimize(cost, begin, method="L-BFGS-B", bounds=bounds, options={"maxiter": 60})
        if best is None or ended.fun < best.fun:
            best = ended
    assert best is not None
    return np.exp(best.x)


def _negative_log_likelihood(course: Course, error: Array, numbers: Array) -> float:
    sensor, rate, way, relaxation = numbers.tolist()
    step = rate * course.period + way * course.way
    return _cost(error, course.used, sensor, sensor / course.readings, step, _carry(course, relaxation))


def _carry(course: Course, relaxation: float) -> Array:
    """Part of the drift that reaches the next sample, shape (T,): none where the joint is at a stop then."""
    carry = np.full(len(course.way), np.exp(-course.period / relaxation))
    carry[:-1][course.stops[1:]] = 0.0
    return carry


def _filter(course: Course, numbers: Array) -> tuple[Array, Array, Array]:
    """Return gain, carry and scale (1 over the innovation's standard deviation), each of shape (T,)."""
    sensor, rate, way, relaxation = numbers.tolist()
    step = rate * course.period + way * course.way
    carry = _carry(course, relaxation)
    gain, scale = _gains(course.used, sensor, sensor / course.readings, step, carry)
    return gain, carry, scale


def whitened(rows: Array, period: float, sensor: float, rate: float) -> Array:
    """Return the innovations of rows [rad], (n, T), for a sensor's variance and a drift that grows with time."""
    samples = rows.shape[1]
    carry = np.ones(samples)
    step = np.full(samples, rate * period)
    gain, scale = _gains(np.ones(samples, dtype=np.bool_), sensor, 0.0, step, carry)
    return _innovations(np.ascontiguousarray(rows), gain, carry, scale)


@njit(cache=True)
def _gains(used: Mask, sensor: float, start: float, step: Array, carry: Array) -> tuple[Array, Array]:
    """Kalman gains, and 1 over the standard deviation of the innovations, each of shape (T,); 0 if not used."""
    gain = np.zeros(len(step))
    scale = np.zeros(len(step))
    variance = start
    for k in range(len(step)):
        if used[k]:
            total = variance + sensor
            gain[k] = variance / total
            scale[k] = 1.0 / np.sqrt(total)
            variance *= 1.0 - gain[k]
        # at a stop the drift ends: nothing is added to it either
        variance = carry[k] ** 2 * variance + step[k] if carry[k] > 0.0 else 0.0
    return gain, scale


@njit(cache=True)
def _innovations(errors: Array, gain: Array, carry: Array, scale: Array) -> Array:
    """Innovations over their standard deviation, (n, T), of errors, (n, T)."""
    result = np.empty_like(errors)
    for i in range(len(errors)):
        drift = 0.0
        for k in range(errors.shape[1]):
            new = errors[i, k] - drift
            result[i, k] = new * scale[k]
            drift = carry[k] * (drift + gain[k] * new)
    return result


@njit(cache=True)
def _adjoint(rows: Array, gain: Array, carry: Array, scale: Array) -> Array:
    """Rows that give the same products with errors as `rows`, (p, T), with their innovations."""
    result = np.empty_like(rows)
    for i in range(len(rows)):
        later = 0.0
        for k in range(rows.shape[1] - 1, -1, -1):
            result[i, k] = scale[k] * rows[i, k] + carry[k] * gain[k] * later
            later = carry[k] * later - result[i, k]
    return result


@njit(cache=True)
def _errors(innovations: Array, gain: Array, carry: Array, scale: Array) -> Array:
    """The errors, (n, T), that leave these innovations, (n, T)."""
    result = np.empty_like(innovations)
    for i in range(len(innovations)):
        drift = 0.0
        for k in range(innovations.shape[1]):
            new = innovations[i, k] / scale[k] if scale[k] > 0.0 else 0.0
            result[i, k] = new + drift
            drift = carry[k] * (drift + gain[k] * new)
    return result


@njit(cache=True)
def _cost(error: Array, used: Mask, sensor: float, start: float, step: Array, carry: Array) -> float:
    """Negative log-likelihood of an error, (T,), but for a constant."""
    variance = start
    drift = 0.0
    cost = 0.0
    for k in range(len(error)):
        if used[k]:
            total = variance + sensor
            new = error[k] - drift
            cost += 0.5 * (new * new / total + np.log(total))
            gain = variance / total
            drift += gain * new
            variance *= 1.0 - gain
        drift *= carry[k]
        variance = carry[k] ** 2 * variance + step[k] if carry[k] > 0.0 else 0.0
    return cost


@njit(cache=True)
def _variances(start: float, step: Array, carry: Array) -> Array:
    """Variance of a drift that nothing is measured of, (T,)."""
    result = np.empty(len(step))
    variance = start
    for k in range(len(step)):
        result[k] = variance
        variance = carry[k] ** 2 * variance + step[k] if carry[k] > 0.0 else 0.0
    return result


@njit(cache=True)
def _summed_ahead(rows: Array, carry: Array) -> Array:
    """What a drift of 1 at each sample adds to products with rows, (p, T): the sums of all that it reaches."""
    result = np.empty_like(rows)
    for i in range(len(rows)):
        total = 0.0
        for k in range(rows.shape[1] - 1, -1, -1):
            total = rows[i, k] + carry[k] * total
            result[i, k] = total
    return result
