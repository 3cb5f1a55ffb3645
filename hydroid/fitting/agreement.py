"""Do logs agree? How each joint moves in each log, against the others, by three
numbers.

Nine numbers (`baselines`) are fitted to a joint's motion in the other logs. Then a log
says by which factor its speeds differ from these, by how much its dead bands are wider,
and by how much later it moves: each number alone, as if the others were right. Errors
are taken within short windows and without their means, so that no drift counts, and the
windows' own scatter gives the standard deviations.

A log stands out if it differs from the rest by far more than its standard deviation and
the rest's spread, and by enough to matter.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import ndtri, stdtr

from hydroid.arrays import Array, Limits, Mask, record
from hydroid.fitting.baselines import (
    LOWER,
    NAMES,
    SCALE,
    UPPER,
    Baseline,
    fit_baselines,
)
from hydroid.log import Log
from hydroid.progress import Progress, no_progress

WINDOW = 5.0
"""length of a window [s]"""
PERIOD = 0.02
"""of the samples that are compared, at the shortest [s]"""
STRIDE = 0.2
"""over which moves are compared with those of the model [s]"""
TINY = 1e-12
"""keeps divisors above 0"""
LEAST_EASE = 0.2
"""part of its mean speed that a joint has at any angle, at least"""
LEAST_LOGS = 3
"""with two logs nobody knows which is the odd one"""
LEAST_WAY = 5.0
"""that a joint must move in a log to be compared [deg]"""
LEAST_WINDOWS = 4
"""of a log at least: from their scatter come the standard deviations"""
FAR = 4.0
"""standard deviations that a log is away from the rest, to stand out"""
LEAST = np.array([0.08, 3.0, 0.04])
"""differences of speed [1], dead band [%] and delay [s] that matter"""
SAME = np.array([1.0, 0.0, 0.0])
"""the three numbers of a log that is as the others"""
LEAST_NUMBERS = np.array([0.1, -40.0, -0.8])
MOST_NUMBERS = np.array([10.0, 60.0, 0.8])
"""bounds of the three numbers"""
STEPS = np.array([0.2, 5.0, 0.1])
"""scales of the three numbers"""


@record
class Agreement:
    """How a joint (number, from 1) moves in n logs, each against the others.

    Attributes:
        joint: number, from 1.
        sources: the logs', n.
        numbers: speed as a factor, dead bands wider by [%], later by [s], shape (n, 3).
        sd: standard deviations of these, with the spread of the other logs, shape (n,
            3).
        odd: which log stands out, and by which of the numbers; None: none does.
    """

    joint: int
    sources: tuple[str, ...]
    numbers: Array
    sd: Array
    odd: tuple[int, int] | None


def compare_logs(
    logs: Sequence[Log],
    ranges: Sequence[Limits],
    progress: Progress = no_progress,
) -> list[Agreement]:
    """Compare logs, joint by joint (`ranges` [rad]), of those joints that at least
    three of them move."""
    found = list[Agreement]()
    for joint, limits in enumerate(ranges, 1):
        moved = [_thinned(log) for log in logs if _moves(log, joint)]
        if len(moved) < LEAST_LOGS:
            continue
        progress("comparing the logs of joint", joint, len(ranges))
        agreement = _compare(moved, joint, limits)
        if agreement is not None:
            found.append(agreement)
    return found


def _moves(log: Log, joint: int) -> bool:
    """Return whether a log drives a joint, and this moves far enough to be
    compared."""
    way = np.rad2deg(np.ptp(log.angle_of(joint)))
    # NaN, which is not larger than anything: not measured
    return log.drives(joint) and bool(way > LEAST_WAY)


def _thinned(log: Log) -> Log:
    """Return a log at about PERIOD, with its commands averaged."""
    step = round(PERIOD / log.period)
    if step < 2:
        return log
    rows = len(log.time) // step
    grouped = log.command[: rows * step].reshape(rows, step, -1)
    command = grouped.mean(axis=1)
    keep = slice(0, rows * step, step)
    return replace(
        log,
        time=log.time[keep],
        command=command,
        angle=log.angle[keep],
        period=log.period * step,
        pressure=None,
        rest=None if log.rest is None else log.rest // step,
        recorded=None,
        conditions=None,
    )


@record
class _Course:
    """A joint's motion in a log, in windows.

    Attributes:
        log: of T samples.
        joint: number, from 1.
        used: samples that count, shape (T,): not those at an end of its travel or
            range.
        window: of these, from 0.
        count: samples of each window.
    """

    log: Log
    joint: int
    used: Mask
    window: NDArray[np.int64]
    count: NDArray[np.int64]

    def errors(self, predicted: Array) -> Array:
        """Return errors of angles [rad], shape (T,), less the mean of their window,
        where they count."""
        angle = self.log.angle_of(self.joint)
        error = (angle - predicted)[self.used]
        # what drifts from window to window says nothing of how the joint follows
        mean = np.bincount(self.window, error) / self.count
        return error - mean[self.window]


def _compare(logs: Sequence[Log], joint: int, limits: Limits) -> Agreement | None:
    """Compare a joint's motion in logs, each against the others; None where too few of
    them show enough of it."""
    courses = [_course(log, joint, limits) for log in logs]
    courses = [course for course in courses if len(course.count) >= LEAST_WINDOWS]
    if len(courses) < LEAST_LOGS:
        return None
    baselines = fit_baselines([course.log for course in courses], joint, limits)
    # what stands at an end of its range is left out, so the model need not stop there
    endless = np.array([-np.inf, np.inf])
    model = replace(baselines[NAMES[-1]], limits=endless)
    courses = _stretched(courses, model)
    common = _refit(model, courses)
    rests, costs = _without_each(common, courses)
    against_rest = _numbers(rests, courses)
    sources = tuple(course.log.source for course in courses)
    # the log without which the others fit best; it spoils the rest of each of the
    # others
    seeming = int(np.argmin(costs + against_rest.costs.min(axis=1)))
    clean = _numbers([rests[seeming]] * len(courses), courses)
    odd = _odd(clean, seeming, len(courses[seeming].count))
    if odd is not None:
        sd = np.sqrt(clean.variances)
        sd[seeming] = _deviations(clean, seeming)
        return Agreement(joint, sources, clean.values, sd, (seeming, odd))
    deviations = [_deviations(against_rest, k) for k in range(len(courses))]
    return Agreement(joint, sources, against_rest.values, np.array(deviations), None)


def _without_each(
    model: Baseline, courses: Sequence[_Course]
) -> tuple[list[Baseline], Array]:
    """Return a model fitted again without each of n logs, and the sums of its squared
    errors on the others, (n,)."""
    rests = list[Baseline]()
    costs = np.zeros(len(courses))
    for k, course in enumerate(courses):
        others = [other for other in courses if other is not course]
        rest = _refit(model, others)
        rests.append(rest)
        for other in others:
            errors = other.errors(rest.predict(other.log))
            costs[k] += np.sum(errors**2)
    return rests, costs


@record
class _Numbers:
    """Three numbers of n logs, each alone, their variances, and squares of errors; all
    (n, 3)."""

    values: Array
    variances: Array
    costs: Array


def _numbers(models: Sequence[Baseline], courses: Sequence[_Course]) -> _Numbers:
    """Return the numbers of logs, each against a model."""
    shape = (len(courses), len(SAME))
    values = np.empty(shape)
    variances = np.empty(shape)
    costs = np.empty(shape)
    for k, (model, course) in enumerate(zip(models, courses, strict=True)):
        for number in range(len(SAME)):
            value, variance, cost = _alone(model, course, number)
            values[k, number] = value
            variances[k, number] = variance
            costs[k, number] = cost
    return _Numbers(values, variances, costs)


def _stretched(courses: Sequence[_Course], model: Baseline) -> list[_Course]:
    """Return motions in a measure of the angle in which speed depends on the command
    alone.

    A cylinder turns a joint faster where its lever is short, and logs differ in where
    they move.
    """
    joint = model.joint - 1
    angles = [course.log.angle[:, joint] for course in courses]
    least = min(map(np.min, angles))
    travel = max(map(np.max, angles)) - least
    move, ask, places = _moves_asked(courses, angles, model)
    shape = _ease(move, ask, (places - least) / travel)
    grid = np.linspace(0.0, 1.0, 201)
    ease = np.polyval(shape[::-1], grid)
    # it moves against its commands, or without them
    if ease.mean() <= 0:
        return list(courses)
    ease = ease.clip(LEAST_EASE * ease.mean())
    # the trapezoidal rule for the integral of 1 / ease
    slowness = 0.5 * (1 / ease[1:] + 1 / ease[:-1])
    steps = slowness * np.diff(grid) * travel
    measure = np.concatenate([[0.0], np.cumsum(steps)])
    stretched = list[_Course]()
    for course, angle in zip(courses, angles, strict=True):
        changed = course.log.angle.copy()
        place = (angle - least) / travel
        changed[:, joint] = np.interp(place, grid, measure)
        log = replace(course.log, angle=changed)
        stretched.append(replace(course, log=log))
    return stretched


def _moves_asked(
    courses: Sequence[_Course], angles: Sequence[Array], model: Baseline
) -> tuple[Array, Array, Array]:
    """Return how far a joint moved within STRIDE, how far a model of it does, and at
    which angle [rad], (n,) each, in all logs."""
    moved = list[Array]()
    asked = list[Array]()
    places = list[Array]()
    for course, angle in zip(courses, angles, strict=True):
        rows = max(round(STRIDE / course.log.period), 1)
        inside = course.used[rows:] & course.used[:-rows]
        predicted = model.predict(course.log)
        move = angle[rows:] - angle[:-rows]
        ask = predicted[rows:] - predicted[:-rows]
        middle = 0.5 * (angle[rows:] + angle[:-rows])
        moved.append(move[inside])
        asked.append(ask[inside])
        places.append(middle[inside])
    return np.concatenate(moved), np.concatenate(asked), np.concatenate(places)


def _ease(move: Array, ask: Array, place: Array) -> Array:
    """Return by which factor a joint moves farther than asked, as a parabola of its
    place in its travel, from 0 to 1: three coefficients, the constant first."""
    # the moves asked for, times 1, the place and its square
    rows = ask[:, None] * place[:, None] ** np.arange(3)
    # a factor of 1, as if by a few seconds more of data
    weak = 1e-3 * np.sum(ask**2) + TINY
    normal = rows.T @ rows + weak * np.eye(3)
    right = rows.T @ move + weak * np.array([1, 0, 0])
    return np.linalg.solve(normal, right).astype(float)


def _deviations(numbers: _Numbers, k: int) -> Array:
    """Return standard deviations of a log's numbers against the others', shape (3,).

    They hold its own scatter, the others' spread, and that of a fit to the others.
    """
    rest = np.arange(len(numbers.values)) != k
    scatter = numbers.variances[rest]
    spread = _spread(numbers.values[rest], scatter)
    of_the_fit = scatter.mean(axis=0) / rest.sum()
    return np.sqrt(numbers.variances[k] + spread + of_the_fit)


def _refit(model: Baseline, courses: Sequence[_Course]) -> Baseline:
    """Fit nine numbers to logs, from those of a model."""

    def made(x: Array) -> Baseline:
        return replace(model, delay=float(x[8]), numbers=x[:8].reshape(4, 2))

    def errors(x: Array) -> Array:
        changed = made(x)
        return np.concatenate(
            [course.errors(changed.predict(course.log)) for course in courses]
        )

    start = np.array([*model.numbers.ravel(), model.delay])
    # scipy takes no start on a bound
    lowest = np.array(LOWER) + 1e-6
    highest = np.array(UPPER) - 1e-6
    inside = np.clip(start, lowest, highest)
    fitted = least_squares(
        errors, inside, bounds=(LOWER, UPPER), x_scale=SCALE, max_nfev=15
    )
    return made(fitted.x)


def _alone(rest: Baseline, course: _Course, number: int) -> tuple[float, float, float]:
    """Return one number of a log against a model of the others, its variance, and
    squares of errors."""

    def errors(value: Array) -> Array:
        x = SAME.copy()
        x[number] = value[0]
        return course.errors(_predict(rest, course.log, x))

    bounds = (LEAST_NUMBERS[number], MOST_NUMBERS[number])
    scale = STEPS[number]
    fitted = least_squares(
        errors, SAME[number], bounds=bounds, x_scale=scale, diff_step=1e-3
    )
    # of the windows' scores: errors within a window last, so that its samples say
    # little more
    (slope,) = fitted.jac.T
    scores = np.bincount(course.window, slope * fitted.fun)
    few = len(course.count) / (len(course.count) - 1)
    information = max(np.sum(slope**2), 1e-30)
    variance = few * np.sum(scores**2) / information**2
    return fitted.x[0], max(variance, 1e-12), 2 * fitted.cost


def _predict(model: Baseline, log: Log, x: Array) -> Array:
    """Return the angles of a joint that is faster by a factor, has wider dead bands,
    and is later."""
    speed, dead, delay = x
    numbers = model.numbers.copy()
    numbers[0] = (numbers[0] + dead).clip(0.0, 95.0)
    numbers[2] *= speed
    angle = replace(model, numbers=numbers).predict(log)
    return np.interp(log.time - delay, log.time, angle)


def _course(log: Log, joint: int, limits: Limits) -> _Course:
    """Return a joint's motion in a log in windows, which also end where it reaches an
    end."""
    angle = log.angle_of(joint)
    margin = 0.01 * np.ptp(angle)
    low = max(limits[0], angle.min())
    high = min(limits[1], angle.max())
    used = (angle > low + margin) & (angle < high - margin)
    turns = np.cumsum(np.diff(used, prepend=used[:1]))
    pieces = np.stack([turns, log.time // WINDOW], axis=1)[used]
    _, piece = np.unique(pieces, axis=0, return_inverse=True)
    # numpy 2.0 returns a column
    window = piece.ravel()
    return _Course(log, joint, used, window, np.bincount(window))


def _spread(values: Array, variances: Array) -> Array:
    """Return the variance between logs, by DerSimonian and Laird, shape (3,)."""
    weight = 1 / variances
    total = weight.sum(axis=0)
    mean = (weight * values).sum(axis=0) / total
    scatter = (weight * (values - mean) ** 2).sum(axis=0)
    # what the variances alone make the values scatter
    expected = len(values) - 1
    scale = total - (weight**2).sum(axis=0) / total
    return ((scatter - expected) / scale.clip(TINY)).clip(0.0)


def _odd(numbers: _Numbers, k: int, windows: int) -> int | None:
    """Return which of its numbers explains best how a log differs; None: it does not
    differ enough."""
    away = np.abs(numbers.values[k] - SAME)
    # of few windows, standard deviations are rough: as many of a normal distribution
    chance = stdtr(windows - 1, -away / _deviations(numbers, k))
    deviations = -ndtri(chance.clip(1e-300))
    far = (away > LEAST) & (deviations > FAR)
    if not far.any():
        return None
    return int(np.where(far, numbers.costs[k], np.inf).argmin())
