"""Parameters: names, units and bounds, and the way between a vector and its names.

The search works in the unit box of the *free* parameters; everything else works with the full
vector theta, in the units of the table, one column a parameter, fixed ones included.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import SettingsError

Array = NDArray[np.float64]

LARGEST = 1e100
"""more than any quantity can be, and squares of it are still finite"""


@dataclass(frozen=True)
class Parameter:
    """One physical parameter: its article symbol, unit, bounds, and its value where it is held fixed."""

    name: str
    unit: str
    lower: float
    upper: float
    fixed: float | None = None


@dataclass(frozen=True)
class ParameterSet:
    """The parameters of a stage in the order of its vector theta, shape (P,)."""

    parameters: tuple[Parameter, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names, in order."""
        return tuple(p.name for p in self.parameters)

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which parameters the search may move, shape (P,)."""
        return np.array([p.fixed is None for p in self.parameters], dtype=bool)

    @property
    def lower(self) -> Array:
        """Lower bounds, shape (P,)."""
        return np.array([p.lower for p in self.parameters])

    @property
    def upper(self) -> Array:
        """Upper bounds, shape (P,)."""
        return np.array([p.upper for p in self.parameters])

    def from_unit(self, unit: Array) -> Array:
        """Map points of the unit box, shape (n, free), to theta, shape (n, P): the space of (15), (16)."""
        theta = np.tile([p.fixed if p.fixed is not None else 0.0 for p in self.parameters], (len(unit), 1))
        low, high = self.lower[self.free], self.upper[self.free]
        # the second clause returns the bounds themselves at 0 and 1, where low + (high - low) may not
        theta[:, self.free] = np.where(unit >= 1.0, high, low + unit * (high - low))
        return theta

    def to_unit(self, theta: Array) -> Array:
        """Map theta, shape (n, P), to the unit box, shape (n, free); values beyond a bound are clipped."""
        low, high = self.lower[self.free], self.upper[self.free]
        return np.clip((theta[:, self.free] - low) / (high - low), 0.0, 1.0)

    def vector(self, values: Mapping[str, object], source: str) -> Array:
        """Return theta, shape (P,), from values by name; a fixed parameter may be left out.

        Raises:
            SettingsError: a name that does not exist, is missing, or has no finite number, or a negative one.
        """
        unknown = [name for name in values if name not in self.names]
        if unknown:
            known = ", ".join(self.names)
            raise SettingsError(f"unknown parameter {unknown[0]!r}", where=source, hint=f"known: {known}")
        return np.array([_number(p, values.get(p.name, p.fixed), source) for p in self.parameters])

    def mapping(self, theta: Array) -> dict[str, float]:
        """Return values by name from theta, shape (P,)."""
        return dict(zip(self.names, map(float, theta), strict=True))


def relative_error(estimate: Array, truth: Array) -> Array:
    """Absolute difference to the true value over the true value, as in the article's tables 1 and 6."""
    return np.abs(estimate - truth) / np.abs(truth)


def _number(parameter: Parameter, value: object, source: str) -> float:
    if value is None:
        raise SettingsError(f"parameter {parameter.name!r} is missing", where=source)
    # no quantity can be negative; infinity and nan compare as too large
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < LARGEST:
        raise SettingsError(
            f"parameter {parameter.name!r} is {value!r}",
            where=source,
            hint=f"a number from 0, in {parameter.unit}",
        )
    return float(value)
