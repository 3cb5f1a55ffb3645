"""The error of a model: sensor's noise, errors that last for a moment, and a drift that
grows with the way.

A joint on a valve integrates. A command that changes between two samples, oil that
warms, a spool that sticks: each moves all that follows in a log by a little. So what a
model leaves of a measured signal y is not white noise but

    y_k = ŷ_k(θ) + d_k + c_k + v_k,      Var v = σ²,
    d_{k+1} = d_k + w_k,                 Var w_k = (rate) h + (way) |Δy_k|,
    c_{k+1} = ρ c_k + n_k,               Var c = (lasting), ρ = exp(-h / (time)).

The drift d is the local-level model (A. C. Harvey, *Forecasting, Structural Time Series
Models and the Kalman Filter*, 1989); it begins as uncertain as the start angle. The
lasting error c is what a model that is not quite right does besides, such as an arm
that rings where the model does not: without it the drift would have to follow it, and
nothing slow would count. Both are 0 where the joint stands at a stop. The five numbers
are those of a joint's angle, or of a chamber's pressure, in all logs. They follow from
the residual by maximum likelihood.

A Kalman filter turns the residual into *innovations*: what the past of the log does not
foretell of each sample (L. Ljung, *System Identification*, 1999, chapters 3, 7 and 14).
Divided by their standard deviation they are white with variance 1. The filter's gains
depend on the measured way, not on θ: the filter is a linear map of the residual.

Least squares does not take the innovations of this model, though: maximum likelihood
does so where the model is right, and is misled where it errs. What a model does wrong
for a moment (a start that is late and a stop that is late as well) returns; a filter
that forgets within a tenth of a second takes it for drift, fits how the joint moves
from one sample to the next, and lets it end degrees away. So a second, simpler model
weighs the errors (`ErrorModel.weighing`): noise, and a drift that is followed within
`MEMORY` at the fastest. Its noise is as large as makes least squares as certain as it
may be by the errors as they are; so priors count rightly. Covariances, bands and
findings are those of the errors as they are.

Stage 1 puts a gain in place of the hydraulics, and the article fits it by output
errors: there the memory is endless.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.ndimage import binary_erosion
from scipy.optimize import OptimizeResult, minimize

from hydroid.arrays import Array, Mask, record
from hydroid.log import Log
from hydroid.problem.channels import Channel
from hydroid.problem.problem import Problem

NUMBERS = ("sensor", "rate", "way", "lasting", "time")
"""of an error: variance of the sensor's noise [rad²], growth of the drift's variance
with time [rad²/s] and with the way [rad²/rad], variance of the lasting error [rad²],
and its time constant [s]; pressures in Pa"""
LEAST_NOISE = {"angle": np.deg2rad(0.01), "pressure_a": 1e4, "pressure_b": 1e4}
"""smallest standard deviation of a sensor's noise that a residual can show [rad, Pa]:
no potentiometer or gauge is better (ours)"""
SHORTEST, LONGEST = 0.05, 30.0
"""time constants of a lasting error [s]: what is shorter is noise, and what is longer
is drift (ours)"""
NONE = 1e-12
"""growth of a drift, as a part of the residual's mean square, that counts as none"""
MEMORY = 5.0
"""time within which least squares takes a lasting error for drift, at the fastest [s]
(docs/measured.md)"""
WAY_OVER = 0.25
"""time over which a way is measured [s]: the sensor's noise is no way"""
AT_STOP = 0.002
"""part of a joint's range within which it stands at the end of it"""


class Signal(NamedTuple):
    """What an error model describes: the angle or a pressure of a joint (number, from
    1), in all logs."""

    joint: int
    quantity: str


