"""A quantity of a joint before its interval is known: its name, its words, and its
value for candidates.
"""

from collections.abc import Iterator
from typing import NamedTuple, TypeAlias

from hydroid.arrays import Array


class Column(NamedTuple):
    """One quantity of a joint, or one point of one of its curves.

    Attributes:
        name: in plain ASCII; the points of a curve share it.
        label: the same in words.
        unit: of the value.
        positive: whether it cannot be negative, so that its interval is multiplicative.
        at: where the point of a curve is; None: it is no curve's.
        along: what `at` is.
        step: as `CurveEstimate` has it.
        moves: as `CurveEstimate` has it.
        reach: as `QuantityEstimate` has it.
    """

    name: str
    label: str
    unit: str
    positive: bool = True
    at: float | None = None
    along: str = "command [%]"
    step: float | None = None
    moves: str = ""
    reach: float | None = None


Measured: TypeAlias = Iterator[tuple[Column, Array]]
"""quantities of n candidates, each of shape (n,), the same for every population;
NaN where one is undefined"""
