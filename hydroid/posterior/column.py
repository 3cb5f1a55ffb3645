"""What a quantity is called, and what computes quantities for a population."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from hydroid.parameters import Array
from hydroid.simulation import Candidates


@dataclass(frozen=True)
class Column:
    """One quantity, or one point of a curve.

    Attributes:
        name: of the quantity or of the curve, plain ASCII.
        label: the same in words.
        unit: of the value.
        positive: it cannot be negative, and its interval is multiplicative.
        along: of a curve: what it is drawn against, with its unit.
        at: of a curve: where this point is, in that unit.
    """

    name: str
    label: str
    unit: str
    positive: bool = True
    along: str = ""
    at: float = 0.0


Measured: TypeAlias = list[tuple[Column, Array]]
"""quantities of n candidates, each of shape (n,); NaN where one does not exist"""
Measure: TypeAlias = Callable[[Candidates], Measured]
"""computes the same quantities for every population; it is smooth in the parameters"""
SIGNS = ("positive", "negative")
"""ends the names of quantities that belong to commands of one sign"""