@record
class Course:
    """One channel's times as its error sees them: the same for all parameters of the
    model.

    Attributes:
        rows: of the channel in a row of all channels' residuals.
        weight: of the channel's errors.
        period: between samples [s].
        way: travelled from each sample to the next [rad], shape (T,).
        moved: the measured signal less its first value [rad], shape (T,).
        stops: whether the joint stands at an end of its range, shape (T,).
        readings: of which the start angle is the mean; inf where it is taken for exact.
        used: samples that count, shape (T,); of the others nothing is taken to be
            measured.
    """

    rows: slice
    weight: float
    period: float
    way: Array
    moved: Array
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
    moved = channel.measured - channel.measured[0]
    return Course(
        channel.rows, channel.weight, log.period, way, moved, stops, readings, used
    )


def travelled(signal: Array, period: float) -> Array:
    """Return the way of a signal, (T,), from each sample to the next, without the noise
    of single samples."""
    half = max(round(0.5 * WAY_OVER / period), 1)
    padded = np.pad(signal, half, mode="edge")
    return np.abs(padded[2 * half :] - padded[: -2 * half]) / (2 * half)


def at_stops(angle: Array, ends: tuple[float, float], period: float) -> Mask:
    """Return where angles [rad], (T,), rest at an end of a joint's range, which may be
    infinite.

    A joint that turns back at once has not been at its stop.
    """
    lower, upper = ends
    margin = AT_STOP * (upper - lower)
    if not np.isfinite(margin):
        return np.zeros(len(angle), dtype=bool)
    there = (angle < lower + margin) | (angle > upper - margin)
    window = 2 * max(round(0.5 * WAY_OVER / period), 1) + 1
    return binary_erosion(there, np.ones(window, dtype=bool), border_value=1).astype(
        np.bool_
    )


