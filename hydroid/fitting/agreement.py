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

from hydroid.arrays import Array, Mask, record
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
LEAST_EASE = 0.2
"""part of its mean speed that a joint has at any angle, at least"""
LEAST_LOGS = 3
"""with two logs nobody knows which is the odd one"""
LEAST_WAY = 5.0
"""that a joint must move in a log to be compared [deg]"""
LEAST_WINDOWS = 4
FAR = 4.0
"""standard deviations that a log is away from the rest, to stand out"""
LEAST = np.array([0.08, 3.0, 0.04])
"""differences of speed [1], dead band [%] and delay [s] that matter"""
SAME = np.array([1.0, 0.0, 0.0])
LEAST_NUMBERS = np.array([0.1, -40.0, -0.8])
MOST_NUMBERS = np.array([10.0, 60.0, 0.8])
STEPS = np.array([0.2, 5.0, 0.1])
"""bounds and scales of the three numbers"""


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
    ranges: Sequence[tuple[float, float]],
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
    angle = log.angle[:, joint - 1]
    # NaN: not measured
    return bool(log.driven[joint - 1]) and np.rad2deg(np.ptp(angle)) > LEAST_WAY


def _thinned(log: Log) -> Log:
    """Return a log at about PERIOD, with its commands averaged."""
    step = round(PERIOD / log.period)
    if step < 2:
        return log
    rows = len(log.time) // step
    command = log.command[: rows * step].reshape(rows, step, -1).mean(axis=1)
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
        error = (self.log.angle[:, self.joint - 1] - predicted)[self.used]
        return error - (np.bincount(self.window, error) / self.count)[self.window]


def _compare(
    logs: Sequence[Log], joint: int, limits: tuple[float, float]
) -> Agreement | None:
    courses = [_course(log, joint, limits) for log in logs]
    courses = [course for course in courses if len(course.count) >= LEAST_WINDOWS]
    if len(courses) < LEAST_LOGS:
        return None
    model = fit_baselines([course.log for course in courses], joint, limits)[NAMES[-1]]
    # what stands at an end of its range is left out, so the model need not stop there
    model = replace(model, limits=np.array([-np.inf, np.inf]))
    courses = _stretched(courses, model)
    common = _refit(model, courses)
    rests, costs = _without_each(common, courses)
    own = _numbers(rests, courses)
    sources = tuple(course.log.source for course in courses)
    # the log without which the others fit best; it spoils the rest of each of the
    # others
    seeming = int(np.argmin(costs + own.costs.min(axis=1)))
    clean = _numbers([rests[seeming]] * len(courses), courses)
    odd = _odd(clean, seeming, len(courses[seeming].count))
    if odd is not None:
        sd = np.sqrt(clean.variances)
        sd[seeming] = _deviations(clean, seeming)
        return Agreement(joint, sources, clean.values, sd, (seeming, odd))
    sd = np.array([_deviations(own, k) for k in range(len(courses))])
    return Agreement(joint, sources, own.values, sd, None)


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
            costs[k] += np.sum(other.errors(rest.predict(other.log)) ** 2)
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
    shape = len(courses), len(SAME)
    found = _Numbers(np.empty(shape), np.empty(shape), np.empty(shape))
    for k, (model, course) in enumerate(zip(models, courses, strict=True)):
        for number in range(len(SAME)):
            value, variance, cost = _alone(model, course, number)
            found.values[k, number] = value
            found.variances[k, number] = variance
            found.costs[k, number] = cost
    return found


