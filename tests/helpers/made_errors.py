"""Errors of a signal whose model is known, beside what a textbook says of them."""

from collections.abc import Sequence

import numpy as np

from hydroid.arrays import Array
from hydroid.posterior.course import Course, travelled
from hydroid.posterior.error_filter import SHORTEST
from hydroid.posterior.error_model import ErrorModel, Signal

SENSOR, RATE, WAY = 4e-6, 2e-6, 3e-5
"""variance of a sensor [rad²], growth of a drift's with time [rad²/s] and with the way
[rad²/rad]"""
DRIFTING = np.array([SENSOR, RATE, WAY, 0.0, SHORTEST])
LASTING = np.array([SENSOR, RATE, WAY, 2e-5, 0.5])
"""an error besides that lasts for half a second"""


def course_of(samples: int, first: int = 0, weight: float = 1.0, **changes) -> Course:
    """A joint that swings to and fro, and rests in between, at 20 Hz."""
    time = 0.05 * np.arange(samples)
    angle = np.cumsum(0.1 * np.sin(time) * (np.sin(0.3 * time) > 0))
    what = {
        "stops": np.zeros(samples, dtype=bool),
        "readings": np.inf,
        "used": np.ones(samples, dtype=bool),
    }
    rows = slice(first, first + samples)
    return Course(
        rows, weight, 0.05, travelled(angle, 0.05), angle - angle[0], **(what | changes)
    )


def stopping(samples: int) -> Course:
    """Stops at the start, in the middle and at the end, samples that do not count, a
    start that is read."""
    stops, used = np.zeros(samples, dtype=bool), np.ones(samples, dtype=bool)
    stops[:3] = stops[samples // 2 : samples // 2 + 5] = stops[-2:] = True
    used[::3] = False
    return course_of(samples, stops=stops, used=used, readings=4.0)


def model_of_errors(courses: Sequence[Course], numbers: Array) -> ErrorModel:
    """The error model of one angle in several logs."""
    of = (0,) * len(courses)
    return ErrorModel(
        (Signal(2, "angle"),),
        numbers[None].copy(),
        tuple(courses),
        of,
        np.array([np.nan]),
    )


def reach(course: Course, kept: float) -> Array:
    """What of an error at each sample is left in all samples, if a part is kept from
    one to the next: (T, T).

    Row k is of sample k. A stop ends it.
    """
    samples = len(course.way)
    result = np.zeros((samples, samples))
    result[0, 0] = 1.0
    for k in range(1, samples):
        if not course.stops[k]:
            result[k] = kept * result[k - 1]
            result[k, k] = 1.0
    return result


def parts_of(course: Course, numbers: Array) -> list[tuple[float, Array]]:
    """Of drift and lasting error: what is kept, and the variance of what begins at each
    sample, (T,)."""
    sensor, rate, way, lasting, time = numbers
    kept = np.exp(-course.period / time)
    drift = np.append(
        sensor / course.readings, rate * course.period + way * course.way[:-1]
    )
    new = np.full(len(course.way), lasting * (1 - kept**2))
    new[0] = 0.0
    return [(1.0, drift), (kept, new)]


def drift_covariance(course: Course, numbers: Array) -> Array:
    """Of drift and lasting error together, (T, T)."""
    total = np.zeros((len(course.way), len(course.way)))
    for kept, begun in parts_of(course, numbers):
        effects = reach(course, kept)
        total += (effects * begun) @ effects.T
    return total


def covariance(course: Course, numbers: Array) -> Array:
    """Of the errors, (T, T)."""
    return drift_covariance(course, numbers) + numbers[0] * np.eye(len(course.way))


def drawn(
    rng: np.random.Generator, course: Course, numbers: Array, count: int = 1
) -> Array:
    """Errors of a course, (count, T)."""
    samples = len(course.way)
    total = rng.normal(0.0, np.sqrt(numbers[0]), (count, samples))
    for kept, begun in parts_of(course, numbers):
        new = rng.normal(size=(count, samples)) * np.sqrt(begun)
        now = np.zeros(count)
        for k in range(samples):
            now = np.zeros(count) if k and course.stops[k] else kept * now + new[:, k]
            total[:, k] += now
    return course.weight * total