@record
class ErrorModel:
    """The errors of the channels of a problem.

    Attributes:
        signals: S different ones.
        numbers: NUMBERS of each, shape (S, 5).
        courses: of each channel.
        of: the index of each channel's signal.
        given: variance of the sensor's noise that the settings give, shape (S,); NaN:
            none.
    """

    signals: tuple[Signal, ...]
    numbers: Array
    courses: tuple[Course, ...]
    of: tuple[int, ...]
    given: Array

    @cached_property
    def _filters(self) -> list["Filter"]:
        """Of each channel."""
        pairs = zip(self.courses, self.of, strict=True)
        return [make_filter(course, self.numbers[i]) for course, i in pairs]

    def innovations(self, errors: Array) -> Array:
        """Return the innovations [1] of weighted output errors, (n, R): 0 where a
        sample does not count."""
        result = np.empty(errors.shape)
        for course, one in zip(self.courses, self._filters, strict=True):
            part = np.ascontiguousarray(errors[:, course.rows]) / course.weight
            result[:, course.rows] = _innovations(part, *one)
        return result

    def errors(self, innovations: Array) -> Array:
        """Return the weighted output errors, (n, R), that leave these innovations.

        Of samples that do not count it is what those before foretell.
        """
        result = np.empty(innovations.shape)
        for course, one in zip(self.courses, self._filters, strict=True):
            part = np.ascontiguousarray(innovations[:, course.rows])
            result[:, course.rows] = course.weight * _errors(part, *one)
        return result

    @cached_property
    def used(self) -> Mask:
        """Samples that count, shape (R,)."""
        return np.concatenate([course.used for course in self.courses])

    def without(self, samples: Mask) -> "ErrorModel":
        """Return the model of the same errors if some samples, (R,), had not been
        measured."""
        courses = [
            replace(one, used=one.used & ~samples[one.rows]) for one in self.courses
        ]
        return replace(self, courses=tuple(courses))

    @cached_property
    def log_scale(self) -> Array:
        """Logarithm of each sample's density at an innovation of 0, shape (R,); 0 where
        it does not count."""
        scales = np.concatenate([one.scale for one in self._filters])
        scales[~self.used] = 1.0
        return np.where(self.used, np.log(scales) - 0.5 * np.log(2 * np.pi), 0.0)

    def log_density(self, innovations: Array) -> Array:
        """Return the logarithm of each sample's predictive density, from a row of
        innovations, shape (R,)."""
        return self.log_scale - 0.5 * innovations**2

    def log_likelihood(self, errors: Array) -> float:
        """Return the log-likelihood of weighted output errors, (R,)."""
        return float(self.log_density(self.innovations(errors[None])[0]).sum())

    def estimated(self, errors: Array, *, nearby: bool = False) -> "ErrorModel":
        """Return the error model whose numbers make weighted output errors, (R,), most
        likely.

        nearby: the search for them starts at the present ones only, which is faster.
        """
        numbers = self.numbers.copy()
        for i, signal in enumerate(self.signals):
            pairs = [(c, errors[c.rows] / c.weight) for c in self.courses_of(i)]
            least = LEAST_NOISE[signal.quantity] ** 2
            start = numbers[i] if nearby else None
            numbers[i] = _most_likely(pairs, least, float(self.given[i]), start)
        return replace(self, numbers=numbers)

    def independent(self, errors: Array) -> "ErrorModel":
        """Return the error model whose noise makes weighted output errors, (R,), most
        likely, without a drift or what lasts."""
        numbers = np.zeros_like(self.numbers)
        numbers[:, 4] = SHORTEST
        for i, signal in enumerate(self.signals):
            least = LEAST_NOISE[signal.quantity] ** 2
            pairs = [(c, errors[c.rows] / c.weight) for c in self.courses_of(i)]
            numbers[i, 0] = max(_mean_square(pairs), least)
        return replace(self, numbers=numbers)

    def weighing(self, memory: float, *, alike: bool) -> "ErrorModel":
        """Return the model by which least squares weighs output errors that are as
        here.

        It has noise, and a drift that is followed within `memory` [s] or more slowly:
        inf takes all of the error for noise. Errors that last tell less than as many
        independent ones. So the noise is as large as makes a change of a joint's speed,
        whose effect is along its own motion, as uncertain as it is by the errors as
        they are.

        alike: weighted errors of all signals are equally large, so that weights count;
        else each signal's are as large as they are.
        """
        signals = range(len(self.signals))
        numbers = np.array([self._unit(i, memory) for i in signals])
        unit = replace(self, numbers=numbers)
        levels = np.array([self._level(unit, i) for i in signals])
        if alike:
            weights = np.array([self.courses_of(i)[0].weight for i in signals])
            levels = np.mean(levels * weights**2) / weights**2
        least = [LEAST_NOISE[signal.quantity] ** 2 for signal in self.signals]
        numbers[:, :2] *= np.maximum(levels, least)[:, None]
        return replace(self, numbers=numbers)

    def _unit(self, i: int, memory: float) -> Array:
        """NUMBERS of signal i by which least squares weighs, for noise of variance 1,
        shape (5,)."""
        sensor, rate, way, lasting, time = self.numbers[i].tolist()
        courses = self.courses_of(i)
        samples = sum(int(course.used.sum()) for course in courses)
        seconds = sum(course.period * len(course.used) for course in courses)
        between = seconds / max(samples, 1)
        noise = sensor * between
        growth = (
            rate + way * sum(float(course.way.sum()) for course in courses) / seconds
        )
        if time < MEMORY:
            noise += 2.0 * lasting * time
        else:  # it is as good as a drift
            growth += 2.0 * lasting / time
        own = np.sqrt(noise / max(growth, np.finfo(float).tiny))
        return np.array([1.0, between / max(own, memory) ** 2, 0.0, 0.0, SHORTEST])

    def _level(self, unit: "ErrorModel", i: int) -> float:
        """Variance of signal i's errors summed along its motion, over that of white
        noise of 1."""
        variance = 0.0
        white = 0.0
        for number, course in enumerate(self.courses):
            if self.of[number] == i:
                row = _innovations(course.moved[None], *unit._filters[number])
                variance += float(self.scatter(number, row, unit)[0, 0])
                white += float(np.sum(row**2))
        if white > 0.0:
            return variance / white
        return float(self.numbers[i, 0] + self.numbers[i, 3])  # it stands still

    def courses_of(self, i: int) -> list[Course]:
        """Return the courses of the channels of signal i."""
        return [
            course
            for course, own in zip(self.courses, self.of, strict=True)
            if own == i
        ]

    def scatter(self, channel: int, rows: Array, fitted: "ErrorModel") -> Array:
        """Covariance of `rows` times a channel's innovations, shape (p, p), where its
        errors are as here.

        The innovations are those by the model that was `fitted`; `rows`, (p, T), are of
        the channel.
        """
        course, i = self.courses[channel], self.of[channel]
        own = make_filter(course, self.numbers[i])
        on_errors = _adjoint(np.ascontiguousarray(rows), *fitted._filters[channel])
        # sensor's noise, the start, and steps of drift and lasting error: each reaches
        # what comes after it
        drift = _summed_ahead(on_errors, own.carry[0])
        lasting = _summed_ahead(on_errors, own.carry[1])
        free = np.where(course.stops[1:], 0.0, 1.0)
        parts = [
            np.sqrt(self.numbers[i, 0]) * on_errors,
            drift[:, :1] * np.sqrt(self.numbers[i, 0] / course.readings),
            drift[:, 1:] * np.sqrt(own.step[0, :-1]) * free,
            lasting[:, 1:] * np.sqrt(own.step[1, :-1]) * free,
        ]
        return sum((part @ part.T for part in parts), np.zeros((len(rows), len(rows))))

    def drift(self, course: Course, i: int) -> Array:
        """Return the variance of signal i's drift and lasting error from the start of a
        course on, (T,)."""
        own = make_filter(course, self.numbers[i])
        start = float(self.numbers[i, 0]) / course.readings
        return _variances(start, own.step[0], own.carry[0]) + _variances(
            0.0, own.step[1], own.carry[1]
        )