def _stretched(courses: Sequence[_Course], model: Baseline) -> list[_Course]:
    """Return motions in a measure of the angle in which speed depends on the command
    alone.

    A cylinder turns a joint faster where its lever is short, and logs differ in where
    they move.
    """
    joint = model.joint - 1
    angles = [course.log.angle[:, joint] for course in courses]
    least, most = min(map(np.min, angles)), max(map(np.max, angles))
    moved, asked, places = list[Array](), list[Array](), list[Array]()
    for course, angle in zip(courses, angles, strict=True):
        rows = max(round(STRIDE / course.log.period), 1)
        inside = course.used[rows:] & course.used[:-rows]
        predicted = model.predict(course.log)
        moved.append((angle[rows:] - angle[:-rows])[inside])
        asked.append((predicted[rows:] - predicted[:-rows])[inside])
        places.append((0.5 * (angle[rows:] + angle[:-rows]))[inside])
    move, ask = np.concatenate(moved), np.concatenate(asked)
    at = (np.concatenate(places) - least) / (most - least)
    # the moves asked for, times 1, the place and its square; 1 as if by a few seconds
    # more of data
    rows = ask[:, None] * at[:, None] ** np.arange(3)
    weak = 1e-3 * np.sum(ask**2) + TINY
    shape = np.linalg.solve(
        rows.T @ rows + weak * np.eye(3), rows.T @ move + weak * np.array([1, 0, 0])
    )
    grid = np.linspace(0.0, 1.0, 201)
    ease = np.polyval(shape[::-1], grid)
    if ease.mean() <= 0:  # it moves against its commands, or without them
        return list(courses)
    ease = ease.clip(LEAST_EASE * ease.mean())
    steps = 0.5 * (1 / ease[1:] + 1 / ease[:-1]) * np.diff(grid) * (most - least)
    measure = np.concatenate([[0.0], np.cumsum(steps)])
    stretched = list[_Course]()
    for course, angle in zip(courses, angles, strict=True):
        changed = course.log.angle.copy()
        changed[:, joint] = np.interp((angle - least) / (most - least), grid, measure)
        stretched.append(replace(course, log=replace(course.log, angle=changed)))
    return stretched


def _deviations(numbers: _Numbers, k: int) -> Array:
    """Return standard deviations of a log's numbers against the others', shape (3,).

    They hold its own scatter, the others' spread, and that of a fit to the others.
    """
    rest = np.arange(len(numbers.values)) != k
    own = numbers.variances[rest]
    spread = _spread(numbers.values[rest], own)
    return np.sqrt(numbers.variances[k] + spread + own.mean(axis=0) / rest.sum())


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
    inside = np.clip(start, np.array(LOWER) + 1e-6, np.array(UPPER) - 1e-6)
    bounds = LOWER, UPPER
    return made(
        least_squares(errors, inside, bounds=bounds, x_scale=SCALE, max_nfev=15).x
    )


def _alone(rest: Baseline, course: _Course, number: int) -> tuple[float, float, float]:
    """Return one number of a log against a model of the others, its variance, and
    squares of errors."""

    def errors(value: Array) -> Array:
        x = SAME.copy()
        x[number] = value[0]
        return course.errors(_predict(rest, course.log, x))

    bounds = LEAST_NUMBERS[number], MOST_NUMBERS[number]
    scale = STEPS[number]
    fitted = least_squares(
        errors, SAME[number], bounds=bounds, x_scale=scale, diff_step=1e-3
    )
    # of the windows' scores: errors within a window last, so that its samples say
    # little more
    (slope,) = fitted.jac.T
    scores = np.bincount(course.window, slope * fitted.fun)
    few = len(course.count) / (len(course.count) - 1)
    variance = few * np.sum(scores**2) / max(np.sum(slope**2), 1e-30) ** 2
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


def _course(log: Log, joint: int, limits: tuple[float, float]) -> _Course:
    """Return a joint's motion in a log in windows, which also end where it reaches an
    end."""
    angle = log.angle[:, joint - 1]
    margin = 0.01 * np.ptp(angle)
    low, high = max(limits[0], angle.min()), min(limits[1], angle.max())
    used = (angle > low + margin) & (angle < high - margin)
    turns = np.cumsum(np.diff(used, prepend=used[:1]))
    pieces = np.stack([turns, log.time // WINDOW], axis=1)[used]
    _, window = np.unique(pieces, axis=0, return_inverse=True)
    return _Course(log, joint, used, window.ravel(), np.bincount(window.ravel()))


def _spread(values: Array, variances: Array) -> Array:
    """Return the variance between logs, by DerSimonian and Laird, shape (3,)."""
    weight = 1 / variances
    mean = (weight * values).sum(axis=0) / weight.sum(axis=0)
    scatter = (weight * (values - mean) ** 2).sum(axis=0)
    scale = weight.sum(axis=0) - (weight**2).sum(axis=0) / weight.sum(axis=0)
    return ((scatter - (len(values) - 1)) / scale.clip(TINY)).clip(0.0)


def _odd(numbers: _Numbers, k: int, windows: int) -> int | None:
    """Return which of its numbers explains best how a log differs; None: it does not
    differ enough."""
    away = np.abs(numbers.values[k] - SAME)
    # of few windows, standard deviations are rough: as many of a normal distribution
    chance = stdtr(windows - 1, -away / _deviations(numbers, k))
    far = (away > LEAST) & (-ndtri(chance.clip(1e-300)) > FAR)
    return int(np.where(far, numbers.costs[k], np.inf).argmin()) if far.any() else None
