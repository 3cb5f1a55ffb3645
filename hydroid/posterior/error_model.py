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

from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hydroid.arrays import Array, Mask, record
from hydroid.posterior.course import Course, make_course
from hydroid.posterior.error_filter import (
    Filter,
    Pairs,
    make_filter,
    mean_square,
    most_likely,
    noise_and_drift,
)
from hydroid.problem.problem import Problem

LEAST_NOISE = {"angle": np.deg2rad(0.01), "pressure_a": 1e4, "pressure_b": 1e4}
"""smallest standard deviation of a sensor's noise that a residual can show [rad, Pa]:
no potentiometer or gauge is better (ours)"""
MEMORY = 5.0
"""time within which least squares takes a lasting error for drift, at the fastest [s]
(docs/measured.md)"""


class Signal(NamedTuple):
    """What an error model describes: the angle or a pressure of a joint (number, from
    1), in all logs."""

    joint: int
    quantity: str


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
    def _filters(self) -> list[Filter]:
        """Of each channel."""
        pairs = zip(self.courses, self.of, strict=True)
        return [make_filter(course, self.numbers[i]) for course, i in pairs]

    def innovations(self, errors: Array) -> Array:
        """Return the innovations [1] of weighted output errors, (n, R): 0 where a
        sample does not count."""
        result = np.empty(errors.shape)
        for course, kalman in zip(self.courses, self._filters, strict=True):
            unweighted = errors[:, course.rows] / course.weight
            result[:, course.rows] = kalman.innovations(unweighted)
        return result

    def errors(self, innovations: Array) -> Array:
        """Return the weighted output errors, (n, R), that leave these innovations.

        Of samples that do not count it is what those before foretell.
        """
        result = np.empty(innovations.shape)
        for course, kalman in zip(self.courses, self._filters, strict=True):
            unweighted = kalman.errors(innovations[:, course.rows])
            result[:, course.rows] = course.weight * unweighted
        return result

    @cached_property
    def used(self) -> Mask:
        """Samples that count, shape (R,)."""
        return np.concatenate([course.used for course in self.courses])

    def without(self, samples: Mask) -> "ErrorModel":
        """Return the model of the same errors if some samples, (R,), had not been
        measured."""
        courses = list[Course]()
        for course in self.courses:
            left = course.used & ~samples[course.rows]
            courses.append(replace(course, used=left))
        return replace(self, courses=tuple(courses))

    @cached_property
    def log_scale(self) -> Array:
        """Logarithm of each sample's density at an innovation of 0, shape (R,); 0 where
        it does not count."""
        scales = np.concatenate([kalman.scale for kalman in self._filters])
        # a scale of 0 has no logarithm
        scales[~self.used] = 1.0
        density = np.log(scales) - 0.5 * np.log(2 * np.pi)
        return np.where(self.used, density, 0.0)

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
            start = numbers[i] if nearby else None
            numbers[i] = most_likely(
                self._pairs(i, errors), _least(signal), float(self.given[i]), start
            )
        return replace(self, numbers=numbers)

    def independent(self, errors: Array) -> "ErrorModel":
        """Return the error model whose noise makes weighted output errors, (R,), most
        likely, without a drift or what lasts."""
        rows = list[Array]()
        for i, signal in enumerate(self.signals):
            square = mean_square(self._pairs(i, errors))
            rows.append(noise_and_drift(max(square, _least(signal))))
        return replace(self, numbers=np.array(rows))

    def _pairs(self, i: int, errors: Array) -> Pairs:
        """Return the courses of signal i, each with its part of weighted output errors,
        (R,), without the weight."""
        return [(c, errors[c.rows] / c.weight) for c in self.courses_of(i)]

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
        least = [_least(signal) for signal in self.signals]
        numbers[:, :2] *= np.maximum(levels, least)[:, None]
        return replace(self, numbers=numbers)

    def _unit(self, i: int, memory: float) -> Array:
        """NUMBERS of signal i by which least squares weighs, for noise of variance 1,
        shape (5,)."""
        sensor, rate, way, lasting, time = self.numbers[i].tolist()
        courses = self.courses_of(i)
        samples = sum(int(course.used.sum()) for course in courses)
        seconds = sum(course.period * len(course.used) for course in courses)
        travelled = sum(float(course.way.sum()) for course in courses)
        between = seconds / max(samples, 1)
        noise = sensor * between
        growth = rate + way * travelled / seconds
        if time < MEMORY:
            noise += 2.0 * lasting * time
        else:  # it is as good as a drift
            growth += 2.0 * lasting / time
        # within which the filter of these errors follows the drift [s]
        follows = np.inf
        if growth > 0.0:
            follows = np.sqrt(noise / growth)
        return noise_and_drift(1.0, between / max(follows, memory) ** 2)

    def _level(self, unit: "ErrorModel", i: int) -> float:
        """Variance of signal i's errors summed along its motion, over that of white
        noise of 1."""
        variance = 0.0
        white = 0.0
        for number, course in enumerate(self.courses):
            if self.of[number] == i:
                row = unit._filters[number].innovations(course.moved[None])
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
        course = self.courses[channel]
        i = self.of[channel]
        own = make_filter(course, self.numbers[i])
        sensor = self.numbers[i, 0]
        on_errors = fitted._filters[channel].adjoint(rows)
        # sensor's noise, the start, and steps of drift and lasting error: each reaches
        # what comes after it
        drift = own.drift_ahead(on_errors)
        lasting = own.lasting_ahead(on_errors)
        free = np.where(course.stops[1:], 0.0, 1.0)
        parts = [
            np.sqrt(sensor) * on_errors,
            drift[:, :1] * np.sqrt(sensor / course.readings),
            drift[:, 1:] * np.sqrt(own.step[0, :-1]) * free,
            lasting[:, 1:] * np.sqrt(own.step[1, :-1]) * free,
        ]
        covariance = np.zeros((len(rows), len(rows)))
        for part in parts:
            covariance += part @ part.T
        return covariance

    def drift(self, course: Course, i: int) -> Array:
        """Return the variance of signal i's drift and lasting error from the start of a
        course on, (T,)."""
        start = float(self.numbers[i, 0]) / course.readings
        return make_filter(course, self.numbers[i]).unseen_variance(start)