def make_error_model(problem: Problem) -> ErrorModel:
    """Return an error model of a problem without drift, whose numbers are still to be
    estimated."""
    channels, logs, objective = (
        problem.channels,
        problem.logs,
        problem.settings.objective,
    )
    of_channel = [Signal(channel.joint, channel.quantity) for channel in channels]
    signals = tuple(dict.fromkeys(of_channel))
    numbers = np.zeros((len(signals), len(NUMBERS)))
    given = np.full(len(signals), np.nan)
    for i, signal in enumerate(signals):
        noise = objective.noise_of(signal.joint) if signal.quantity == "angle" else None
        if noise is not None:
            given[i] = np.deg2rad(noise) ** 2
        numbers[i, 0] = np.nan_to_num(given[i], nan=LEAST_NOISE[signal.quantity] ** 2)
        numbers[i, 4] = SHORTEST
    courses = tuple(
        make_course(channel, logs[channel.log], problem) for channel in channels
    )
    of = tuple(map(signals.index, of_channel))
    return ErrorModel(signals, numbers, courses, of, given)


@record
class Likelihood:
    """What least squares minimises: weighed errors and the priors' scores.

    Attributes:
        problem: whose output errors these are.
        shown: the model of these errors, as they are.
        memory: within which least squares takes an error for drift, at the fastest [s];
            inf in stage 1, which is fitted by output errors as in the article, and on
            the way from afar.
        independent: whether errors are taken for independent, however they last.
    """

    problem: Problem
    shown: ErrorModel
    memory: float
    independent: bool = False

    @cached_property
    def errors(self) -> ErrorModel:
        """The model that weighs the errors (`ErrorModel.weighing`)."""
        alike = self.problem.settings.stage == "mech"  # as in the article
        return self.shown.weighing(self.memory, alike=alike)

    @property
    def of_output_errors(self) -> "Likelihood":
        """The likelihood that takes none of an output error for drift."""
        return replace(self, memory=np.inf)

    @property
    def of_independent_errors(self) -> "Likelihood":
        """The likelihood if output errors were independent: then the logs outweigh the
        priors."""
        return replace(self.of_output_errors, independent=True)

    def log_posterior(self, theta: Array) -> float:
        """Return the logarithm of the posterior density of theta, (P,), but for a
        constant, by its errors as they are and the priors; -inf where a simulation
        diverged."""
        errors = self.problem.output_errors(theta[None])[0]
        if not np.isfinite(errors).all():
            return -np.inf
        scores = self.problem.priors.scores(theta[None])[0]
        shown = self.shown.estimated(errors)
        return shown.log_likelihood(errors) - 0.5 * float(np.sum(scores**2))

    def innovations(self, theta: Array) -> Array:
        """Return innovations [1] of theta, shape (n, P): (n, R); NaN where a simulation
        diverged."""
        return self.errors.innovations(self.problem.output_errors(theta))

    def rows(self, theta: Array) -> Array:
        """Return innovations and the M priors' scores, (n, R + M)."""
        return np.hstack([self.innovations(theta), self.problem.priors.scores(theta)])

    def negative_log(self, rows: Array) -> float:
        """Return the negative log-likelihood, but for a constant, of a row of `rows`
        with priors.

        It is that of errors as large as they are, whatever the numbers; so it tells
        starts apart that end with different ones. Each sample counts as if it were
        independent.
        """
        errors = self.errors
        squares = rows[: self.problem.measured.size] ** 2
        total = 0.5 * float(np.sum(rows[squares.size :] ** 2))
        for i, signal in enumerate(errors.signals):
            courses = errors.courses_of(i)
            shown = np.concatenate(
                [squares[course.rows][course.used] for course in courses]
            )
            level = float(np.mean(shown)) * float(errors.numbers[i, 0])
            total += (
                0.5
                * shown.size
                * float(np.log(max(level, LEAST_NOISE[signal.quantity] ** 2)))
            )
        return total

    def estimated(self, errors: Array, *, nearby: bool = False) -> "Likelihood":
        """Return the likelihood for what weighted output errors, (R,), show of their
        model, `nearby` as `ErrorModel.estimated` does."""
        if self.independent:
            return replace(self, shown=self.shown.independent(errors))
        return replace(self, shown=self.shown.estimated(errors, nearby=nearby))


