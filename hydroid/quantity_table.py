"""The rows of `quantities.yaml`, every quantity that can be stated or estimated,
by name and by side.

Of a quantity with two sides, such as `delay`, `delay_a` acts on motion towards A, which
a positive command causes, and `delay_b` towards B; the name without an ending sets
both.
"""

import math
from collections.abc import Iterable, Iterator
from itertools import chain
from typing import Literal, NamedTuple

from hydroid.arrays import Limits
from hydroid.files import Plain, read_table
from hydroid.units import UNITS


class Quantity(NamedTuple):
    """One physical quantity of a joint, its actuator, a link or the pump.

    Attributes:
        name: in settings and as a parameter of a fit.
        unit: of its values.
        default: value where nothing states one; None: no limit. Of a quantity with two
            sides a pair.
        plain: what it is, for readers who do not know its symbol.
        note: what those who set it must know besides.
        span: values of real machines, between which `hydroid suggest` searches a
            quantity that is not free.
        limits: least and largest value; None: from 0 where 0 is the default, or else
            above 0.
        of: what alone has it: the pump that all actuators share, or a kind of actuator,
            as `Joint.has` tells them apart; "": all have.
        optional: whether null is allowed beside a number; where it is the default, it
            is.
    """

    name: str
    unit: str
    default: float | tuple[float, float] | None
    plain: str
    note: str = ""
    span: Limits | None = None
    limits: Limits | None = None
    of: Literal["", "pump", "cylinder", "stand-in"] = ""
    optional: bool = False

    @property
    def meaning(self) -> str:
        """The plain words for the quantity, with the note behind them."""
        if self.note:
            return f"{self.plain}; {self.note}"
        return self.plain

    @property
    def factor(self) -> float:
        """Factor that turns a value in `unit` into SI; a command stays in %,
        and a plain number has 1."""
        if self.unit:
            return UNITS[self.unit.lower()].factor
        return 1.0

    @property
    def positive(self) -> bool:
        """Whether its values must be above 0."""
        return self.limits is None and self.default not in (0.0, (0.0, 0.0))

    @property
    def lowest(self) -> float:
        """The least value that a fit may try; 0 but for changes of a lever."""
        if self.limits:
            return self.limits[0]
        return 0.0

    @property
    def highest(self) -> float:
        """The largest value that a fit may try; inf where there is no limit."""
        if self.limits:
            return self.limits[1]
        return math.inf

    @property
    def of_the_pump(self) -> bool:
        """Whether all actuators share it, since they have one pump."""
        return self.of == "pump"

    def each(self) -> Iterator["Quantity"]:
        """Yield the quantity itself, or its two sides."""
        if not isinstance(self.default, tuple):
            yield self
            return
        for side, other, default in zip("AB", "BA", self.default, strict=True):
            yield self._replace(
                name=f"{self.name}_{side.lower()}",
                default=default,
                plain=f"{self.plain}, side {side}",
                note=self.note.format(side=side, other=other),
            )


def quantity(name: str, row: Plain) -> Quantity:
    """Return the quantity of one row; ValueError if `units.yaml` lacks its unit."""
    values: Plain = {}
    for key, value in row.items():
        values[key] = tuple(value) if isinstance(value, list) else value
    made = Quantity(name, **values)
    if made.unit and made.unit.lower() not in UNITS:
        raise ValueError(f"quantities.yaml: {name}: units.yaml has no unit {made.unit}")
    return made


_GROUPS = {
    group: tuple(map(quantity, rows, rows.values()))
    for group, rows in read_table("quantities.yaml").items()
}

ROWS = tuple(chain(*_GROUPS.values()))  # the one table


def _by_side(rows: Iterable[Quantity]) -> dict[str, Quantity]:
    """Return quantities by name, each side by itself."""
    sides = chain.from_iterable(row.each() for row in rows)
    return {quantity.name: quantity for quantity in sides}


QUANTITIES = _by_side(ROWS)
"""the quantities by name, each side by itself"""

HYDRAULIC = _by_side(_GROUPS["hydraulic"])
"""those that `hydraulics` sets for all joints"""

# what a parameter of a fit can be, by name
CHOICES = {row.name: row for row in ROWS} | QUANTITIES

TARGETS = {name: tuple(_by_side([row])) for name, row in CHOICES.items()}
"""the quantities that a name sets: itself, or both sides"""

# the quantities that both stages have
MECHANICAL = tuple(row.name for row in _GROUPS["mechanical"])

# the factors of a valve's curve, part by part
CURVE = tuple(row.name for row in _GROUPS["hydraulic"] if row.name.startswith("curve_"))
