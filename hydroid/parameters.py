"""Parameters: names, units, bounds, scale and prior, and the way between a vector and
its names.

The search works in the unit box of the *free* parameters; everything else works with
the full vector theta: one column per parameter, fixed ones included, in the units of
the table.
"""

import math
from collections.abc import Mapping

import numpy as np

from hydroid.arrays import Array, Mask, record
from hydroid.errors import SettingsError


@record
class Prior:
    """What is known of one parameter besides the logs: Gaussian, or log-normal where
    `log`.

    `nominal` is the most likely value, of a log-normal prior its median; `sd` the
    standard deviation in the unit, or that of the logarithm.
    """

    nominal: float
    sd: float
    log: bool = False

    def score(self, value: Array) -> Array:
        """Return the distance of values from the nominal one, in standard
        deviations."""
        distance = np.log(value / self.nominal) if self.log else value - self.nominal
        return distance / self.sd

    def value(self, score: float) -> float:
        """Return the value at a score."""
        change = score * self.sd
        if self.log:
            return float(self.nominal * np.exp(change))
        return self.nominal + change


@record
class Parameter:
    """One physical parameter.

    Attributes:
        name, unit: its symbol, and the unit of its values.
        lower, upper: its bounds.
        fixed: its value if it is not estimated.
        log: whether it is searched, refined and reported by its logarithm; the lower
            bound is then above 0.
        start: where a search starts; None: nothing states it. If that is so of all
            parameters of a set, the search draws its starts; else it is the middle of
            the bounds.
        prior: what is known besides the logs.
        least: smallest size of a relative change of 1, in the unit: an effect is
            around 0, where nothing is relative to its value.
    """

    name: str
    unit: str
    lower: float
    upper: float
    fixed: float | None = None
    log: bool = False
    start: float | None = None
    prior: Prior | None = None
    least: float = 0.0

    def position(self, value: Array | float) -> Array:
        """Return where values lie on the parameter's scale: 0 at the lower bound,
        1 at the upper one."""
        value = np.asarray(value)
        if self.log:
            width = np.log(self.upper / self.lower)
            return np.log(value / self.lower) / width
        return (value - self.lower) / (self.upper - self.lower)

    def at(self, position: Array | float) -> Array:
        """Return the values at positions; the ends are the bounds to the last digit.
        Equations (15), (16)."""
        if self.log:
            inner = self.lower * (self.upper / self.lower) ** np.asarray(position)
        else:
            inner = self.lower + position * (self.upper - self.lower)
        # a power or a product may miss the upper bound by rounding
        return np.where(np.asarray(position) >= 1.0, self.upper, inner)


@record
class ParameterSet:
    """The parameters of a stage in the order of its vector theta, shape (P,)."""

    parameters: tuple[Parameter, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names, in order."""
        return tuple(p.name for p in self.parameters)

    @property
    def free(self) -> Mask:
        """Which parameters are not fixed, shape (P,)."""
        return np.array([p.fixed is None for p in self.parameters], dtype=bool)

    def named(self, chosen: Mask) -> tuple[str, ...]:
        """Return the names of some of the parameters, shape (P,), in order."""
        return tuple(np.array(self.names)[chosen].tolist())

    @property
    def log(self) -> Mask:
        """Which parameters are on a log scale, shape (P,)."""
        return np.array([p.log for p in self.parameters], dtype=bool)

    @property
    def lower(self) -> Array:
        """Lower bounds, shape (P,)."""
        return np.array([p.lower for p in self.parameters])

    @property
    def upper(self) -> Array:
        """Upper bounds, shape (P,)."""
        return np.array([p.upper for p in self.parameters])

    @property
    def start(self) -> Array:
        """Where a search starts, shape (P,): as stated,
        or in the middle of the bounds on their scale."""
        start = self.from_unit(np.full(int(self.free.sum()), 0.5))
        for column, parameter in enumerate(self.parameters):
            if parameter.fixed is None and parameter.start is not None:
                start[column] = parameter.start
        return start

    def started(self, values: Mapping[str, float]) -> Array:
        """Return values by name as theta, shape (P,), the others as at the start,
        all within the bounds."""
        theta = self.start
        for column, p in enumerate(self.parameters):
            if p.fixed is None and p.name in values:
                theta[column] = min(max(values[p.name], p.lower), p.upper)
        return theta

    def from_unit(self, unit: Array) -> Array:
        """Map points of the unit box, shape (.., free), to theta, shape (.., P)."""
        theta = np.empty((*unit.shape[:-1], len(self.parameters)))
        # of the free parameters alone
        positions = iter(np.moveaxis(unit, -1, 0))
        for column, parameter in enumerate(self.parameters):
            if parameter.fixed is None:
                theta[..., column] = parameter.at(next(positions))
            else:
                theta[..., column] = parameter.fixed
        return theta

    def to_unit(self, theta: Array) -> Array:
        """Map theta, shape (.., P), to the unit box, shape (.., free);
        values beyond a bound are clipped."""
        positions = list[Array]()
        columns = np.moveaxis(theta, -1, 0)
        for parameter, values in zip(self.parameters, columns, strict=True):
            if parameter.fixed is None:
                positions.append(parameter.position(values))
        return np.clip(np.stack(positions, axis=-1), 0.0, 1.0)

    def width(self, theta: Array) -> Array:
        """Return the change of each value per change of its position on its scale, at
        theta, (P,)."""
        lower = np.where(self.log, self.lower, 1.0)
        upper = np.where(self.log, self.upper, 1.0)
        return np.where(
            self.log, theta * np.log(upper / lower), self.upper - self.lower
        )

    def vector(self, values: Mapping[str, object], source: str) -> Array:
        """Return theta, shape (P,), from values by name; a fixed parameter may be left
        out.

        Raises SettingsError: a name that does not exist or is missing, or no number, or
        too small.
        """
        unknown = [name for name in values if name not in self.names]
        if unknown:
            hint = f"known: {', '.join(self.names)}"
            raise SettingsError(f"unknown parameter {unknown[0]!r}", source, hint)
        theta = list[float]()
        for parameter in self.parameters:
            value = values.get(parameter.name, parameter.fixed)
            if value is None:
                raise SettingsError(f"parameter {parameter.name!r} is missing", source)
            # most quantities cannot be negative
            least = min(parameter.lower, 0.0)
            number = _number(value)
            # so that squares stay finite
            if not least <= number < 1e100:
                hint = f"a number from {least:g}, in {parameter.unit}"
                raise SettingsError(
                    f"parameter {parameter.name!r} is {value!r}", source, hint
                )
            theta.append(number)
        return np.array(theta)

    def mapping(self, theta: Array) -> dict[str, float]:
        """Return values by name from theta, shape (P,)."""
        return dict(zip(self.names, theta.tolist(), strict=True))


def _number(value: object) -> float:
    """Return a value as a number; NaN, which no comparison accepts, of one that is
    none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return math.nan
    if abs(value) < 1e100:
        return float(value)
    return math.nan
