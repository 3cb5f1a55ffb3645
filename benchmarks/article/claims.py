"""Tests of claims: over the same seeds, does one cell have a lower measure than another?

Differences are paired by seed and tested by Wilcoxon's signed-rank test, two-sided. The p-values of all
claims of a study are corrected together by Holm's method. The effect size is the matched-pairs rank-biserial
correlation: 1 if the claim holds on every seed, -1 if its opposite does.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from scipy.stats import rankdata, wilcoxon
from studies import Claim

from hydroid.parameters import Array
from hydroid.studies.study import Row

SIGNIFICANT = 0.05


class Outcome(StrEnum):
    """What the runs say of a statement."""

    CONFIRMED = "confirmed"
    OPEN = "not confirmed"
    CONTRADICTED = "contradicted"
    UNTESTED = "not tested"


@dataclass(frozen=True)
class Verdict:
    """A statement, the article's item that makes it, what was found, and what that rests on."""

    says: str
    item: str
    outcome: Outcome
    detail: str
    ours: bool = False


def verdicts(claims: Sequence[Claim], rows: Sequence[Row]) -> list[Verdict]:
    """Return the verdict on every claim, with p-values corrected over all of them.

    Where even a difference on every seed would not be significant after the correction, none is tested.
    """
    every = [_pairs(claim, rows) for claim in claims]
    least = np.array([2.0 ** (1 - len(pairs)) for pairs in every])
    able = least < SIGNIFICANT
    family = int(able.sum())
    able &= least.min(initial=1.0) * family < SIGNIFICANT
    differences = [pairs[:, 1] - pairs[:, 0] for pairs in every]
    raw = [
        signed_rank(d) if tested else (np.nan, np.nan) for d, tested in zip(differences, able, strict=True)
    ]
    corrected = holm(np.array([p for p, _ in raw]))
    made: list[Verdict] = []
    for claim, pairs, p, (_, effect) in zip(claims, every, corrected, raw, strict=True):
        if np.isfinite(p):
            low, high = np.median(pairs, axis=0)
            outcome = Outcome.CONFIRMED if effect > 0 else Outcome.CONTRADICTED
            outcome = outcome if p < SIGNIFICANT else Outcome.OPEN
            detail = f"median {claim.column} {low:.3g} against {high:.3g}; p = {p:.2g}, effect {effect:+.2f}"
        else:
            outcome, detail = Outcome.UNTESTED, claim.untested or f"too few seeds for {family} claims"
        seeds = "" if claim.untested else f", {len(pairs)} seeds"
        made.append(Verdict(claim.says, claim.item, outcome, detail + seeds, claim.ours))
    return made


def _pairs(claim: Claim, rows: Sequence[Row]) -> Array:
    """Return the measure of both cells on the seeds that both have, shape (n, 2)."""
    lower, than = (
        {row.seed: row.values[claim.column] for row in rows if row.cell == cell and not row.failed}
        for cell in (claim.lower, claim.than)
    )
    pairs = np.array([(lower[seed], than[seed]) for seed in lower if seed in than], float).reshape(-1, 2)
    return pairs[np.isfinite(pairs).all(axis=1)]


def signed_rank(difference: Array) -> tuple[float, float]:
    """Return Wilcoxon's two-sided p-value and the rank-biserial correlation of differences, shape (n,).

    Equal pairs are left out, as Wilcoxon did; if all are equal, p is 1 and the effect 0.
    """
    changed = difference[difference != 0]
    if not changed.size:
        return 1.0, 0.0
    ranks = rankdata(np.abs(changed))
    test: Any = wilcoxon(changed)  # the stubs leave its type open
    return float(test.pvalue), float(np.sum(np.sign(changed) * ranks) / ranks.sum())


def holm(p: Array) -> Array:
    """Return p-values corrected by Holm's step-down method, shape (n,); nan stays and does not count."""
    corrected, known = np.full(len(p), np.nan), np.flatnonzero(np.isfinite(p))
    order = known[np.argsort(p[known], kind="stable")]
    corrected[order] = np.minimum(1.0, np.maximum.accumulate(p[order] * np.arange(len(order), 0, -1)))
    return corrected
