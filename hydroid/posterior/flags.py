"""How well one parameter is known, and from what, as data; the report puts it into words."""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

WEAK_ABOVE = 0.3
"""relative standard deviation above which a parameter or direction is weakly identifiable"""
UNIDENTIFIABLE_ABOVE = 1.0
"""relative standard deviation above which it is not identifiable: a linear interval then means nothing"""

Side = Literal["lower", "upper"]


class Flag(StrEnum):
    """How well the logs determine a parameter, whatever a prior adds."""

    IDENTIFIABLE = "identifiable"
    WEAK = "weakly identifiable"
    UNIDENTIFIABLE = "not identifiable"
    NO_EFFECT = "no effect"
    FIXED = "fixed"


class Source(StrEnum):
    """Where what is known of a parameter comes from."""

    DATA = "data"
    BOTH = "data and prior"
    PRIOR = "prior only"


@dataclass(frozen=True)
class ParameterStatus:
    """How well one parameter is known.

    Attributes:
        flag: what the logs alone determine.
        at_bound: the bound that it lies at.
        diverges: whether its effect is unknown because simulations diverge where it is changed.
        share: part of the information that the logs gave: 1 - posterior / prior variance.
        known: whether logs and priors together determine it.
    """

    flag: Flag
    at_bound: Side | None = None
    diverges: bool = False
    share: float = 1.0
    known: bool = True

    @property
    def source(self) -> Source | None:
        """Where the information comes from; None where there is none, or the parameter is fixed."""
        if self.flag is Flag.FIXED or not self.known:
            return None
        # nine tenths of the information are the only source that is named
        return Source.DATA if self.share > 0.9 else Source.BOTH if self.share >= 0.1 else Source.PRIOR


def flag_of(relative_sd: float, share: float = 1.0) -> Flag:
    """Return the flag of a relative standard deviation, of which the logs gave a share of the information.

    The logs alone leave a variance of the posterior's divided by their share. NaN counts as infinite.
    """
    alone = relative_sd / math.sqrt(share) if share > 0 else math.inf
    if not alone <= UNIDENTIFIABLE_ABOVE:
        return Flag.UNIDENTIFIABLE
    return Flag.WEAK if alone > WEAK_ABOVE else Flag.IDENTIFIABLE