def _least(signal: Signal) -> float:
    """Return the smallest variance of a sensor's noise [rad², Pa²]."""
    return LEAST_NOISE[signal.quantity] ** 2


def make_error_model(problem: Problem) -> ErrorModel:
    """Return an error model of a problem without drift, whose numbers are still to be
    estimated."""
    channels = problem.channels
    objective = problem.settings.objective
    of_channel = [Signal(channel.joint, channel.quantity) for channel in channels]
    signals = tuple(dict.fromkeys(of_channel))
    rows = list[Array]()
    given = np.full(len(signals), np.nan)
    for i, signal in enumerate(signals):
        noise = None
        if signal.quantity == "angle":
            noise = objective.noise_of(signal.joint)
        variance = _least(signal)
        if noise is not None:
            variance = np.deg2rad(noise) ** 2
            given[i] = variance
        rows.append(noise_and_drift(variance))
    courses = list[Course]()
    for channel in channels:
        courses.append(make_course(channel, problem.logs[channel.log], problem))
    return ErrorModel(
        signals=signals,
        numbers=np.array(rows),
        courses=tuple(courses),
        of=tuple(map(signals.index, of_channel)),
        given=given,
    )


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
        samples = self.problem.measured.size
        squares = rows[:samples] ** 2
        total = 0.5 * float(np.sum(rows[samples:] ** 2))
        for i, signal in enumerate(errors.signals):
            shown = list[Array]()
            for course in errors.courses_of(i):
                shown.append(squares[course.rows][course.used])
            of_signal = np.concatenate(shown)
            # innovations are in units of the noise that least squares takes
            level = float(np.mean(of_signal)) * float(errors.numbers[i, 0])
            logarithm = float(np.log(max(level, _least(signal))))
            total += 0.5 * of_signal.size * logarithm
        return total

    def negative_log_at(self, theta: Array) -> float:
        """Return `negative_log` of theta, (P,), by a model of its own errors; inf where
        a simulation diverges."""
        errors = self.problem.output_errors(theta[None])[0]
        if not np.isfinite(errors).all():
            return np.inf
        own = self.estimated(errors)
        return own.negative_log(own.rows(theta[None])[0])

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
