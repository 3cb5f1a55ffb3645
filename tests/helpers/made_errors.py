"""Errors of a signal whose model is known, beside what a textbook says of them."""

from collections.abc import Sequence

import numpy as np

from hydroid.arrays import Array
from hydroid.posterior.error_model import LONGEST, Course, ErrorModel, Signal, travelled

SENSOR, RATE, WAY = 4e-6, 2e-6, 3e-5
"""variance of a sensor [rad²], growth of a drift's with time [rad²/s] and with the way [rad²/rad]"""
NUMBERS = np.array([SENSOR, RATE, WAY, LONGEST])


def course_of(samples: int, first: int = 0, weight: float = 1.0, **changes) -> Course:
    """A joint that swings to and fro, and rests in between, at 20 Hz."""
    time = 0.05 * np.arange(samples)
    angle = np.cumsum(0.1 * np.sin(time) * (np.sin(0.3 * time) > 0))
    what = {"stops": np.zeros(samples, dtype=bool), "readings": np.inf, "used": np.ones(samples, dtype=bool)}
    return Course(slice(first, first + samples), weight, 0.05, travelled(angle, 0.05), **(what | changes))


def stopping(samples: int) -> Course:
    """Stops at the start, in the middle and at the end, samples that do not count, and a start that is read."""
    stops, used = np.zeros(samples, dtype=bool), np.ones(samples, dtype=bool)
    stops[:3] = stops[samples // 2 : samples // 2 + 5] = stops[-2:] = True
    used[::3] = False
    return course_of(samples, stops=stops, used=used, readings=4.0)


def model_of_errors(
    courses: Sequence[Course], numbers: Array = NUMBERS, *, given: bool = False, stays: bool = True
) -> ErrorModel:
    """The error model of one angle in several logs."""
    of = (0,) * len(courses)
    return ErrorModel(
        (Signal(2, "angle"),), numbers[None].copy(), tuple(courses), of, np.array([given]), np.array([stays])
    )


def reach(course: Course, numbers: Array) -> Array:
    """What a step of the drift at each sample, the start's first, leaves in all samples: (T, T)."""
    forgotten = np.exp(-course.period / numbers[3])
    samples = len(course.way)
    result = np.zeros((samples, samples))
    result[0, 0] = 1.0
    for k in range(1, samples):
        if not course.stops[k]:
            result[k] = forgotten * result[k - 1]
            result[k, k] = 1.0
    return result


def steps_of(course: Course, numbers: Array) -> Array:
    """Variance of the drift's start, and of its steps to the samples after it, (T,)."""
    sensor, rate, way, _ = numbers
    return np.append(sensor / course.readings, rate * course.period + way * course.way[:-1])


def covariance(course: Course, numbers: Array) -> Array:
    """Of the errors, (T, T)."""
    effects = reach(course, numbers)
    return (effects * steps_of(course, numbers)) @ effects.T + numbers[0] * np.eye(len(effects))


def drawn(rng: np.random.Generator, course: Course, numbers: Array, count: int = 1) -> Array:
    """Errors of a course, (count, T)."""
    samples = len(course.way)
    steps = rng.normal(size=(count, samples)) * np.sqrt(steps_of(course, numbers))
    forgotten = np.exp(-course.period / numbers[3])
    drift = np.empty((count, samples))
    drift[:, 0] = steps[:, 0]
    for k in range(1, samples):
        drift[:, k] = 0.0 if course.stops[k] else forgotten * drift[:, k - 1] + steps[:, k]
    return course.weight * (drift + rng.normal(0.0, np.sqrt(numbers[0]), (count, samples)))