def make_likelihood(problem: Problem) -> Likelihood:
    """Return the likelihood of a problem whose errors are still to be estimated."""
    memory = np.inf if problem.settings.stage == "mech" else MEMORY
    return Likelihood(problem, make_error_model(problem), memory)


def likelihood_at(
    problem: Problem, theta: Array, numbers: Array | None = None
) -> Likelihood:
    """Return the likelihood of a problem with the errors that it shows at theta, shape
    (P,).

    With `numbers`, (S, 5), it shows these.
    """
    likelihood = make_likelihood(problem)
    if numbers is not None:
        return replace(likelihood, shown=replace(likelihood.shown, numbers=numbers))
    return likelihood.estimated(problem.output_errors(theta[None])[0])


class Filter(NamedTuple):
    """A Kalman filter of one channel: arrays over its T samples.

    gain: of drift and lasting error, shape (2, T). carry: part of each that reaches the
    next sample, (2, T). scale: 1 over the standard deviation of the innovation, (T,); 0
    where a sample does not count. step: variance of what is added to each before the
    next sample, (2, T).
    """

    gain: Array
    carry: Array
    scale: Array
    step: Array


def make_filter(course: Course, numbers: Array) -> Filter:
    """Return the filter of a course by NUMBERS, shape (5,)."""
    carry, step = _model(course, numbers)
    sensor = float(numbers[0])
    gain, scale = _gains(course.used, sensor, sensor / course.readings, step, carry)
    return Filter(gain, carry, scale, step)


