"""Arrays by what they hold, records of them, and their size;
shapes and units stand where one is made."""

from dataclasses import dataclass, field
from typing import Any, TypeAlias, TypeVar, dataclass_transform

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]
Structs = NDArray[np.void]  # of a structured type
Limits: TypeAlias = tuple[float, float]
"""two ends of what lies between them, the lower one first"""

T = TypeVar("T")


@dataclass_transform(frozen_default=True, eq_default=False, field_specifiers=(field,))
def record(kind: type[T]) -> type[T]:
    """Make a frozen dataclass that equals itself alone: whether arrays are equal has no
    one answer.

    A class with its own `__repr__` keeps that.
    """
    return dataclass(frozen=True, eq=False, repr=kind.__repr__ is object.__repr__)(kind)


def rms(values: Array, axis: int | None = None) -> Any:
    """Return the root mean square of values, of all or along an axis."""
    return np.sqrt(np.mean(values**2, axis=axis))


def independent_samples(deviations: Array) -> Array:
    """Return how many independent samples deviations from their mean, (T, m), are
    worth: shape (m,).

    Their correlation from one sample to the next is taken for that of a first-order
    process.
    """
    square = np.sum(deviations**2, axis=0)
    with np.errstate(invalid="ignore"):
        correlation = np.sum(deviations[1:] * deviations[:-1], axis=0) / square
    correlation = np.where(square > 0, correlation, 0.0).clip(0, 1)
    return len(deviations) * (1 - correlation) / (1 + correlation)
