"""Tests of claims: over the same seeds, does one cell have a lower measure than another?

Differences are paired by seed and tested by Wilcoxon's signed-rank test, two-sided. The p-values of all
claims of a study are corrected together by Holm's method. The effect size is the matched-pairs rank-biserial
correlation: 1 if the claim holds on every seed, -1 if its opposite does.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from scipy.stats import rankdata, wilcoxon

from hydroid.parameters import Array
from hydroid.settings.study import Claim
from hydroid.studies.measures import Row

SIGNIFICANT = 0.05


class Outcome(Enum):
    """What the runs say of a claim."""

    CONFIRMED = "confirmed"
    OPEN = "not confirmed"
    CONTRADICTED = "contradicted"
    UNTESTED = "not tested"


@dataclass(frozen=True)
class Verdict:
    """A claim and what the runs say of it.

    Attributes:
        claim: what was tested.
        outcome: the answer.
        p: corrected by Holm's method; nan where untested.
        effect: rank-biserial correlation, from -1 to 1; nan where untested.
        medians: of the cell that should be lower, and of the other one.
        seeds: pairs.
    """

    claim: Claim
    outcome: Outcome
    p: float
    effect: float
    medians: tuple[float, float]
    seeds: int

    @property
    def sentence(self) -> str:
        """The verdict in a sentence."""
        if self.outcome is Outcome.UNTESTED:
            return f"{self.claim.says}: not tested ({self.seeds} seeds are too few for any answer)."
        low, high = (f"{m:.3g}" for m in self.medians)
        medians = f"median {self.claim.column} {low} against {high}"
        test = f"p = {self.p:.2g}, effect {self.effect:+.2f}, {self.seeds} seeds"
        return f"{self.claim.says}: {self.outcome.value} ({medians}; {test})."


def verdicts(claims: Sequence[Claim], rows: Sequence[Row]) -> list[Verdict]:
    """Return the verdict on every claim, with p-values corrected over all of them."""
    pairs = [_pairs(claim, rows) for claim in claims]
    testable = [len(p) and 2.0 ** (1 - len(p)) < SIGNIFICANT for p in pairs]
    raw = [
        signed_rank(p[:, 1] - p[:, 0]) if able else (np.nan, np.nan)
        for p, able in zip(pairs, testable, strict=True)
    ]
    corrected = holm(np.array([p for p, _ in raw]))
    return [
        Verdict(claim, _outcome(p, effect), p, effect, _medians(pair), len(pair))
        for claim, pair, p, (_, effect) in zip(claims, pairs, corrected.tolist(), raw, strict=True)
    ]


def signed_rank(difference: Array) -> tuple[float, float]:
    """Return Wilcoxon's two-sided p-value and the rank-biserial correlation of differences, shape (n,).

    Equal pairs are left out, as Wilcoxon did; if all are equal, p is 1 and the effect 0.
    """
    changed = difference[difference != 0]
    if not changed.size:
        return 1.0, 0.0
    ranks = rankdata(np.abs(changed))
    effect = float(np.sum(np.sign(changed) * ranks) / ranks.sum())
    test: Any = wilcoxon(changed)  # the stubs leave its type open
    return float(test.pvalue), effect


def holm(p: Array) -> Array:
    """Return p-values corrected by Holm's step-down method, shape (n,); nan stays and does not count."""
    corrected, known = np.full(len(p), np.nan), np.flatnonzero(np.isfinite(p))
    order = known[np.argsort(p[known], kind="stable")]
    corrected[order] = np.minimum(1.0, np.maximum.accumulate(p[order] * np.arange(len(order), 0, -1)))
    return corrected


def _pairs(claim: Claim, rows: Sequence[Row]) -> Array:
    """Return the measure of both cells on the seeds that both have, shape (n, 2)."""
    by_cell = [
        {row.seed: row.values[claim.column] for row in rows if row.cell == cell and not row.failed}
        for cell in (claim.lower, claim.than)
    ]
    both = [[values[seed] for values in by_cell] for seed in by_cell[0] if seed in by_cell[1]]
    pairs = np.array(both, dtype=float).reshape(-1, 2)
    return pairs[np.isfinite(pairs).all(axis=1)]


def _medians(pairs: Array) -> tuple[float, float]:
    low, high = np.median(pairs, axis=0) if len(pairs) else (np.nan, np.nan)
    return float(low), float(high)


def _outcome(p: float, effect: float) -> Outcome:
    if not np.isfinite(p):
        return Outcome.UNTESTED
    if p >= SIGNIFICANT:
        return Outcome.OPEN
    return Outcome.CONFIRMED if effect > 0 else Outcome.CONTRADICTED
