"""Verdicts on claims that one cell of a study has a lower measure than another, over the same seeds.

The ratio of both measures is the geometric mean over seeds that both cells have, its interval Student's t of
the logarithms. It covers 95 % for all claims of one item of the article together (Bonferroni): an item with m
claims has intervals of 1 - 0.05 / m.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.stats import t as student
from studies import Claim, Table

from hydroid.parameters import Array
from hydroid.studies import Row


class Outcome(StrEnum):
    """What the runs say of a claim that a ratio lies below 1, as the article printed it or not."""

    HOLDS = "holds"
    OPPOSITE = "opposite"
    EXCLUDED = "an effect of the article's size is excluded"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Verdict:
    """A claim, the ratio of its two measures with the interval, the article's own ratio, and the outcome."""

    claim: Claim
    seeds: int
    ratio: float
    interval: tuple[float, float]
    printed: float | None
    outcome: Outcome


def verdicts(claims: Sequence[Claim], rows: Sequence[Row], tables: Sequence[Table]) -> list[Verdict]:
    """Return the verdict on every claim of a study."""
    together = Counter(claim.item for claim in claims)
    made: list[Verdict] = []
    for claim in claims:
        pairs = np.log(pairs_of(claim, rows))
        printed = printed_ratio(claim, tables)
        middle, half = ratio_of(pairs, 0.05 / together[claim.item])
        low, high = float(np.exp(middle - half)), float(np.exp(middle + half))
        outcome = judge(low, high, printed)
        made.append(Verdict(claim, len(pairs), float(np.exp(middle)), (low, high), printed, outcome))
    return made


def judge(low: float, high: float, printed: float | None) -> Outcome:
    """Return the outcome of an interval of the ratio that is claimed to be below 1."""
    if high < 1:
        return Outcome.HOLDS
    if low > 1:
        return Outcome.OPPOSITE
    excluded = printed is not None and not low <= printed <= high
    return Outcome.EXCLUDED if excluded else Outcome.UNDECIDED


def ratio_of(pairs: Array, chance: float) -> tuple[float, float]:
    """Return the mean difference of pairs of logarithms, (n, 2), and half its interval; infinite below 3."""
    difference, n = pairs[:, 0] - pairs[:, 1], len(pairs)
    if n < 3:
        return 0.0, np.inf
    half = student.ppf(1 - chance / 2, n - 1) * np.std(difference, ddof=1) / np.sqrt(n)
    return float(np.mean(difference)), float(half)


def pairs_of(claim: Claim, rows: Sequence[Row]) -> Array:
    """Return the measure of both cells on the seeds that both have, shape (n, 2)."""
    lower, than = (
        {row.seed: row.values[claim.column] for row in rows if row.cell == cell and not row.failed}
        for cell in (claim.lower, claim.than)
    )
    pairs = np.array([(lower[seed], than[seed]) for seed in lower if seed in than], float).reshape(-1, 2)
    return pairs[(np.isfinite(pairs) & (pairs > 0)).all(axis=1)]


def printed_ratio(claim: Claim, tables: Sequence[Table]) -> float | None:
    """Return the ratio of the values that the article prints; None where it does not print both."""
    for table in tables:
        if claim.column in table.columns and {claim.lower, claim.than} <= table.article.keys():
            column = table.columns.index(claim.column)
            lower, than = table.article[claim.lower][column], table.article[claim.than][column]
            if lower is not None and than is not None:
                return lower / than
    return None