def _model(course: Course, numbers: Array) -> tuple[Array, Array]:
    """Return carry and step of drift and lasting error: both end where the joint stands
    at a stop then."""
    _, rate, way, lasting, time = numbers.tolist()
    samples = len(course.way)
    kept = np.exp(-course.period / time)
    carry = np.ones((2, samples))
    carry[1] = kept
    carry[:, :-1][:, course.stops[1:]] = 0.0
    step = np.empty((2, samples))
    step[0] = rate * course.period + way * course.way
    step[1] = lasting * (1.0 - kept**2)
    return carry, step


def _most_likely(
    pairs: Sequence[tuple[Course, Array]],
    least: float,
    given: float,
    start: Array | None = None,
) -> Array:
    """Return the most likely NUMBERS of one signal's errors, each of shape (T,), with
    their courses.

    `least` is the smallest variance of the sensor's noise; where it is `given`, it is
    that (NaN: it is not). The search is over logarithms. It starts from a guess that is
    mostly noise, and from one that is mostly drift.
    """
    square = max(_mean_square(pairs), least)
    seconds = sum(course.period * len(error) for course, error in pairs) / len(pairs)
    ways = [float(course.way.sum()) for course, _ in pairs]
    way = max(sum(ways) / len(pairs), 1e-3)
    lower = np.array([least, NONE * square, NONE * square, NONE * square, SHORTEST])
    upper = np.array([square * 4, square * 100, square * 1e4, square * 4, LONGEST])
    if np.isfinite(given):
        lower[0] = upper[0] = given
    bounds = np.log(np.stack([lower, upper], axis=1))

    def cost(logarithms: Array) -> float:
        values = np.exp(logarithms)
        return sum(
            _negative_log_likelihood(course, error, values) for course, error in pairs
        )

    steady = np.array([0.5, 0.1 / seconds, 0.1 / way, 0.1, 0.0]) * square
    drifting = np.array([1e-3, 10 / seconds, 10 / way, 1e-2, 0.0]) * square
    steady[4] = drifting[4] = 0.3
    starts = (steady, drifting) if start is None else (start,)
    options = {"maxiter": 60, "ftol": 1e-6}  # of a log-likelihood in the thousands
    ended = list[OptimizeResult]()
    for begun in starts:
        begin = np.clip(np.log(np.maximum(begun, 1e-300)), *bounds.T)
        ended.append(
            minimize(cost, begin, method="L-BFGS-B", bounds=bounds, options=options)
        )
    return np.exp(min(ended, key=lambda one: one.fun).x)


def _mean_square(pairs: Sequence[tuple[Course, Array]]) -> float:
    """Return the mean square of one signal's errors, with their courses."""
    used = np.concatenate([error[course.used] for course, error in pairs])
    return float(np.mean(used**2))


def _negative_log_likelihood(course: Course, error: Array, numbers: Array) -> float:
    carry, step = _model(course, numbers)
    sensor = float(numbers[0])
    return _cost(error, course.used, sensor, sensor / course.readings, step, carry)


def whitened(rows: Array, period: float, sensor: float, rate: float) -> Array:
    """Return innovations of rows [rad], (n, T), for a sensor's variance and a drift
    that grows with time."""
    samples = rows.shape[1]
    everywhere = np.ones(samples, dtype=np.bool_)
    still = np.zeros(samples)
    course = Course(
        slice(0), 1.0, period, still, still, ~everywhere, np.inf, everywhere
    )
    numbers = np.array([sensor, rate, 0.0, 0.0, SHORTEST])
    return _innovations(np.ascontiguousarray(rows), *make_filter(course, numbers))


@njit(cache=True)
def _gains(
    used: Mask, sensor: float, start: float, step: Array, carry: Array
) -> tuple[Array, Array]:
    """Kalman gains, (2, T), and 1 over the standard deviation of the innovations, (T,);
    0 if not used."""
    samples = len(used)
    gain = np.zeros((2, samples))
    scale = np.zeros(samples)
    drift, lasting, both = start, 0.0, 0.0  # covariance of the two
    for k in range(samples):
        if used[k]:
            total = drift + 2.0 * both + lasting + sensor
            first = (drift + both) / total
            second = (lasting + both) / total
            gain[0, k] = first
            gain[1, k] = second
            scale[k] = 1.0 / np.sqrt(total)
            drift, lasting, both = (
                drift - first * first * total,
                lasting - second * second * total,
                both - first * second * total,
            )
        if carry[0, k] > 0.0:
            drift += step[0, k]
            lasting = carry[1, k] ** 2 * lasting + step[1, k]
            both *= carry[1, k]
        else:  # at a stop nothing is added either
            drift, lasting, both = 0.0, 0.0, 0.0
    return gain, scale


