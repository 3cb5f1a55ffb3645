"""Verdicts on claims that a ratio of two measures over the same seeds lies below a
limit, or near 1.

The ratio is the geometric mean over seeds that both cells have, its interval Student's
t of the logarithms. The intervals of one item are Holm's, for the article's claims,
those of equality and ours apart; all from the first that does not reject have its
level.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.stats import nct, t as student
from studies import Claim, Runs, Table, of_cell

from hydroid.parameters import Array

NEAR = 1.25
"""two measures are equal if their ratio is between 1 / NEAR and NEAR"""
ASSUMED = 0.5
"""the effect where the article prints none: the ratio over its limit"""
POWER, MOST = 0.8, 200
"""power at which a claim has enough seeds, and the number above which nobody looks"""


class Outcome(StrEnum):
    HOLDS = "holds"
    OPPOSITE = "opposite"
    EXCLUDED = "excluded"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Verdict:
    """A claim, the ratio of its two measures with the interval, the article's own
    ratio, and the outcome.

    power: chance that this many seeds find the article's effect. enough: number of
    seeds for POWER.
    """

    claim: Claim
    seeds: int
    ratio: float
    interval: tuple[float, float]
    printed: float | None
    power: float
    enough: int
    outcome: Outcome


def verdicts(
    claims: Sequence[Claim], runs: Runs, tables: Sequence[Table]
) -> list[Verdict]:
    """Return the verdict on every claim of a study, in their order."""
    made: dict[str, Verdict] = {}
    families: dict[object, list[tuple[Claim, Array]]] = defaultdict(list)
    for claim in claims:
        families[claim.item, claim.equal, claim.ours].append(
            (claim, log_ratios(claim, runs))
        )
    for together in families.values():
        together.sort(key=lambda each: chance(each[1] - np.log(each[0].below)))
        level, stopped = 0.05, False
        for rank, (claim, logs) in enumerate(together):
            level = level if stopped else 0.05 / (len(together) - rank)
            one = verdict(claim, logs, level, printed_ratio(claim, tables))
            stopped = stopped or one.outcome not in (Outcome.HOLDS, Outcome.OPPOSITE)
            made[claim.says] = one
    return [made[claim.says] for claim in claims]


def verdict(claim: Claim, logs: Array, level: float, printed: float | None) -> Verdict:
    """Return the verdict on logarithms of a ratio, (n,), with an interval of 1 -
    level."""
    n, middle, low, high, deviation = len(logs), 0.0, -np.inf, np.inf, np.inf
    if n > 2:
        middle, deviation = (
            float(np.mean(logs)),
            max(float(np.std(logs, ddof=1)), 1e-12),
        )
        low, high = student.interval(1 - level, n - 1, middle, deviation / np.sqrt(n))
    # what speaks against the claim itself, as where text and table disagree, is no size
    # of its effect
    told = printed if printed and printed < claim.below else ASSUMED * claim.below
    expected = None if claim.equal else told
    effect = np.log(expected / claim.below) if expected else 0.0
    enough = next(
        (k for k in range(3, MOST + 1) if power(effect, deviation, k, level) >= POWER),
        MOST + 1,
    )
    ratio, low, high = (float(value) for value in np.exp([middle, low, high]))
    now, outcome = power(effect, deviation, n, level), judge(claim, low, high, expected)
    return Verdict(claim, n, ratio, (low, high), printed, now, enough, outcome)


def judge(claim: Claim, low: float, high: float, expected: float | None) -> Outcome:
    bottom, top = (1 / NEAR, NEAR) if claim.equal else (0.0, claim.below)
    if bottom <= low and high < top:
        return Outcome.HOLDS
    if low > top or high < bottom:
        return Outcome.OPPOSITE
    return (
        Outcome.EXCLUDED
        if expected and not low <= expected <= high
        else Outcome.UNDECIDED
    )


def power(effect: float, deviation: float, seeds: int, level: float) -> float:
    """Return the chance that this many seeds decide, if the logarithm of the ratio is
    `effect` off its limit.

    An effect of 0 means that the ratio is 1 and shall be found within NEAR.
    """
    if seeds < 3 or not np.isfinite(deviation):
        return 0.0
    error, limit = deviation / np.sqrt(seeds), float(student.isf(level / 2, seeds - 1))
    if effect:  # beyond 30 errors the chance is 1
        return float(nct.sf(limit, seeds - 1, min(abs(effect) / error, 30.0)))
    return max(0.0, 2 * float(student.cdf(np.log(NEAR) / error - limit, seeds - 1)) - 1)


def chance(logs: Array) -> float:
    """Return the p-value of a mean of 0; 1 where there are too few or all are 0: runs
    that are the same."""
    if len(logs) < 3 or not np.any(logs):
        return 1.0
    error = max(float(np.std(logs, ddof=1)), 1e-12) / np.sqrt(len(logs))
    return 2 * float(student.sf(abs(np.mean(logs)) / error, len(logs) - 1))


def log_ratios(claim: Claim, runs: Runs) -> Array:
    """Return the logarithm of a claim's ratio on every seed that has it, shape (n,)."""
    upper = of_cell(runs, claim.lower, claim.column)
    lower = (
        of_cell(runs, claim.than, claim.to or claim.column)
        if claim.than
        else dict.fromkeys(upper, 1.0)
    )
    pairs = [(upper[seed], lower[seed]) for seed in upper if seed in lower]
    return np.array([np.log(a / b) for a, b in pairs if a > 0 and b > 0], dtype=float)


def printed_ratio(claim: Claim, tables: Sequence[Table]) -> float | None:
    """Return the ratio of the values that the article prints; None where it does not
    print both."""
    asked = (claim.lower, claim.column), (claim.than, claim.to or claim.column)
    for table in tables:
        rows = {
            cell: dict(zip(table.columns, values, strict=True))
            for cell, values in table.article.items()
        }
        upper, lower = (rows.get(cell, {}).get(column) for cell, column in asked)
        if upper is not None and lower is not None:
            return upper / lower
    return None
