"""Parameters: names, units and bounds, and the way between a vector and its names.

The search works in the unit box of the *free* parameters; everything else works with the full
vector theta: one column per parameter, fixed ones included, in the units of the table.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import SettingsError

Array = NDArray[np.float64]

LARGEST = 1e100
"""larger than any quantity; its square is still finite"""


@dataclass(frozen=True)
class Parameter:
    """One physical parameter: its symbol, unit and bounds, and its value if it is fixed."""

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
        """Which parameters are not fixed, shape (P,)."""
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
        """Map points of the unit box, shape (n, free), to theta, shape (n, P), equations (15) and (16)."""
        theta = np.tile([p.fixed if p.fixed is not None else 0.0 for p in self.parameters], (len(unit), 1))
        low, high = self.lower[self.free], self.upper[self.free]
        # low + (high - low) may differ from high in the last digit
        theta[:, self.free] = np.where(unit >= 1.0, high, low + unit * (high - low))
        return theta

    def to_unit(self, theta: Array) -> Array:
        """Map theta, shape (n, P), to the unit box, shape (n, free); values beyond a bound are clipped."""
        low, high = self.lower[self.free], self.upper[self.free]
        return np.clip((theta[:, self.free] - low) / (high - low), 0.0, 1.0)

    def vector(self, values: Mapping[str, object], source: str) -> Array:
        """Return theta, shape (P,), from values by name; a fixed parameter may be left out.

        Raises:
            SettingsError: an unknown or a missing name, or a value that is not a number from 0.
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
    """Return |estimate - truth| / |truth|, as in the article's tables 1 and 6."""
    return np.abs(estimate - truth) / np.abs(truth)


def _number(parameter: Parameter, value: object, source: str) -> float:
    if value is None:
        raise SettingsError(f"parameter {parameter.name!r} is missing", where=source)
    # no quantity can be negative; the comparison is False for NaN
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < LARGEST:
        raise SettingsError(
            f"parameter {parameter.name!r} is {value!r}",
            where=source,
            hint=f"a number from 0, in {parameter.unit}",
        )
    return float(value)