@njit(cache=True)
def _innovations(
    errors: Array, gain: Array, carry: Array, scale: Array, step: Array
) -> Array:
    """Innovations over their standard deviation, (n, T), of errors, (n, T)."""
    result = np.empty_like(errors)
    for i in range(len(errors)):
        drift, lasting = 0.0, 0.0
        for k in range(errors.shape[1]):
            new = errors[i, k] - drift - lasting
            result[i, k] = new * scale[k]
            drift = carry[0, k] * (drift + gain[0, k] * new)
            lasting = carry[1, k] * (lasting + gain[1, k] * new)
    return result


@njit(cache=True)
def _adjoint(
    rows: Array, gain: Array, carry: Array, scale: Array, step: Array
) -> Array:
    """Rows that give the same products with errors as `rows`, (p, T), with their
    innovations."""
    result = np.empty_like(rows)
    for i in range(len(rows)):
        drift, lasting = 0.0, 0.0
        for k in range(rows.shape[1] - 1, -1, -1):
            new = scale[k] * rows[i, k]
            new += carry[0, k] * gain[0, k] * drift + carry[1, k] * gain[1, k] * lasting
            result[i, k] = new
            drift = carry[0, k] * drift - new
            lasting = carry[1, k] * lasting - new
    return result


@njit(cache=True)
def _errors(
    innovations: Array, gain: Array, carry: Array, scale: Array, step: Array
) -> Array:
    """The errors, (n, T), that leave these innovations, (n, T)."""
    result = np.empty_like(innovations)
    for i in range(len(innovations)):
        drift, lasting = 0.0, 0.0
        for k in range(innovations.shape[1]):
            new = innovations[i, k] / scale[k] if scale[k] > 0.0 else 0.0
            result[i, k] = new + drift + lasting
            drift = carry[0, k] * (drift + gain[0, k] * new)
            lasting = carry[1, k] * (lasting + gain[1, k] * new)
    return result


@njit(cache=True)
def _cost(
    error: Array, used: Mask, sensor: float, start: float, step: Array, carry: Array
) -> float:
    """Negative log-likelihood of an error, (T,), but for a constant."""
    drift, lasting, both = start, 0.0, 0.0
    drifted, lasted, cost = 0.0, 0.0, 0.0
    for k in range(len(error)):
        if used[k]:
            total = drift + 2.0 * both + lasting + sensor
            new = error[k] - drifted - lasted
            cost += 0.5 * (new * new / total + np.log(total))
            first = (drift + both) / total
            second = (lasting + both) / total
            drifted += first * new
            lasted += second * new
            drift, lasting, both = (
                drift - first * first * total,
                lasting - second * second * total,
                both - first * second * total,
            )
        if carry[0, k] > 0.0:
            drift += step[0, k]
            lasting = carry[1, k] ** 2 * lasting + step[1, k]
            both *= carry[1, k]
        else:
            drift, lasting, both = 0.0, 0.0, 0.0
        drifted *= carry[0, k]
        lasted *= carry[1, k]
    return cost


@njit(cache=True)
def _variances(start: float, step: Array, carry: Array) -> Array:
    """Variance of a part of the error that nothing is measured of, (T,)."""
    result = np.empty(len(step))
    variance = start
    for k in range(len(step)):
        result[k] = variance
        variance = carry[k] ** 2 * variance + step[k] if carry[k] > 0.0 else 0.0
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
