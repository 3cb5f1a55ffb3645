"""How well one parameter is known, as data; the report puts it into words."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

WEAK_ABOVE = 0.3
"""relative standard deviation above which a parameter or direction is weakly identifiable"""
UNIDENTIFIABLE_ABOVE = 1.0
"""relative standard deviation above which it is not identifiable: a linear interval then means nothing"""

Side = Literal["lower", "upper"]


class Flag(StrEnum):
    """How well the logs and the priors determine a parameter."""

    IDENTIFIABLE = "identifiable"
    WEAK = "weakly identifiable"
    UNIDENTIFIABLE = "not identifiable"
    NO_EFFECT = "no effect"
    FIXED = "fixed"


@dataclass(frozen=True)
class ParameterStatus:
    """How well one parameter is known."""

    flag: Flag
    at_bound: Side | None = None
    derivative_doubt: float | None = None
    """relative difference between the derivatives of two step sizes, where it is large"""
    diverges: bool = False
    """whether its effect is unknown because simulations diverge where it is changed"""


def flag_of(relative_sd: float) -> Flag:
    """Return the flag of a relative standard deviation; NaN counts as infinite."""
    if not relative_sd <= UNIDENTIFIABLE_ABOVE:
        return Flag.UNIDENTIFIABLE
    return Flag.WEAK if relative_sd > WEAK_ABOVE else Flag.IDENTIFIABLE
